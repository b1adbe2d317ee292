"""Time in which a rigid chamber fills and empties through an ISO 6358 restriction.

Isothermal, infinite supply. The filling time in closed form is derived here from the flow function
psi(r): t = V/(R T C rho0 sqrt(T0/T)) [g(r_f) - g(r_0)], where g(r) = r for sonic flow and
g(r) = b + (1-b) asin((r-b)/(1-b)) for subsonic flow.
"""

from __future__ import annotations

import math

from scipy.integrate import quad

from pam_model.domain import require
from pam_model.gas import GAS_CONSTANT, REFERENCE_TEMPERATURE, reference_density


def rate_per_volume(conductance: float, temperature: float) -> float:
    """R T C rho0 sqrt(T0/T) [m^3/s]: sonic flow as the volume it would fill per second.

    Parameters
    ----------
    conductance : float
        ISO 6358 C [m^3/(s Pa)].
    temperature : float
        Temperature of the gas [K].
    """
    require("conductance [m^3/(s Pa)]", conductance, 0.0, open_low=True)
    require("temperature [K]", temperature, 0.0, open_low=True)
    density = reference_density(temperature)
    return GAS_CONSTANT * temperature * conductance * density


def fill_time(
    volume: float,
    conductance: float,
    critical_ratio: float,
    *,
    supply_pressure: float,
    start_pressure: float,
    end_pressure: float,
    temperature: float = REFERENCE_TEMPERATURE,
) -> float:
    """Time [s] to fill a volume [m^3] between two absolute pressures [Pa].

    Raises
    ------
    DomainError
        Unless 0 <= start <= end <= supply, volume and conductance are above 0 and the critical
        ratio lies in [0, 1).
    """
    require("volume [m^3]", volume, 0.0, open_low=True)
    require("critical_ratio [-]", critical_ratio, 0.0, 1.0, open_high=True)
    require("supply_pressure [Pa abs]", supply_pressure, 0.0, open_low=True)
    require("end_pressure [Pa abs]", end_pressure, 0.0, supply_pressure, why="supply_pressure")
    require("start_pressure [Pa abs]", start_pressure, 0.0, end_pressure, why="end_pressure")
    rest = 1.0 - critical_ratio

    def elapsed(ratio: float) -> float:
        if ratio <= critical_ratio:
            return ratio
        return critical_ratio + rest * math.asin(min(1.0, (ratio - critical_ratio) / rest))

    span = elapsed(end_pressure / supply_pressure) - elapsed(start_pressure / supply_pressure)
    return volume * span / rate_per_volume(conductance, temperature)


def exhaust_time(
    volume: float,
    conductance: float,
    critical_ratio: float,
    *,
    ambient_pressure: float,
    start_pressure: float,
    end_pressure: float,
    temperature: float = REFERENCE_TEMPERATURE,
) -> float:
    """Time [s] to empty a volume [m^3] to the ambient, between two absolute pressures [Pa].

    Raises
    ------
    DomainError
        Unless ambient < end <= start, volume and conductance are above 0 and the critical ratio
        lies in [0, 1).
    """
    require("volume [m^3]", volume, 0.0, open_low=True)
    require("critical_ratio [-]", critical_ratio, 0.0, 1.0, open_high=True)
    require("ambient_pressure [Pa abs]", ambient_pressure, 0.0, open_low=True)
    require("end_pressure [Pa abs]", end_pressure, ambient_pressure, open_low=True)
    require("start_pressure [Pa abs]", start_pressure, end_pressure, why="end_pressure")
    sonic_end = ambient_pressure / critical_ratio if critical_ratio > 0.0 else math.inf
    rest = 1.0 - critical_ratio
    total = 0.0
    if start_pressure > sonic_end:
        total = math.log(start_pressure / max(end_pressure, sonic_end))
    if end_pressure < sonic_end:
        # Integrate dr/(r psi(r)) with (r - b)/(1 - b) = sin(a), so that the root in psi cancels.
        def angle(pressure: float) -> float:
            return math.asin(min(1.0, (ambient_pressure / pressure - critical_ratio) / rest))

        first, last = angle(min(start_pressure, sonic_end)), angle(end_pressure)
        slow, _ = quad(lambda a: rest / (critical_ratio + rest * math.sin(a)), first, last)
        total += float(slow)
    return volume * total / rate_per_volume(conductance, temperature)
