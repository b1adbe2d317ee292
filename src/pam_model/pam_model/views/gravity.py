"""The torque of gravity at a joint, and how it changes with the angle.

The joints of a rig file do not act on one another: each has a gravity torque of its own.
"""

from __future__ import annotations

import math

from pam_model.robot.robot import RobotJoint


def gravity_torque(joint: RobotJoint, position: float) -> float:
    """Torque of gravity [N m] at a position [rad]."""
    return -joint.gravity_torque * math.sin(position - joint.gravity_angle)


def gravity_stiffness(joint: RobotJoint, position: float) -> float:
    """Stiffness that gravity adds [N m/rad], -d torque/dq, at a position [rad]."""
    return joint.gravity_torque * math.cos(position - joint.gravity_angle)


def hanging_position(joint: RobotJoint) -> float:
    """The position at which the joint hangs at rest [rad]."""
    return joint.gravity_angle + (math.pi if joint.gravity_torque < 0.0 else 0.0)


def largest_gravity_torque(joint: RobotJoint, angle: float = 0.5 * math.pi) -> float:
    """Magnitude of gravity's torque [N m] at an angle [rad] from where the joint hangs."""
    return abs(joint.gravity_torque) * math.sin(angle)
