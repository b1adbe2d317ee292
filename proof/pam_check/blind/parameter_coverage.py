"""How often the interval of a parameter holds the true value.

Only parameters with a true value are compared: a delay, an offset, a torque. Where the laws differ
in what the parameter stands for (creep, hysteresis, leaks, tubes, heat, stretch of the threads),
there is none. Where they only differ in detail, the comparison is made, but it does not count: a
valve whose edges are rounded opens before the overlap is over, and a second pole of the spool is
more than a longer first one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from pam_check.blind.plants import FIRST, PLANTS
from pam_check.blind.score import share
from pam_gap.inference.candidates import SIDES
from pam_model.rig import Joint, Muscle, load_rig

type Numbers = Mapping[str, float]
"""Parameters of a joint or a muscle of the drawn rig (`truth_plant.TruthJoint`, `TruthMuscle`)."""

EVERY_PLANT: Final = tuple(PLANTS)


@dataclass(frozen=True, slots=True)
class TrueValue[Part: (Joint, Muscle)]:
    """True value of a parameter, from the drawn joint or muscle and its part of the rig file."""

    of: Callable[[Numbers, Part], float]
    counts_in: tuple[str, ...] = EVERY_PLANT
    """Plants in which the parameter means the same as in the simulation that is fitted."""


OF_JOINT: Final[Mapping[tuple[str, str], TrueValue[Joint]]] = {
    ("supply_droop", "volume"): TrueValue(lambda j, _: j["reservoir_volume"], (FIRST,)),
    ("supply_droop", "conductance"): TrueValue(lambda j, _: j["reservoir_conductance"], (FIRST,)),
    ("coulomb_friction", "torque"): TrueValue(lambda j, _: j["coulomb_torque"]),
    ("viscous_friction", "extra"): TrueValue(
        lambda j, rig: j["viscous_friction"] - rig.viscous_friction
    ),
    ("pulley_radius", "scale"): TrueValue(lambda j, rig: j["pulley_radius"] / rig.pulley_radius),
    ("position_offset", "offset"): TrueValue(lambda j, _: j["position_offset"]),
    ("position_delay", "delay"): TrueValue(lambda j, _: j["position_delay"]),
}
"""Parameters of a joint with a true value, by effect and name."""

OF_MUSCLE: Final[Mapping[tuple[str, str], TrueValue[Muscle]]] = {
    ("valve_dead_zone", "overlap"): TrueValue(lambda m, _: m["dead_zone"], ()),
    # The plants state the command at which the valve is shut, the effect the opening at zero.
    ("valve_null_offset", "offset"): TrueValue(lambda m, _: -m["null_offset"]),
    ("valve_lag", "extra_time_constant"): TrueValue(lambda m, _: m["second_pole"], ()),
    ("exhaust_restriction", "ratio"): TrueValue(lambda m, _: m["exhaust_ratio"], (FIRST,)),
    ("command_delay", "delay"): TrueValue(lambda m, _: m["command_delay"]),
    ("dead_volume", "extra_volume"): TrueValue(lambda m, rig: m["dead_volume"] - rig.dead_volume),
    ("end_caps", "factor"): TrueValue(lambda m, _: m["end_factor"], (FIRST,)),
    ("cable_compliance", "compliance"): TrueValue(lambda m, _: m["cable_compliance"], (FIRST,)),
    ("pressure_gain", "gain"): TrueValue(lambda m, _: m["pressure_gain"]),
    ("pressure_bias", "bias"): TrueValue(lambda m, _: m["pressure_bias"]),
    ("pressure_lag", "time_constant"): TrueValue(lambda m, _: m["pressure_lag"], (FIRST,)),
}
"""Parameters of a muscle with a true value, by effect and name."""


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
    counts: bool
    """Whether the parameter means the same in both simulations."""

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
    """All parameters of effects that were named rightly for which there is a true value.

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
                of_joint, of_muscle = OF_JOINT.get((effect, key)), OF_MUSCLE.get((effect, key))
                if of_joint is not None:
                    true = of_joint.of(label["joint"], rig.joints[0])
                    counts = plant in of_joint.counts_in
                elif of_muscle is not None:
                    sides = [SIDES.index(side)] if side else range(len(SIDES))
                    values = [of_muscle.of(label["muscles"][i], rig.muscles[i]) for i in sides]
                    true = sum(values) / len(values)
                    counts = plant in of_muscle.counts_in
                else:
                    continue
                low, value, high = (float(interval[k]) for k in ("low", "value", "high"))
                found.append(StatedParameter(case, effect, name, low, value, high, true, counts))
    return found


def by_parameter(parameters: Iterable[StatedParameter]) -> dict[str, dict[str, Any]]:
    """How often the intervals of each parameter hold the true value, for both sides together.

    Returns
    -------
    dict
        For each parameter a share for score.json, and `counts` of `StatedParameter`.
    """
    grouped: dict[str, list[StatedParameter]] = {}
    for one in parameters:
        grouped.setdefault(f"{one.effect}.{one.parameter.partition('.')[0]}", []).append(one)
    return {
        name: share([one.is_covered for one in stated]).to_json() | {"counts": stated[0].counts}
        for name, stated in sorted(grouped.items())
    }


def as_json(parameters: Iterable[StatedParameter]) -> list[dict[str, Any]]:
    """Give the parameters for score.json."""
    return [asdict(one) | {"covers": one.is_covered} for one in parameters]
