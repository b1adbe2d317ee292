"""Air that a muscle takes from the supply, by its recorded commands and pressures.

The flow of the valve follows ISO 6358, as in `expected_pressure`. The pressure before the valve is
not recorded. Therefore the flow is a line over this pressure, which is exact where it is choked.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from pam_model.gas import reference_density
from pam_model.robot.robot import Robot, RobotMuscle
from pam_model.views.expected_pressure import ExpectedPressure

Array = npt.NDArray[np.float64]
SAG: Final = 0.1
"""Share of the supply's pressure over which the slope of the flow is taken."""


def air_drawn(
    robot: Robot, muscle: RobotMuscle, commands: Array, pressures: Array, period: float
) -> Array:
    """Flow from the supply into a muscle, at the density of the reference atmosphere.

    Parameters
    ----------
    robot : Robot
        Gives gas and supply.
    muscle : RobotMuscle
        One of its muscles.
    commands : ndarray, shape (n,)
        Spool from -1 to 1 of a flow valve; each is held for one period.
    pressures : ndarray, shape (n,)
        At the sensor [Pa gauge].
    period : float
        [s].

    Returns
    -------
    ndarray, shape (n, 2)
        In each period: flow with the full supply [m^3/s], and its slope over the pressure before
        the valve [m^3/(s Pa)]. Zeros for a pressure regulator, whose opening is not recorded.
    """
    drawn = np.zeros((len(commands), 2))
    if muscle.valve.kind != "flow":
        return drawn
    valve, density = (
        ExpectedPressure(robot, muscle, period),
        reference_density(robot.gas.temperature),
    )
    full = robot.supply.pressure
    low, state = (1.0 - SAG) * full, valve.init()
    gauge = (pressures - muscle.pressure_bias) / muscle.pressure_gain
    absolute = np.maximum(gauge + robot.gas.ambient_pressure, 1.0).tolist()
    for row, command, pressure in zip(drawn, commands.tolist(), absolute, strict=True):
        state, acts = valve.delayed(state, command)
        after, rate = valve.spool_after(state, acts)
        spool = 0.5 * (state.spool + after)
        if spool > 0.0:
            flow, less = (
                max(valve.entering(spool, pressure, supply), 0.0) / density
                for supply in (full, low)
            )
            row[:] = flow, (flow - less) / (full - low)
        state = state._replace(spool=after, spool_rate=rate)
    return drawn
