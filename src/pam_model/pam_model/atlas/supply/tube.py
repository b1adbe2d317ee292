"""The tube between valve and muscle: delay, laminar flow, attenuation, and its ISO 6358 numbers.

The laminar flow is derived here. The delay L/c is exact for small disturbances. Attenuation and
the ISO 6358 numbers of a tube are general knowledge, not verified against a source.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from pam_model.domain import require
from pam_model.gas import GAS_CONSTANT, HEAT_CAPACITY_RATIO, REFERENCE_TEMPERATURE

VISCOSITY = 1.81e-5
"""mu of air at room temperature [Pa s]."""
"""Reynolds number up to which the laminar law holds [-]."""


class StraightTube:
    """A straight round tube.

    Parameters
    ----------
    length : float
        L_t [m].
    diameter : float
        D, inner diameter [m].
    temperature : float
        Temperature of the gas [K].

    Raises
    ------
    DomainError
        For a parameter not above 0; by the methods for pressures (absolute) not above 0.
    """

    def __init__(
        self, length: float, diameter: float, temperature: float = REFERENCE_TEMPERATURE
    ) -> None:
        require("length [m]", length, 0.0, open_low=True)
        require("diameter [m]", diameter, 0.0, open_low=True)
        require("temperature [K]", temperature, 0.0, open_low=True)
        self.length = length
        self.diameter = diameter
        self.temperature = temperature

    @property
    def volume(self) -> float:
        """Gas volume of the tube [m^3], which is part of the muscle's dead volume."""
        return 0.25 * math.pi * self.diameter**2 * self.length

    @property
    def speed_of_sound(self) -> float:
        """Speed of sound sqrt(gamma R T) [m/s]."""
        return math.sqrt(HEAT_CAPACITY_RATIO * GAS_CONSTANT * self.temperature)

    @property
    def delay(self) -> float:
        """Transport delay L_t/c [s]."""
        return self.length / self.speed_of_sound

    def laminar_flow(self, upstream: float, downstream: float) -> float:
        """Mass flow [kg/s] between absolute pressures [Pa]; valid for `reynolds` < 2300."""
        require("upstream [Pa abs]", upstream, 0.0, open_low=True)
        require("downstream [Pa abs]", downstream, 0.0, open_low=True)
        resistance = 256.0 * VISCOSITY * GAS_CONSTANT * self.temperature * self.length
        return math.pi * self.diameter**4 * (upstream**2 - downstream**2) / resistance

    def reynolds(self, mass_flow: float) -> float:
        """Reynolds number 4 mdot/(pi D mu) [-]."""
        return 4.0 * abs(mass_flow) / (math.pi * self.diameter * VISCOSITY)

    def attenuation(self, pressure: float) -> float:
        """Amplitude ratio of a small pressure wave, end over start [-], at Pa absolute."""
        require("pressure [Pa abs]", pressure, 0.0, open_low=True)
        friction = 32.0 * VISCOSITY / self.diameter**2
        loss = friction * GAS_CONSTANT * self.temperature * self.length
        return math.exp(-loss / (2.0 * pressure * self.speed_of_sound))

    @property
    def conductance(self) -> float:
        """C_t = 0.029 D^2/sqrt(L/D^1.25 + 510) [m^3/(s Pa)], ISO 6358 C of the tube."""
        return 0.029 * self.diameter**2 / math.sqrt(self.length / self.diameter**1.25 + 510.0)

    @property
    def critical_ratio(self) -> float:
        """b_t = 474 C_t/D^2 [-], ISO 6358 b of the tube."""
        return 474.0 * self.conductance / self.diameter**2


def series_conductance(conductances: Sequence[float]) -> float:
    """ISO 6358 C [m^3/(s Pa)] of restrictions in series: 1/C^3 = sum 1/C_i^3 (not verified).

    Raises
    ------
    DomainError
        For no conductance, or one not above 0.
    """
    require("number of conductances", len(conductances), 1.0)
    require("conductances [m^3/(s Pa)]", conductances, 0.0, open_low=True)
    return float(sum(c**-3.0 for c in conductances) ** (-1.0 / 3.0))
