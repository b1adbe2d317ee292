"""The torque of the muscles, and what gravity, friction and motion take of it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pam_model.effects.slots import DryFriction, JointTorque
from pam_model.robot.robot import Robot, RobotJoint, RobotMuscle
from pam_model.views.gravity import gravity_torque
from pam_model.views.muscle_path import path_length


def pull(muscle: RobotMuscle, pressure: float, positions: Sequence[float]) -> float:
    """Static pull of a muscle [N]; a pressure below ambient counts as ambient.

    Raises
    ------
    PamError
        If the force model is not defined at these positions.
    """
    return float(muscle.force_model.force(max(pressure, 0.0), path_length(muscle, positions)))


def muscle_torque(
    robot: Robot, joint: RobotJoint, pressures: Sequence[float], positions: Sequence[float]
) -> float:
    """Torque of all muscles at a joint [N m].

    Raises
    ------
    PamError
        As for `pull`.
    """
    return sum(
        arm.length * pull(robot.muscles[arm.muscle], pressures[arm.muscle], positions)
        for arm in joint.arms
    )


def unbalanced_torque(joint: RobotJoint, torque: float, position: float, velocity: float) -> float:
    """What remains of the torque of the muscles to accelerate the joint [N m].

    Damping, gravity and the torques of effects are taken off. Dry friction is not: its direction at
    rest is unknown, see `dry_friction_at_rest`.

    Parameters
    ----------
    torque : float
        Of its muscles [N m].
    position, velocity : float
        Of the joint [rad], [rad/s].
    """
    rest = torque - joint.viscous_friction * velocity + gravity_torque(joint, position)
    for _, slot, values in joint.laws(JointTorque):
        rest += slot.law(position, velocity, *values)
    return rest


def inertia_torque(joint: RobotJoint, acceleration: float) -> float:
    """Torque that an acceleration [rad/s^2] of the joint needs [N m]."""
    return joint.inertia * acceleration


def critical_damping(joint: RobotJoint, stiffness: float) -> float:
    """Damping [N m s/rad] above which a joint on a spring [N m/rad] does not swing."""
    return 2.0 * math.sqrt(stiffness * joint.inertia)


def free_acceleration(joint: RobotJoint, torque: float, position: float, velocity: float) -> float:
    """Acceleration without dry friction [rad/s^2]; parameters as for `unbalanced_torque`."""
    return unbalanced_torque(joint, torque, position, velocity) / joint.inertia


def dry_friction_at_rest(joint: RobotJoint) -> float:
    """Largest torque of dry friction before the joint moves [N m]."""
    return sum(slot.law(0.0, *values) for _, slot, values in joint.laws(DryFriction))


def torque_scale(robot: Robot, joint: RobotJoint) -> float:
    """Torque of the first muscle alone at its highest pressure and position 0 [N m]."""
    arm = joint.arms[0]
    muscle = robot.muscles[arm.muscle]
    return abs(arm.length) * pull(muscle, muscle.max_pressure, [0.0] * len(robot.joints))
