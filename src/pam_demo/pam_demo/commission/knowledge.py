"""What is known of the numbers of a rig: an interval for each, as written and as identified.

A log fixes most numbers relative to the torque per pressure. The motion does not depend on this
common factor, so the intervals that hold for the right torque per pressure are the ones that
count. Lengths and turns, whose combination the motions have shown, then keep the found values.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from pam_gap.answer.improved_rig import with_number
from pam_gap.calibration.calibration import KEPT, CalibratedNumber
from pam_gap.calibration.calibration_rules import CalibrationRules
from pam_gap.calibration.free_numbers import STATICS, FreeRigNumber, Said, free_numbers
from pam_model.joints.joint_statics import JointStatics
from pam_model.plant.parameters import NAMES, PlantParameters
from pam_model.rig import Rig
from pam_model.rig.partial import PartialRig

UNKNOWN: Final = 4.0
"""A missing number is within this factor of the guess that its muscles' torque gives."""
HEAVIEST: Final = 0.5
"""A missing gravity torque is at most this share of the torque of the agonist at its highest
pressure, because the muscles have to move the joint as well [-]."""
HANGS_WITHIN: Final = 0.5
"""Without a gravity angle, the joint hangs in this share of its range, about the middle [-]."""
UNIFORM: Final = math.sqrt(3.0)
"""Half width of a uniform distribution over its standard deviation."""


@dataclass(frozen=True, slots=True)
class Known:
    """One number."""

    name: str  # of the plant parameter
    key: str  # in the rig file
    # value, low, high: the most likely value, and the ends of its interval
    value: float
    low: float
    high: float
    is_length: bool = False  # whether it is one of the lengths and turns


def as_written(partial: PartialRig, said: Said, rules: CalibrationRules) -> tuple[Known, ...]:
    """What the rig file says.

    Parameters
    ----------
    partial : PartialRig
        With one joint.
    said : Said
        How far plain numbers may be off.
    rules : CalibrationRules
        How far an angle may be off.
    """
    weight = _weight(partial.rig)
    known = []
    for one in _numbers(partial, said, rules):
        value = one.free.centre
        if one.written is None and one.name in weight:
            low, high = weight[one.name]
        elif one.written is None and not one.free.prior > 0.0:
            low, high = value / UNKNOWN, value * UNKNOWN
        elif one.key in partial.ranges:
            low, high = partial.ranges[one.key]
        elif one.free.is_logarithmic:
            reach = math.exp(UNIFORM * one.free.prior)
            low, high = value / reach, value * reach
        else:
            low, high = value - UNIFORM * one.free.prior, value + UNIFORM * one.free.prior
        low, high = sorted((low, high))
        known.append(Known(one.name, one.key, value, low, high, one.stage == STATICS))
    return tuple(known)


def _weight(rig: Rig) -> dict[str, tuple[float, float]]:
    """What is known of the weight of a joint of which nothing is written: it hangs at first."""
    joint, (lower, upper) = rig.joints[0], rig.joints[0].position_limits
    highest = rig.muscle(joint.agonist).max_pressure
    torque = float(JointStatics.from_rig(rig).torque((highest, 0.0), 0.0))
    middle, half = 0.5 * (lower + upper), 0.5 * HANGS_WITHIN * (upper - lower)
    return {
        "joint.gravity_torque": (0.0, HEAVIEST * max(torque, 0.0)),
        "joint.gravity_angle": (middle - half, middle + half),
    }


def _numbers(partial: PartialRig, said: Said, rules: CalibrationRules) -> list[FreeRigNumber]:
    start: Mapping[str, float] = dict(
        zip(NAMES, PlantParameters.from_rig(partial.rig).values.tolist(), strict=True)
    )
    joint = partial.rig.joints[0]
    found = free_numbers(partial, joint, start, said, rules, has_commands=True)
    return [one for one in found if not one.is_ordinary and not one.is_sensor]


PULL_PER_LENGTH: Final = 9.0
"""Relative change of r (3 L^2 - b^2)/(4 pi n^2) for that of its lengths and turns, all at their
worst: 1 of r, 2 of n, 4 of L and 2 of b at L = 0.82 b [-]."""


LENGTHENING: Mapping[str, bool] = {"thread_length": True, "neutral_length": False}
"""Whether a larger number lets a muscle reach further: it cannot be longer than its threads."""
SHARES: Final = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)


def reaching_limits(rig: Rig, known: Sequence[Known]) -> Rig:
    """The rig whose muscles reach both position limits, as near to what is written as possible.

    The robot does reach them, so lengths with which it could not are wrong. They are changed within
    their intervals; the rig is returned as changed most if that is not enough.
    """
    joint = rig.joints[0]
    lower, upper = joint.position_limits
    changed = rig
    for share in SHARES:
        for one in known:
            longer = LENGTHENING.get(one.name.rpartition(".")[2])
            if longer is not None:
                value = one.value + share * ((one.high if longer else one.low) - one.value)
                changed = with_number(changed, joint.name, one.name, value)
        low, high = JointStatics.from_rig(changed).position_range
        if low <= lower and upper <= high:
            break
    return changed


COASTS: Final = 3.0
"""A joint that hardly anything holds goes on turning after a pulse, by this factor at most [-]."""


def easily_turned(rig: Rig, known: Sequence[Known], said: Said) -> Rig:
    """The rig that a test pulse turns furthest, of those within the intervals.

    Lengths stay as they are written, so that they fit each other; instead, inertia and weight are
    smaller by as much as the pull may be stronger. The check then ends a pulse as soon as the joint
    has turned enough to be seen.
    """
    joint, pull = rig.joint_names[0], COASTS * math.exp(PULL_PER_LENGTH * said.lengths)
    for one in known:
        if one.name in ("joint.inertia", "joint.gravity_torque"):
            rig = with_number(rig, joint, one.name, one.low / pull)
    return rig


def narrowed(before: Sequence[Known], found: Sequence[CalibratedNumber]) -> tuple[Known, ...]:
    """What is known after a calibration, of which the intervals count that hold for the motion."""
    by_key = {one.key: one for one in found}
    known = []
    for one in before:
        number = by_key.get(one.key)
        if number is None or number.status == KEPT:
            known.append(one)
        elif number.stage == STATICS:
            value = number.value
            known.append(Known(one.name, one.key, value, value, value, is_length=True))
        else:
            ends = number.relative or (number.low, number.high)
            known.append(Known(one.name, one.key, number.value, *ends))
    return tuple(known)
