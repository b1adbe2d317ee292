"""How fast an open exhaust takes pressure and torque away from a muscle."""

from __future__ import annotations

from collections.abc import Sequence

from pam_model.rig.arms import Arm
from pam_model.robot.robot import Robot, RobotMuscle
from pam_model.views.gas_volume import gas_volume
from pam_model.views.muscle_path import path_length
from pam_model.views.pressure_rate import pressure_rate
from pam_model.views.torque_balance import pull

_PRESSURE_STEP = 1e3  # Pa, of the difference quotient of force and pressure


def exhaust_pressure_rate(
    robot: Robot, muscle: RobotMuscle, pressure: float, positions: Sequence[float]
) -> float:
    """How fast the pressure falls with the exhaust fully open [Pa/s], at least 0.

    Raises
    ------
    PamError
        If the force model is not defined at these positions.
    """
    inside = max(pressure, 0.0) + robot.gas.ambient_pressure
    volume = gas_volume(muscle, path_length(muscle, positions))
    return max(-pressure_rate(robot, muscle, -1.0, inside, volume), 0.0)


def exhaust_torque_rate(
    robot: Robot, arm: Arm, pressure: float, positions: Sequence[float]
) -> float:
    """How fast the magnitude of a muscle's torque falls with its exhaust fully open [N m/s].

    Never below 0. Parameters and errors are those of `exhaust_pressure_rate`.
    """
    muscle = robot.muscles[arm.muscle]
    more = pull(muscle, max(pressure, 0.0) + _PRESSURE_STEP, positions)
    slope = abs(arm.length) * (more - pull(muscle, pressure, positions)) / _PRESSURE_STEP
    return max(slope, 0.0) * exhaust_pressure_rate(robot, muscle, pressure, positions)
