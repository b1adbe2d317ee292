"""How often the interval of a parameter holds the true value.

Parameters with a true value in `effect_cases` are compared: a delay, an offset, a torque. Where
the laws differ in what the parameter stands for (creep, hysteresis, leaks, tubes, heat, stretch of
the threads), there is none. Where they only differ in detail, the comparison is made, but it does
not count: a valve whose edges are rounded opens before the overlap is over, and a second pole of
the spool is more than a longer first one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pam_check.blind.effect_cases import case_of
from pam_check.blind.plants import FIRST
from pam_check.blind.score import share
from pam_model.plant.joint_muscles import SIDES
from pam_model.rig import load_rig


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
            row = case_of(effect)
            for name, interval in stated[effect].items():
                key, _, side = name.partition(".")
                of_joint, of_muscle = row.of_joint.get(key), row.of_muscle.get(key)
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
