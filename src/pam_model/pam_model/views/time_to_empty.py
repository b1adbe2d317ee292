"""How long a muscle takes to become empty through its fully open exhaust.

The exhaust is that of the valve, with what restricts it and a tube before it. The chamber is
polytropic. The gas of a tube counts at the pressure of the muscle, the highest that it can have,
and a leak, which would help, is not counted: the true time is no longer than this.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pam_model.robot.robot import Robot, RobotMuscle
from pam_model.views.gas_volume import largest_gas_volume, neutral_gas_volume
from pam_model.views.pressure_rate import pressure_rate

_STEPS = 200


def time_to_empty(robot: Robot, muscle: RobotMuscle, high: float, low: float) -> float:
    """Time from one pressure to a lower one at the largest volume over the joint's range [s].

    Parameters
    ----------
    robot : Robot
        Gives the gas.
    high, low : float
        [Pa gauge], `low` above 0.
    """
    volume, ambient = largest_gas_volume(robot, muscle), robot.gas.ambient_pressure
    grid = (np.geomspace(high, low, _STEPS + 1) + ambient).tolist()
    time = 0.0
    for above, below in pairwise(grid):
        rate = pressure_rate(robot, muscle, -1.0, 0.5 * (above + below), volume)
        time += (above - below) / -rate
    return time


def emptying_time_constant(robot: Robot, muscle: RobotMuscle, pressure: float) -> float:
    """The pressure over the rate at which it falls, at joint position 0 [s].

    Near ambient pressure the flow falls with the pressure, so that the pressure decays with about
    this time constant.

    Parameters
    ----------
    robot, muscle
        As for `time_to_empty`.
    pressure : float
        [Pa gauge].
    """
    inside = pressure + robot.gas.ambient_pressure
    return pressure / -pressure_rate(robot, muscle, -1.0, inside, neutral_gas_volume(muscle))
