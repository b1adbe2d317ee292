"""Flow of air through restrictions, and the pressure of a chamber of changing volume.

Pressures here are absolute. Arguments are floats or arrays that broadcast against each other;
floats take a fast path without numpy.

Source: ISO 6358-1 (flow rate by sonic conductance and critical ratio, with the linear part near
equal pressures that keeps the slope finite); isentropic nozzle and polytropic chamber from the
ideal gas law.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pam_model.errors import DomainError

GAS_CONSTANT = 287.05
"""Of air, R [J/(kg K)]."""
HEAT_CAPACITY_RATIO = 1.4
"""Of air [-]."""
REFERENCE_DENSITY = 1.185
"""ANR, 293.15 K and 100 kPa [kg/m^3]."""
REFERENCE_TEMPERATURE = 293.15
"""ANR [K]."""
LINEAR_RATIO = 0.999
"""Above this pressure ratio the flow is a straight line to zero [-]."""
_SMALLEST_FLOW = 1e-30


def _are_floats(*values: Any) -> bool:
    return all(isinstance(value, float | int) for value in values)


def flow_function(ratio: Any, critical_ratio: Any) -> Any:
    """The part psi of the choked flow that passes at a pressure ratio.

    Parameters
    ----------
    ratio : float or array
        Downstream over upstream absolute pressure, 0 to 1 [-].
    critical_ratio : float or array
        ISO 6358 b, 0 to below 1 [-].
    """
    if _are_floats(ratio, critical_ratio):
        if ratio <= critical_ratio:
            return 1.0
        linear = LINEAR_RATIO if critical_ratio < LINEAR_RATIO else critical_ratio
        at = ratio if ratio < linear else linear
        part = (at - critical_ratio) / (1.0 - critical_ratio)
        psi = math.sqrt(1.0 - part * part)
        return psi if ratio <= linear else psi * (1.0 - ratio) / (1.0 - linear)
    ratios, critical = np.asarray(ratio, float), np.asarray(critical_ratio, float)
    bend = np.maximum(LINEAR_RATIO, critical)
    parts = (np.clip(ratios, critical, bend) - critical) / (1.0 - critical)
    shape = np.sqrt(1.0 - parts * parts)
    return np.where(ratios <= bend, shape, shape * (1.0 - ratios) / (1.0 - bend))


def mass_flow(
    conductance: Any,
    critical_ratio: Any,
    upstream: Any,
    downstream: Any,
    temperature: Any = REFERENCE_TEMPERATURE,
) -> Any:
    """ISO 6358 mass flow [kg/s], negative where `downstream` is the higher pressure.

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
    if _are_floats(conductance, critical_ratio, upstream, downstream, temperature):
        density = REFERENCE_DENSITY * math.sqrt(REFERENCE_TEMPERATURE / temperature)
        if upstream >= downstream:
            if upstream <= 0.0:
                return 0.0
            psi = flow_function(downstream / upstream, critical_ratio)
            return conductance * density * upstream * psi
        psi = flow_function(upstream / downstream, critical_ratio)
        return -conductance * density * downstream * psi
    upstream, downstream = np.asarray(upstream, float), np.asarray(downstream, float)
    high, low = np.maximum(upstream, downstream), np.minimum(upstream, downstream)
    ratio = np.divide(low, high, out=np.ones(np.broadcast(low, high).shape), where=high > 0.0)
    densities = REFERENCE_DENSITY * np.sqrt(REFERENCE_TEMPERATURE / np.asarray(temperature, float))
    sign = np.where(upstream >= downstream, 1.0, -1.0)
    return sign * conductance * densities * high * flow_function(ratio, critical_ratio)


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
        Spool, -1 (muscle to ambient, fully open) to 1 (supply to muscle) [-].
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
        return float(
            mass_flow(opening * conductance, critical_ratio, supply_pressure, pressure, temperature)
        )
    return -float(
        mass_flow(-opening * conductance, critical_ratio, pressure, ambient_pressure, temperature)
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
    """The spool opening [-] that lets this mass flow into a muscle; the inverse of `valve_flow`.

    What the valve cannot pass saturates at -1 or 1; a flow against the pressure difference gets
    the full opening of its sign, since the best it can do is to open that side.

    Parameters
    ----------
    flow : float
        Into the muscle [kg/s].
    pressure, supply_pressure, ambient_pressure, conductance, critical_ratio, temperature : float
        As for `valve_flow`.
    """
    if flow == 0.0:
        return 0.0
    sign = 1.0 if flow > 0.0 else -1.0
    full = valve_flow(
        sign,
        pressure,
        supply_pressure=supply_pressure,
        ambient_pressure=ambient_pressure,
        conductance=conductance,
        critical_ratio=critical_ratio,
        temperature=temperature,
    )
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
    """Isentropic flow of an ideal gas through an orifice [kg/s], `upstream` the higher pressure.

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
        Where `downstream` is the higher pressure.
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
    """Below this ratio an ideal nozzle is choked: (2/(g+1))^(g/(g-1)) [-]."""
    g = heat_capacity_ratio
    return float((2.0 / (g + 1.0)) ** (g / (g - 1.0)))


def pressure_rate(
    flow: Any,
    pressure: Any,
    volume: Any,
    volume_rate: Any = 0.0,
    *,
    temperature: Any = REFERENCE_TEMPERATURE,
    exponent: Any = 1.0,
) -> Any:
    """dP/dt = k (R T mdot - P dV/dt)/V [Pa/s] of a polytropic chamber.

    Parameters
    ----------
    flow : float or array
        Into the chamber [kg/s].
    pressure : float or array
        [Pa absolute].
    volume : float or array
        Dead volume included [m^3].
    volume_rate : float or array, optional
        dV/dt = V'(L) dL/dt [m^3/s].
    temperature : float or array, optional
        [K].
    exponent : float or array, optional
        k, 1.0 isothermal to 1.4 adiabatic [-].
    """
    return exponent * (GAS_CONSTANT * temperature * flow - pressure * volume_rate) / volume


def flow_for_pressure_rate(
    rate: Any,
    pressure: Any,
    volume: Any,
    volume_rate: Any = 0.0,
    *,
    temperature: Any = REFERENCE_TEMPERATURE,
    exponent: Any = 1.0,
) -> Any:
    """Mass flow [kg/s] that gives dP/dt = `rate` [Pa/s]; the inverse of `pressure_rate`."""
    return (rate * volume / exponent + pressure * volume_rate) / (GAS_CONSTANT * temperature)
