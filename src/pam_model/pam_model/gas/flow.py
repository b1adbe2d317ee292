"""Flow of air through restrictions, by ISO 6358 and through an isentropic nozzle.

Pressures here are absolute. `flow_share` and `reference_flow` are functions of floats, which the
plant compiles. `flow_function` and `mass_flow` apply them to arrays, element by element.

Source: ISO 6358-1 (flow rate by sonic conductance and critical ratio, with the linear part near
equal pressures that keeps the slope finite); isentropic nozzle and polytropic chamber from the
ideal gas law.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pam_model.errors import DomainError
from pam_model.gas.constants import (
    GAS_CONSTANT,
    HEAT_CAPACITY_RATIO,
    LINEAR_RATIO,
    REFERENCE_DENSITY,
    REFERENCE_TEMPERATURE,
)

_SMALLEST_FLOW = 1e-30


def flow_share(ratio: float, critical_ratio: float) -> float:
    """Flow function psi: the flow at a pressure ratio over the choked flow.

    Parameters
    ----------
    ratio : float
        Downstream over upstream absolute pressure, 0 to 1 [-].
    critical_ratio : float
        ISO 6358 b, 0 to below 1 [-].
    """
    # One root and one division for all three parts: vector lanes compute every branch.
    bend = max(LINEAR_RATIO, critical_ratio)
    span = 1.0 - critical_ratio
    part = max(min(ratio, bend) - critical_ratio, 0.0)
    linear = min(1.0 - ratio, 1.0 - bend)
    return math.sqrt(span * span - part * part) * linear / (span * (1.0 - bend))


_flow_shares = np.vectorize(flow_share, otypes=[float])


def flow_function(ratio: Any, critical_ratio: Any) -> Any:
    """`flow_share` element by element, for floats or arrays."""
    if isinstance(ratio, float) and isinstance(critical_ratio, float):
        return flow_share(ratio, critical_ratio)
    return _flow_shares(ratio, critical_ratio)


def reference_flow(conductance: float, critical_ratio: float, first: float, second: float) -> float:
    """Mass flow from `first` to `second` over the reference density; negative if it is reversed.

    Parameters
    ----------
    conductance : float
        C [m^3/(s Pa)].
    critical_ratio : float
        b [-].
    first, second : float
        Absolute, at least one above 0 [Pa].

    Returns
    -------
    float
        C P_up psi(P_dn/P_up) [m^3/s ANR], for gas at the reference temperature.
    """
    # `flow_share` of the two pressures, with one root and one division
    upstream, downstream = max(first, second), min(first, second)
    bend = max(LINEAR_RATIO, critical_ratio)
    full = (1.0 - critical_ratio) * upstream
    part = max(min(downstream, bend * upstream) - critical_ratio * upstream, 0.0)
    linear = min(upstream - downstream, (1.0 - bend) * upstream)
    flow = conductance * math.sqrt(full * full - part * part) * linear
    flow /= (1.0 - bend) * full
    return flow if first >= second else -flow


def reference_density(temperature: float) -> float:
    """Mass flow over ANR volume flow for gas at a temperature [K]: rho0 sqrt(T0/T) [kg/m^3]."""
    return REFERENCE_DENSITY * math.sqrt(REFERENCE_TEMPERATURE / temperature)


def choking_slope(critical_ratio: float) -> float:
    """-d psi/dr of the linear part near equal pressures [-]."""
    return flow_share(LINEAR_RATIO, critical_ratio) / (1.0 - LINEAR_RATIO)


def mass_flow(
    conductance: Any,
    critical_ratio: Any,
    upstream: Any,
    downstream: Any,
    temperature: Any = REFERENCE_TEMPERATURE,
) -> Any:
    """ISO 6358 mass flow [kg/s]; negative if `downstream` is the higher pressure.

    mdot = C rho0 P_up sqrt(T0/T) psi(P_dn/P_up)

    Parameters
    ----------
    conductance : float or array
        C [m^3/(s Pa)].
    critical_ratio : float or array
        b [-].
    upstream, downstream : float or array
        [Pa absolute].
    temperature : float or array, optional
        Of the gas at the higher pressure [K].
    """
    values = (conductance, critical_ratio, upstream, downstream, temperature)
    if all(isinstance(value, float | int) for value in values):
        return _mass_flow(*values)
    return _mass_flows(*values)


def _mass_flow(
    conductance: float,
    critical_ratio: float,
    upstream: float,
    downstream: float,
    temperature: float,
) -> float:
    if upstream <= 0.0 and downstream <= 0.0:
        return 0.0
    density = reference_density(temperature)
    return density * reference_flow(conductance, critical_ratio, upstream, downstream)


_mass_flows = np.vectorize(_mass_flow, otypes=[float])


def valve_flow(
    opening: float,
    pressure: float,
    *,
    supply_pressure: float,
    ambient_pressure: float,
    conductance: float,
    critical_ratio: float,
    temperature: float = REFERENCE_TEMPERATURE,
) -> float:
    """Mass flow into a muscle [kg/s] through a three-way proportional valve.

    Parameters
    ----------
    opening : float
        Spool opening, -1 (muscle to ambient, fully open) to 1 (supply to muscle) [-].
    pressure : float
        In the muscle [Pa absolute].
    supply_pressure, ambient_pressure : float
        [Pa absolute].
    conductance : float
        C fully open [m^3/(s Pa)].
    critical_ratio : float
        b [-].
    temperature : float, optional
        [K].
    """
    if opening >= 0.0:
        return _mass_flow(
            opening * conductance, critical_ratio, supply_pressure, pressure, temperature
        )
    return -_mass_flow(
        -opening * conductance, critical_ratio, pressure, ambient_pressure, temperature
    )


def valve_opening(
    flow: float,
    pressure: float,
    *,
    supply_pressure: float,
    ambient_pressure: float,
    conductance: float,
    critical_ratio: float,
    temperature: float = REFERENCE_TEMPERATURE,
) -> float:
    """The spool opening [-] for a mass flow into a muscle; the inverse of `valve_flow`.

    For a flow beyond the valve's range the opening saturates at -1 or 1. For a flow against the
    pressure difference it is also -1 or 1, with the sign of the flow.

    Parameters
    ----------
    flow : float
        Into the muscle [kg/s].
    pressure, supply_pressure, ambient_pressure, conductance, critical_ratio, temperature : float
        As for `valve_flow`.
    """
    full = valve_flow(
        1.0 if flow > 0.0 else -1.0,
        pressure,
        supply_pressure=supply_pressure,
        ambient_pressure=ambient_pressure,
        conductance=conductance,
        critical_ratio=critical_ratio,
        temperature=temperature,
    )
    return opening_for_flow(flow, full)


def opening_for_flow(flow: float, full: float) -> float:
    """The spool opening [-] for a flow, if the open valve gives `full` in its direction [kg/s].

    It saturates at -1 or 1 as that of `valve_opening` does.
    """
    if flow == 0.0:
        return 0.0
    sign = 1.0 if flow > 0.0 else -1.0
    if full * sign <= _SMALLEST_FLOW:
        return sign
    return sign * min(1.0, flow / full)


def orifice_flow(
    discharge_coefficient: Any,
    area: Any,
    upstream: Any,
    downstream: Any,
    temperature: Any = REFERENCE_TEMPERATURE,
    *,
    heat_capacity_ratio: float = HEAT_CAPACITY_RATIO,
) -> Any:
    """Isentropic mass flow of an ideal gas through an orifice [kg/s].

    Parameters
    ----------
    discharge_coefficient : float or array
        C_d [-].
    area : float or array
        [m^2].
    upstream, downstream : float or array
        [Pa absolute].
    temperature : float or array, optional
        Upstream [K].
    heat_capacity_ratio : float, optional
        [-].

    Raises
    ------
    DomainError
        If `downstream` is the higher pressure.
    """
    if np.any(np.asarray(downstream) > np.asarray(upstream)):
        raise DomainError("downstream pressure must not be above upstream pressure")
    g = heat_capacity_ratio
    ratio = np.maximum(
        np.asarray(downstream, float) / np.asarray(upstream, float), critical_pressure_ratio(g)
    )
    inner = 2.0 * g / (g - 1.0) * (ratio ** (2.0 / g) - ratio ** ((g + 1.0) / g))
    flow = discharge_coefficient * area * upstream * np.sqrt(inner / (GAS_CONSTANT * temperature))
    return float(flow) if np.ndim(flow) == 0 else flow


def critical_pressure_ratio(heat_capacity_ratio: float = HEAT_CAPACITY_RATIO) -> float:
    """Ratio below which an ideal nozzle is choked: (2/(g+1))^(g/(g-1)) [-]."""
    g = heat_capacity_ratio
    return float((2.0 / (g + 1.0)) ** (g / (g - 1.0)))
