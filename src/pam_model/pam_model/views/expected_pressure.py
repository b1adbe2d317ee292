"""The pressure that a valve command should cause in a muscle: valve, tube, leaks and chamber.

`ExpectedPressure` has the numbers of one muscle, `init` gives its state and `step` advances the
state by one period: an open-loop model, which an observer corrects with the measurements.

The flow follows ISO 6358, the chamber is polytropic, the spool a first-order lag; what a regulator
aims at follows its set point with two poles. The joint's angle is held within the position limits.
Behind a tube, the sensor's pressure is that at the valve.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from pam_model.effects.slots import Leak, Opening
from pam_model.gas import pressure_rate, reference_density, valve_flow
from pam_model.robot.robot import Robot, RobotMuscle
from pam_model.views.muscle_path import strokes_over_travel
from pam_model.views.tube_gas import LOWEST, TubeGas

_VOLUME_POINTS: Final = 16
# A regulator opens fully until the pressure is this close to its set point [Pa].
_REGULATED: Final = 2e4


class GasState(NamedTuple):
    """The gas of one muscle."""

    # those that do not act yet because of the command's delay, the oldest first
    commands: tuple[float, ...]
    spool: float  # command after the lag of the spool or the regulator, as fraction of full scale
    # at_sensor, inside: Pressures at the sensor and in the muscle [Pa absolute]; equal without a
    # tube. NaN: unknown.
    at_sensor: float
    inside: float
    spool_rate: float = 0.0  # rate of `spool` behind a regulator [1/s]

    def corrected(self, change: float) -> GasState:
        """The state with both pressures changed by `change` [Pa]."""
        at_sensor = max(self.at_sensor + change, LOWEST)
        inside = max(self.inside + change, LOWEST)
        return GasState(self.commands, self.spool, at_sensor, inside, self.spool_rate)

    def known(self, pressure: float) -> GasState:
        """The state with this pressure at the sensor and in the muscle [Pa absolute]."""
        return self._replace(at_sensor=pressure, inside=pressure)


def _spool_lag(
    period: float, time_constant: float, damping: float | None
) -> tuple[tuple[float, float], tuple[float, float]]:
    """What a period makes of the distance to a held command, and of its rate.

    One pole of a spool, or the two poles of a regulator with a damping ratio.
    """
    if damping is None:
        return (math.exp(-period / time_constant), 0.0), (0.0, 0.0)
    from scipy.linalg import expm  # noqa: PLC0415  (slow to import; regulators alone need it)

    w = 1.0 / time_constant
    rows = expm(period * np.array([[0.0, 1.0], [-w * w, -2.0 * damping * w]])).tolist()
    return (rows[0][0], rows[0][1]), (rows[1][0], rows[1][1])


class ExpectedPressure:
    """The numbers of one muscle.

    Parameters
    ----------
    robot : Robot
        Gives gas, supply and position limits.
    period : float
        Of a step [s].
    """

    def __init__(self, robot: Robot, muscle: RobotMuscle, period: float) -> None:
        strokes = strokes_over_travel(robot, muscle, _VOLUME_POINTS)
        model, valve, gas = muscle.force_model, muscle.valve, robot.gas
        lengths = [muscle.neutral_length + stroke for stroke in strokes]
        volumes = [float(model.volume(length)) for length in lengths]
        # A cubic polynomial is exact for a cylindrical braid and accurate enough for other models.
        # It is fitted in the stroke: powers of the length alone are nearly dependent.
        fit = np.polyfit(strokes, volumes, 3 if muscle.arms else 0)
        self._volume = tuple(float(c) for c in np.concatenate([np.zeros(4 - len(fit)), fit]))
        self._dead_volume = muscle.dead_volume
        self._arms = tuple(
            (arm.joint, -arm.length, *robot.joints[arm.joint].position_limits)
            for arm in muscle.arms
        )
        self._openings = [(slot.law, values) for _, slot, values in muscle.laws(Opening)]
        self._leaks = [(slot.law, values) for _, slot, values in muscle.laws(Leak)]
        self._valve, self._is_flow = valve, valve.kind == "flow"
        self._supply, self._ambient = robot.supply.pressure, gas.ambient_pressure
        self._exponent, self._temperature = gas.polytropic_exponent, gas.temperature
        self._density = reference_density(gas.temperature)
        self._lag = _spool_lag(
            period, valve.time_constant, None if self._is_flow else valve.damping
        )
        self._period = period
        self._delay = round(valve.command_delay / period)
        self._tube = None if valve.tube is None else TubeGas(valve.tube, valve, gas, period)

    @property
    def behind_tube(self) -> bool:
        """Whether the sensor does not show the pressure in the muscle."""
        return self._tube is not None

    def init(self) -> GasState:
        """The state of a muscle that has vented, whose pressure is unknown."""
        vented = -1.0 if self._is_flow else 0.0
        return GasState((vented,) * self._delay, vented, math.nan, math.nan)

    def delayed(self, state: GasState, command: float) -> tuple[GasState, float]:
        """The command that acts now if `command` is given now."""
        if not state.commands:
            return state, command
        queue = (*state.commands, command)
        return state._replace(commands=queue[1:]), queue[0]

    def spool_after(self, state: GasState, command: float) -> tuple[float, float]:
        """`spool` and `spool_rate` after a period with the command that acts now."""
        of_position, of_rate = self._lag
        behind = state.spool - command, state.spool_rate
        return (
            command + of_position[0] * behind[0] + of_position[1] * behind[1],
            of_rate[0] * behind[0] + of_rate[1] * behind[1],
        )

    def step(
        self,
        state: GasState,
        command: float,
        positions: Sequence[float],
        velocities: Sequence[float],
        supply: float,
    ) -> GasState:
        """The state after one period.

        Parameters
        ----------
        state : GasState
            With known pressures.
        command : float
            The command that acts now, see `delayed`, as fraction of full scale.
        positions, velocities : sequence of float
            By joint of the robot [rad], [rad/s].
        supply : float
            Pressure before the valve [Pa absolute]; NaN if unknown: then that of the robot.
        """
        stroke = rate = 0.0
        for joint, slope, low, high in self._arms:
            position = positions[joint]
            if low < position < high:
                stroke += slope * position
                rate += slope * velocities[joint]
            else:
                stroke += slope * min(max(position, low), high)
        a, b, c, d = self._volume
        volume = ((a * stroke + b) * stroke + c) * stroke + d + self._dead_volume
        volume_rate = ((3.0 * a * stroke + 2.0 * b) * stroke + c) * rate
        spool, spool_rate = self.spool_after(state, command)
        supply = self._supply if math.isnan(supply) else supply
        at_sensor = state.at_sensor
        if self._tube is not None:
            at_sensor, inside = self._tube.advance(
                at_sensor,
                state.inside,
                lambda at: self.entering(spool, at, supply),
                self._leaving,
                volume,
                volume_rate,
            )
        else:
            at_sensor += self._period * float(
                pressure_rate(
                    self.entering(spool, at_sensor, supply) - self._leaving(at_sensor),
                    at_sensor,
                    volume,
                    volume_rate,
                    temperature=self._temperature,
                    exponent=self._exponent,
                )
            )
            inside = at_sensor
        return GasState(state.commands, spool, at_sensor, inside, spool_rate)

    def entering(self, spool: float, pressure: float, supply: float) -> float:
        """Flow of the valve [kg/s] at a pressure behind it [Pa absolute]."""
        valve = self._valve
        if self._is_flow:
            opening = min(max(spool, -1.0), 1.0)
            for law, values in self._openings:
                opening = law(opening, *values)
        else:
            target = spool * (valve.full_scale or 0.0) + self._ambient
            opening = min(max((target - pressure) / _REGULATED, -1.0), 1.0)
        if opening < 0.0:
            opening *= valve.exhaust_ratio
        return float(
            valve_flow(
                opening,
                pressure,
                supply_pressure=supply,
                ambient_pressure=self._ambient,
                conductance=valve.sonic_conductance,
                critical_ratio=valve.critical_ratio,
                temperature=self._temperature,
            )
        )

    def _leaving(self, pressure: float) -> float:
        """Flow of the leaks [kg/s] at a pressure [Pa absolute]."""
        critical = self._valve.critical_ratio
        if not self._leaks:
            return 0.0
        return self._density * sum(
            law(pressure, self._ambient, critical, *values) for law, values in self._leaks
        )
