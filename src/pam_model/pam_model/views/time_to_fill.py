"""How long a muscle takes to fill through its fully open valve, from a supply that may sag.

The reservoir and the muscle are two polytropic chambers; the flows follow ISO 6358. The muscle
alone draws, so that several muscles that fill at once take longer.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pam_model.gas import GAS_CONSTANT, mass_flow
from pam_model.robot.robot import Robot, RobotMuscle
from pam_model.views.gas_volume import neutral_gas_volume, tube_volume
from pam_model.views.pressure_rate import entering_flow

Vector = npt.NDArray[np.float64]
LONGEST = 600.0  # s
_TOLERANCE = 1e-6


def time_to_fill(robot: Robot, muscle: RobotMuscle, low: float, high: float) -> float:
    """Time from one pressure to a higher one at joint position 0 [s].

    Parameters
    ----------
    robot : Robot
        Gives gas and supply; its reservoir is full at first.
    low, high : float
        [Pa gauge].

    Returns
    -------
    float
        Infinite if the muscle does not reach the pressure within `LONGEST`.
    """
    from scipy.integrate import solve_ivp  # noqa: PLC0415  (slow to import, seldom needed)

    gas, supply = robot.gas, robot.supply
    per_mass = gas.polytropic_exponent * GAS_CONSTANT * gas.temperature
    volume = neutral_gas_volume(muscle) + tube_volume(muscle)

    def rates(_: float, state: Vector) -> list[float]:
        inside, before = state.tolist()
        drawn = entering_flow(robot, muscle, 1.0, inside, before)
        if supply.is_ideal:
            return [per_mass * drawn / volume, 0.0]
        refill = mass_flow(
            supply.refill_conductance,
            muscle.valve.critical_ratio,
            supply.pressure,
            before,
            gas.temperature,
        )
        return [
            per_mass * drawn / volume,
            per_mass * (float(refill) - drawn) / supply.reservoir_volume,
        ]

    def reached(_: float, state: Vector) -> float:
        return float(state[0]) - high - gas.ambient_pressure

    reached.terminal = True  # type: ignore[attr-defined]
    solved = solve_ivp(
        rates,
        (0.0, LONGEST),
        [low + gas.ambient_pressure, supply.pressure],
        method="LSODA",
        events=reached,
        rtol=_TOLERANCE,
        atol=1.0,
    )
    return float(solved.t_events[0][0]) if len(solved.t_events[0]) else math.inf


def delay_of_supply(robot: Robot, muscle: RobotMuscle, pressure: float) -> float:
    """How much longer an empty muscle takes to a pressure because the supply sags [s].

    Parameters
    ----------
    robot, muscle
        As for `time_to_fill`.
    pressure : float
        [Pa gauge].

    Returns
    -------
    float
        0 for an ideal supply, at most `LONGEST`.
    """
    if robot.supply.is_ideal:
        return 0.0
    steady = replace(robot, supply=replace(robot.supply, refill_conductance=0.0))
    longer = time_to_fill(robot, muscle, 0.0, pressure) - time_to_fill(
        steady, muscle, 0.0, pressure
    )
    return min(max(longer, 0.0), LONGEST)
