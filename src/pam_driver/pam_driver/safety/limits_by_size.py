"""Limits of plausibility that follow from a rig where its file leaves them open.

A deviation of a pressure that is a fault on one rig is the ordinary error of the model on another,
and can never be reached on a third. Two numbers of a muscle decide. The observer of the gas
deviates by what flows wrongly, over its gain: by a share of r/L at most, where r is how fast the
open valve fills the muscle at ambient pressure. And no pressure deviates by more than a muscle
holds. The shares are those that the elbow of config/ was tried with.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pam_model.robot import Robot, RobotJoint, RobotMuscle
from pam_model.views.pressure_rate import fastest_sensor_rate, filling_rate

OBSERVER_GAIN: Final = 5.0  # 1/s
_OF_FILLING: Final = 0.3  # of r/L
_OF_PRESSURE: Final = 1.0 / 6.0  # of the highest pressure, if that is less
_LEAST_OF_PRESSURE: Final = 0.05  # of the highest pressure, for slow valves: errors of sensors
_NOISE: Final = 1.0 / 60.0  # of the highest pressure
_FASTEST: Final = 2.7  # of r at the sensor, at the volume at joint position 0
_NOISE_STEPS: Final = 5.0  # standard deviations of noise that are no step of the pressure
_STEP_TIME: Final = 0.01  # s, over which a rate is taken
_JUMP: Final = 10.0 / 3.0  # of the way at the largest speed in that time
_POSITION_NOISE: Final = 0.01  # of the range of a joint, at most
_MOST_POSITION_NOISE: Final = 0.02  # rad


def _given(value: float | None, by_size: float) -> float:
    return by_size if value is None else value


def pressure_residual(robot: Robot, muscle: RobotMuscle) -> float:
    """Deviation of a pressure from what valve and gas should give that is a fault [Pa]."""
    filling = _OF_FILLING * filling_rate(robot, muscle) / OBSERVER_GAIN
    share = float(np.clip(filling / muscle.max_pressure, _LEAST_OF_PRESSURE, _OF_PRESSURE))
    return _given(robot.plausibility.pressure_residual, share * muscle.max_pressure)


def pressure_noise(robot: Robot, muscle: RobotMuscle) -> float:
    """Noise of a pressure sensor that is a fault [Pa]."""
    return _given(robot.plausibility.pressure_noise, _NOISE * muscle.max_pressure)


def pressure_rate_limit(robot: Robot, muscle: RobotMuscle) -> float:
    """Rate of a pressure, over 10 ms, that no valve gives [Pa/s]."""
    noise = _NOISE_STEPS * _NOISE * muscle.max_pressure / _STEP_TIME
    rate = max(_FASTEST * fastest_sensor_rate(robot, muscle), noise)
    return _given(robot.plausibility.pressure_rate, rate)


def position_jump(robot: Robot, joint: RobotJoint) -> float:
    """Change of an angle within 10 ms that no joint makes [rad]."""
    return _given(robot.plausibility.position_jump, _JUMP * joint.max_velocity * _STEP_TIME)


def position_noise(robot: Robot, joint: RobotJoint) -> float:
    """Noise of an encoder that is a fault [rad]."""
    low, high = joint.position_limits
    by_size = min(_POSITION_NOISE * (high - low), _MOST_POSITION_NOISE)
    return _given(robot.plausibility.position_noise, by_size)
