"""The gas in a muscle and in the tube before it: two chambers, advanced by one period.

Valve -> tube, where the sensor is, -> ISO 6358 restriction -> muscle. Both chambers are polytropic
(`pam_model.effects.tube_restriction`). The steps are explicit; no step moves more gas through the
tube than makes both pressures equal, because near this equilibrium ISO 6358 is too stiff for them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from pam_model.gas import GAS_CONSTANT, pressure_rate, reference_density, reference_flow
from pam_model.rig.types import Gas
from pam_model.robot.robot import RobotValve, Tube

LONGEST_STEP: Final = 5e-4  # s
LARGEST_CHANGE: Final = 0.1  # of the supply, by an open valve in one step; bounds the volume below
LOWEST: Final = 1e3  # Pa absolute

Flow = Callable[[float], float]
"""Mass flow [kg/s] at a pressure [Pa absolute]."""


class TubeGas:
    """A muscle behind a tube.

    Parameters
    ----------
    tube : Tube
        The tube; a volume that is too small for the steps counts as the smallest possible.
    valve : RobotValve
        Before the tube.
    gas : Gas
        Temperature and exponent.
    period : float
        Time between updates [s].
    """

    def __init__(self, tube: Tube, valve: RobotValve, gas: Gas, period: float) -> None:
        self._conductance, self._critical = tube.conductance, valve.critical_ratio
        self._temperature, self._exponent = gas.temperature, gas.polytropic_exponent
        self._density = reference_density(gas.temperature)
        self._count = max(1, math.ceil(period / LONGEST_STEP - 1e-9))
        self._step = period / self._count
        per_mass = self._exponent * GAS_CONSTANT * self._temperature
        widest = max(valve.sonic_conductance, tube.conductance)
        least = self._step * per_mass * self._density * widest / LARGEST_CHANGE
        self._per_mass = per_mass
        self._volume = max(tube.volume, least)

    def advance(
        self,
        at_valve: float,
        inside: float,
        entering: Flow,
        leaving: Flow,
        volume: float,
        volume_rate: float,
    ) -> tuple[float, float]:
        """The pressures at the valve and in the muscle after one period [Pa absolute].

        Parameters
        ----------
        at_valve, inside : float
            Pressures at the valve and in the muscle at the beginning [Pa absolute].
        entering : callable
            Flow of the valve at this pressure.
        leaving : callable
            Leak of the muscle at its pressure.
        volume, volume_rate : float
            Of the muscle [m^3], [m^3/s].
        """
        step, tube = self._step, self._volume
        for _ in range(self._count):
            at_valve += step * self._per_mass * entering(at_valve) / tube
            at_valve = max(at_valve, LOWEST)
            through = self._density * reference_flow(
                self._conductance, self._critical, at_valve, inside
            )
            equal = (at_valve - inside) / (step * self._per_mass * (1.0 / tube + 1.0 / volume))
            through = math.copysign(min(abs(through), abs(equal)), equal)
            at_valve = max(at_valve - step * self._per_mass * through / tube, LOWEST)
            inside += step * float(
                pressure_rate(
                    through - leaving(inside),
                    inside,
                    volume,
                    volume_rate,
                    temperature=self._temperature,
                    exponent=self._exponent,
                )
            )
            inside = max(inside, LOWEST)
        return at_valve, inside
