"""What torque a joint's muscles can give, and whether it holds the joint against gravity."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pam_model.joints.joint_statics import JointStatics
from pam_model.robot.robot import Robot, RobotJoint
from pam_model.views.gravity import gravity_torque

_POSITIONS = 41
_SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)


def torque_range(
    robot: Robot, joint: RobotJoint, position: float, *, supplied: bool = True
) -> tuple[float, float]:
    """Least and largest torque of the muscles at a position [N m].

    Parameters
    ----------
    position : float
        [rad]; outside the range of the force models the nearest position counts.
    supplied : bool, optional
        Whether the supply limits the pressures, too, and not only `max_pressure`.

    Raises
    ------
    DomainError
        If the force models do not cover the joint's range.
    """
    statics = JointStatics.from_robot(robot, joint)
    low, high = statics.position_range
    inside = min(max(position, low), high) if supplied else position
    pressures = [
        muscle.high_pressure if supplied else robot.muscles[place].max_pressure
        for muscle, place in zip(statics.muscles, joint.muscles, strict=True)
    ]
    return statics.torque_range(pressures, inside)


def largest_torque(robot: Robot, joint: RobotJoint) -> float:
    """Largest torque of one muscle at its `max_pressure` within the joint's limits [N m].

    Raises
    ------
    DomainError
        As for `torque_range`.
    """
    return max(
        abs(torque)
        for position in np.linspace(*joint.position_limits, _POSITIONS)
        for torque in torque_range(robot, joint, float(position), supplied=False)
    )


class AngleNotHeld(NamedTuple):
    """An angle that the muscles cannot hold."""

    position: float  # [rad]
    # gravity, muscles: magnitudes of gravity's torque and of the largest torque against it [N m]
    gravity: float
    muscles: float


def first_angle_not_held(robot: Robot, joint: RobotJoint) -> AngleNotHeld | None:
    """The first of five angles over a joint's range where gravity is stronger than the muscles.

    Parameters and errors are those of `torque_range`.

    Returns
    -------
    AngleNotHeld or None
        None if the joint can stay at all five angles.
    """
    lower, upper = joint.position_limits
    for share in _SHARES:
        position = lower + share * (upper - lower)
        gravity = gravity_torque(joint, position)
        least, most = torque_range(robot, joint, position)
        against = most if gravity < 0.0 else least
        if abs(gravity) > abs(against):
            return AngleNotHeld(position, abs(gravity), abs(against))
    return None
