"""Gas volumes of a muscle: braid, dead volume and tube."""

from __future__ import annotations

from pam_model.robot.robot import Robot, RobotMuscle
from pam_model.robot.static_force import gas_volume as stretched_volume
from pam_model.views.muscle_path import lengths_over_travel

_PLACES = 9  # positions of a joint, to find the largest volume


def gas_volume(muscle: RobotMuscle, length: float) -> float:
    """Gas volume of a muscle of this length [m], with its dead volume [m^3].

    Raises
    ------
    DomainError
        If the force model is not defined at this length.
    """
    return float(muscle.force_model.volume(length)) + muscle.dead_volume


def gas_space(muscle: RobotMuscle, pressure: float, length: float) -> tuple[float, float, float]:
    """Gas volume of a muscle whose threads or cable may stretch, and its derivatives.

    Parameters
    ----------
    pressure : float
        [Pa gauge].
    length : float
        Of its path [m].

    Returns
    -------
    volume, by_length, by_pressure : float
        [m^3], with the dead volume; [m^2], [m^3/Pa].
    """
    volume, by_length, by_pressure = stretched_volume(muscle.force_model, pressure, length)
    return volume + muscle.dead_volume, by_length, by_pressure


def neutral_gas_volume(muscle: RobotMuscle) -> float:
    """Gas volume at position 0 of its joints [m^3]."""
    return gas_volume(muscle, muscle.neutral_length)


def largest_gas_volume(robot: Robot, muscle: RobotMuscle) -> float:
    """Largest gas volume over the range of its joints [m^3]."""
    return max(gas_volume(muscle, length) for length in lengths_over_travel(robot, muscle, _PLACES))


def tube_volume(muscle: RobotMuscle) -> float:
    """Volume between valve and muscle [m^3]; 0 without a tube."""
    tube = muscle.valve.tube
    return 0.0 if tube is None else tube.volume
