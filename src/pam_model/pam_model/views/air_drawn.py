"""Air that a muscle takes from the supply, by its recorded commands and pressures.

The flow of a flow valve follows ISO 6358, as in `expected_pressure`. The pressure before the valve
is not recorded. Therefore the flow is a line over this pressure, which is exact where it is choked.

The outlet p of a pressure regulator follows its set point with two poles, as in the plant: with
w = 1/time_constant, p' = w (s - p) and s' = w (u - s) + 2 (1 - damping) w (s - p). What it lets in
for p' is the flow; that which the motion of the muscle adds is left out.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from pam_model.gas import GAS_CONSTANT, reference_density, reference_flow
from pam_model.robot.robot import Robot, RobotMuscle
from pam_model.views.expected_pressure import ExpectedPressure
from pam_model.views.gas_volume import neutral_gas_volume

Array = npt.NDArray[np.float64]
SAG: Final = 0.1
"""Share of the supply's pressure over which the slope of the flow is taken."""
STEPS: Final = 5.0
"""Steps of the integration per time constant of a regulator."""


def air_drawn(
    robot: Robot, muscle: RobotMuscle, commands: Array, pressures: Array, period: float
) -> Array:
    """Flow from the supply into a muscle, at the density of the reference atmosphere.

    Parameters
    ----------
    robot : Robot
        Gives gas and supply.
    commands : ndarray, shape (n,)
        Spool from -1 to 1 of a flow valve, set point of a regulator [Pa gauge]; each is held for
        one period.
    pressures : ndarray, shape (n,)
        At the sensor [Pa gauge].
    period : float
        [s].

    Returns
    -------
    ndarray, shape (n, 2)
        In each period: flow with the full supply [m^3/s], and its slope over the pressure before
        the valve [m^3/(s Pa)].
    """
    gauge = (pressures - muscle.pressure_bias) / muscle.pressure_gain
    if muscle.valve.kind == "flow":
        return _by_flow_valve(robot, muscle, commands, gauge, period)
    return _by_regulator(robot, muscle, commands, gauge, period)


def _by_flow_valve(
    robot: Robot, muscle: RobotMuscle, commands: Array, gauge: Array, period: float
) -> Array:
    drawn = np.zeros((len(commands), 2))
    valve = ExpectedPressure(robot, muscle, period)
    density, full = reference_density(robot.gas.temperature), robot.supply.pressure
    low, state = (1.0 - SAG) * full, valve.init()
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


def _by_regulator(
    robot: Robot, muscle: RobotMuscle, commands: Array, gauge: Array, period: float
) -> Array:
    drawn, valve, gas = np.zeros((len(commands), 2)), muscle.valve, robot.gas
    heat = gas.polytropic_exponent * GAS_CONSTANT * gas.temperature
    per_rate = neutral_gas_volume(muscle) / (heat * reference_density(gas.temperature))
    late, rate = round(valve.command_delay / period), 1.0 / valve.time_constant
    delayed = np.concatenate([np.full(late, commands[0]), commands])[: len(commands)]
    steps = math.ceil(STEPS * period * rate)
    share, swing = period * rate / steps, 2.0 * (1.0 - valve.damping)
    aim = before = float(gauge[0])
    for row, wanted, shown in zip(drawn, delayed.tolist(), gauge.tolist(), strict=True):
        lead = swing * (shown - before) / (period * rate)
        before = shown
        for _ in range(steps):
            aim += share * (wanted - aim + lead)
        most = reference_flow(
            valve.sonic_conductance,
            valve.critical_ratio,
            robot.supply.pressure,
            max(shown, 0.0) + gas.ambient_pressure,
        )
        row[0] = min(max(per_rate * rate * (aim - shown), 0.0), max(most, 0.0))
    return drawn
