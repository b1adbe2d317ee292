"""A joint whose valves are shut, as a spring, and the speed that the air in it can still drive.

The air in the muscles drives the joint on when the valves have shut. A joint with the acceleration
a on a spring with the natural frequency w gains at most

    v = |a| / w,    w^2 = K/J

from where its acceleration vanishes. K is the stiffness of joint and gravity with shut valves: the
muscle models give it at the measured pressures, with the gas compressed polytropically. A valve
that is a pressure regulator holds its pressure, so that only the muscle's own stiffness counts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from pam_model.robot.robot import Robot, RobotJoint, RobotMuscle
from pam_model.views.gas_volume import gas_volume
from pam_model.views.gravity import gravity_stiffness
from pam_model.views.muscle_path import path_length

_STRETCH = 1e-5  # m, of the difference quotient of force and length


def shut_muscle_stiffness(
    robot: Robot, muscle: RobotMuscle, pressure: float, length: float
) -> float:
    """Change of the force with the length while its valve is shut [N/m].

    Raises
    ------
    PamError
        If the force model is not defined at this length.
    """
    gas, model = robot.gas, muscle.force_model
    exponent = gas.polytropic_exponent if muscle.valve.kind == "flow" else 0.0
    pressure, longer = max(pressure, 0.0), length + _STRETCH
    volume = gas_volume(muscle, length)
    change = gas_volume(muscle, longer) - volume
    after = pressure - exponent * (pressure + gas.ambient_pressure) * change / volume
    force = float(model.force(pressure, length))
    return (float(model.force(max(after, 0.0), longer)) - force) / _STRETCH


def shut_joint_stiffness(
    robot: Robot, joint: RobotJoint, pressures: Sequence[float], positions: Sequence[float]
) -> float:
    """Stiffness of a joint with shut valves, with that of gravity [N m/rad].

    Raises
    ------
    PamError
        If a force model is not defined at these positions.
    """
    total = gravity_stiffness(joint, positions[joint.place])
    for arm in joint.arms:
        muscle = robot.muscles[arm.muscle]
        length = path_length(muscle, positions)
        total += arm.length**2 * shut_muscle_stiffness(robot, muscle, pressures[arm.muscle], length)
    return total


def driven_speed(
    robot: Robot,
    joint: RobotJoint,
    acceleration: float,
    pressures: Sequence[float],
    positions: Sequence[float],
) -> float:
    """The speed that the present acceleration can add [rad/s]; 0 where there is no spring.

    Parameters
    ----------
    robot, joint, pressures, positions
        As for `shut_joint_stiffness`.
    acceleration : float
        Measured, so that payload and friction are contained in it [rad/s^2].

    Raises
    ------
    PamError
        As for `shut_joint_stiffness`.
    """
    stiffness = shut_joint_stiffness(robot, joint, pressures, positions)
    if not stiffness > 0.0:  # also if a measurement is missing
        return 0.0
    return abs(acceleration) * math.sqrt(joint.inertia / stiffness)
