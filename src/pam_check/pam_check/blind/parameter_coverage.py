"""How often the interval of a parameter holds the true value.

Only parameters count that mean the same in the plant that made the recordings and in the
simulation that is fitted: a delay, an offset, a torque. Where the laws differ (creep, hysteresis,
leaks, tubes, heat, stretch of the threads), there is no true value of the fitted parameter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from pam_check.blind.plants import FIRST
from pam_check.blind.score import Share, share
from pam_gap.inference.candidates import SIDES
from pam_model.rig import Joint, Muscle, load_rig

type Numbers = Mapping[str, float]
"""Parameters of a joint or a muscle of the drawn rig (`truth_plant.TruthJoint`, `TruthMuscle`)."""


@dataclass(frozen=True, slots=True)
class OfJoint:
    """True value of a parameter of a joint, from the drawn joint and its rig file."""

    value: Callable[[Numbers, Joint], float]
    in_every_plant: bool = True
    """Whether it means the same in the second plant, too."""


@dataclass(frozen=True, slots=True)
class OfMuscle:
    """True value of a parameter of a muscle, from the drawn muscle and its rig file."""

    value: Callable[[Numbers, Muscle], float]
    in_every_plant: bool = True
    """Whether it means the same in the second plant, too."""


COMPARABLE: Final[Mapping[tuple[str, str], OfJoint | OfMuscle]] = {
    ("valve_dead_zone", "overlap"): OfMuscle(lambda m, _: m["dead_zone"], in_every_plant=False),
    # The plants state the command at which the valve is shut, the effect the opening at zero.
    ("valve_null_offset", "offset"): OfMuscle(lambda m, _: -m["null_offset"]),
    ("valve_lag", "extra_time_constant"): OfMuscle(
        lambda m, _: m["second_pole"], in_every_plant=False
    ),
    ("exhaust_restriction", "ratio"): OfMuscle(
        lambda m, _: m["exhaust_ratio"], in_every_plant=False
    ),
    ("supply_droop", "volume"): OfJoint(lambda j, _: j["reservoir_volume"], in_every_plant=False),
    ("supply_droop", "conductance"): OfJoint(
        lambda j, _: j["reservoir_conductance"], in_every_plant=False
    ),
    ("command_delay", "delay"): OfMuscle(lambda m, _: m["command_delay"]),
    ("dead_volume", "extra_volume"): OfMuscle(lambda m, rig: m["dead_volume"] - rig.dead_volume),
    ("end_caps", "factor"): OfMuscle(lambda m, _: m["end_factor"], in_every_plant=False),
    ("cable_compliance", "compliance"): OfMuscle(
        lambda m, _: m["cable_compliance"], in_every_plant=False
    ),
    ("coulomb_friction", "torque"): OfJoint(lambda j, _: j["coulomb_torque"]),
    ("viscous_friction", "extra"): OfJoint(
        lambda j, rig: j["viscous_friction"] - rig.viscous_friction
    ),
    ("pulley_radius", "scale"): OfJoint(lambda j, rig: j["pulley_radius"] / rig.pulley_radius),
    ("position_offset", "offset"): OfJoint(lambda j, _: j["position_offset"]),
    ("position_delay", "delay"): OfJoint(lambda j, _: j["position_delay"]),
    ("pressure_gain", "gain"): OfMuscle(lambda m, _: m["pressure_gain"]),
    ("pressure_bias", "bias"): OfMuscle(lambda m, _: m["pressure_bias"]),
    ("pressure_lag", "time_constant"): OfMuscle(
        lambda m, _: m["pressure_lag"], in_every_plant=False
    ),
}
"""Parameters with a true value, by effect and name."""


@dataclass(frozen=True, slots=True)
class StatedParameter:
    """A parameter with its stated 90 % interval and the true value."""

    case: str
    effect: str
    parameter: str
    low: float
    value: float
    high: float
    true: float

    @property
    def is_covered(self) -> bool:
        """Whether the interval holds the true value."""
        return self.low <= self.true <= self.high


def stated_parameters(
    labels: Iterable[Mapping[str, Any]],
    answers: Mapping[str, Mapping[str, Any]],
    cases: Path,
    plant: str = FIRST,
) -> list[StatedParameter]:
    """All comparable parameters of effects that were named rightly.

    The value of a parameter that both muscles share is compared with the mean of the true ones.

    Parameters
    ----------
    labels, answers
        As for `pam_check.blind.score.score`.
    cases : Path
        Folder with a folder of each case, which holds the rig file.
    plant : str
        Plant that made the recordings.
    """
    found = []
    for label in labels:
        case = str(label["case"])
        stated = (answers.get(case) or {}).get("parameters") or {}
        right = [effect for effect in stated if effect in label["effects"]]
        if not right:
            continue
        rig = load_rig(cases / case / "rig.yaml")
        for effect in right:
            for name, interval in stated[effect].items():
                key, _, side = name.partition(".")
                place = COMPARABLE.get((effect, key))
                if place is None or not (plant == FIRST or place.in_every_plant):
                    continue
                if isinstance(place, OfJoint):
                    true = place.value(label["joint"], rig.joints[0])
                else:
                    sides = [SIDES.index(side)] if side else range(len(SIDES))
                    values = [place.value(label["muscles"][i], rig.muscles[i]) for i in sides]
                    true = sum(values) / len(values)
                low, value, high = (float(interval[k]) for k in ("low", "value", "high"))
                found.append(StatedParameter(case, effect, name, low, value, high, true))
    return found


def by_parameter(parameters: Iterable[StatedParameter]) -> dict[str, Share]:
    """How often the intervals of each parameter hold the true value, for both sides together."""
    outcomes: dict[str, list[bool]] = {}
    for one in parameters:
        name = f"{one.effect}.{one.parameter.partition('.')[0]}"
        outcomes.setdefault(name, []).append(one.is_covered)
    return {name: share(covered) for name, covered in sorted(outcomes.items())}


def as_json(parameters: Iterable[StatedParameter]) -> list[dict[str, Any]]:
    """Give the parameters for score.json."""
    return [asdict(one) | {"covers": one.is_covered} for one in parameters]
