"""The gas of one muscle: valve, tube, leak and chamber, as rates of change.

Sources: ISO 6358-1 with a straight line above a pressure ratio of 0.999; polytropic chamber; first
law of an open chamber of ideal gas where the thermal effect is on. Pressures here are absolute.
"""

from __future__ import annotations

import math
from typing import Any

from pam_model.plant.compiled import compiled
from pam_model.plant.layout import (
    C_AMBIENT,
    C_DENSITY,
    C_EXPONENT,
    C_RT,
    C_TEMPERATURE,
    M_CONDUCTANCE,
    M_CRITICAL,
    M_EXHAUST,
    M_LAG,
    M_LEAK,
    M_NULL,
    M_OVERLAP,
    M_REGULATOR,
    M_THERMAL,
    M_TUBE,
    M_TUBE_CONDUCTANCE,
    M_TUBE_VOLUME,
)

LINEAR_FROM = 0.999
GAS_CONSTANT = 287.05
HEAT_RATIO = 1.4
HEAT_CAPACITY = GAS_CONSTANT / (HEAT_RATIO - 1.0)


@compiled
def flow(conductance: float, critical: float, first: float, second: float) -> float:
    """Mass flow over rho0 from `first` to `second` [Pa], negative when it runs back."""
    if first >= second:
        up, down, sign = first, second, 1.0
    else:
        up, down, sign = second, first, -1.0
    ratio = down / up
    if ratio <= critical:
        psi = 1.0
    elif ratio <= LINEAR_FROM:
        s = (ratio - critical) / (1.0 - critical)
        psi = math.sqrt(1.0 - s * s)
    else:
        s = (LINEAR_FROM - critical) / (1.0 - critical)
        psi = math.sqrt(1.0 - s * s) * (1.0 - ratio) / (1.0 - LINEAR_FROM)
    return sign * conductance * up * psi


@compiled
def opening(spool: float, null_offset: float, overlap: float) -> float:
    """Signed opening of a valve, -1 (exhaust) to 1 (supply), of a spool with offset and overlap."""
    x = spool + null_offset
    if x > 1.0:
        x = 1.0
    elif x < -1.0:
        x = -1.0
    if overlap > 0.0:
        if x > overlap:
            x = (x - overlap) / (1.0 - overlap)
        elif x < -overlap:
            x = (x + overlap) / (1.0 - overlap)
        else:
            x = 0.0
    return x


@compiled
def regulator_rate(
    m: int, c: Any, spool: float, outlet: float, supply: float, per_flow: float
) -> float:
    """Rate of a regulator's outlet [Pa/s]: after its lag, as fast as the open valve lets it."""
    critical = c[m + M_CRITICAL]
    wanted = (spool + c[C_AMBIENT] - outlet) / c[m + M_LAG]
    if wanted >= 0.0:
        most = per_flow * flow(c[m + M_CONDUCTANCE], critical, supply, outlet)
        return float(min(wanted, max(most, 0.0)))
    conductance = c[m + M_CONDUCTANCE] * c[m + M_EXHAUST]
    most = per_flow * flow(conductance, critical, outlet, c[C_AMBIENT])
    return float(-min(-wanted, max(most, 0.0)))


@compiled
def first_law_rates(
    m: int,
    c: Any,
    pressure: float,
    temperature: float,
    volume: float,
    volume_per_pressure: float,
    entering: float,
    leaving: float,
) -> tuple[float, float]:
    """dP/dt [Pa/s] and dT/dt [K/s] at constant length; flows over rho0 at gas.temperature.

    Gas arrives at wall temperature; what leaves a warmer chamber flows as sqrt(T_wall/T).
    """
    wall = c[C_TEMPERATURE]
    flow_in = c[C_DENSITY] * entering
    flow_out = c[C_DENSITY] * leaving * math.sqrt(wall / temperature)
    heat = c[m + M_THERMAL] * (wall - temperature)
    gained = HEAT_RATIO * GAS_CONSTANT * (flow_in * wall - flow_out * temperature)
    pressure_rate = (gained + (HEAT_RATIO - 1.0) * heat) / volume
    pressure_rate /= 1.0 + HEAT_RATIO * pressure * volume_per_pressure / volume
    mass = pressure * volume / (GAS_CONSTANT * temperature)
    # From P V = m R T, so that temperature, pressure and mass cannot drift apart.
    temperature_rate = temperature * (
        pressure_rate * (1.0 / pressure + volume_per_pressure / volume)
        - (flow_in - flow_out) / mass
    )
    return pressure_rate, temperature_rate


@compiled
def gas_rates(
    m: int,
    c: Any,
    command: float,
    spool: float,
    pressure: float,
    valve_pressure: float,
    temperature: float,
    supply: float,
    volume: float,
    volume_per_pressure: float,
    shut: bool,
) -> tuple[float, float, float, float, float]:
    """Rates of spool, muscle pressure at constant length, valve-side pressure; supply drawn; heat.

    Returns
    -------
    spool_rate : float
        [1/s], or [Pa/s] of a regulator's first lag.
    pressure_rate : float
        dP/dt [Pa/s] at constant length.
    valve_pressure_rate : float
        [Pa/s]; that of the tube where there is one, 0 without.
    drawn : float
        Mass flow from the supply over rho0.
    temperature_rate : float
        [K/s] at constant length; 0 without the thermal effect.
    """
    ambient = c[C_AMBIENT]
    critical = c[m + M_CRITICAL]
    has_tube = c[m + M_TUBE] > 0.0
    upstream = valve_pressure if has_tube else pressure
    spool_rate = (command - spool) / c[m + M_LAG]
    is_regulator = c[m + M_REGULATOR] > 0.0
    exponent = c[C_EXPONENT]
    per_mass = exponent * c[C_RT] * c[C_DENSITY]
    drawn = 0.0
    vented = 0.0
    regulated_rate = 0.0
    if is_regulator and not shut:
        per_flow = per_mass / (c[m + M_TUBE_VOLUME] if has_tube else volume)
        regulated_rate = regulator_rate(m, c, spool, upstream, supply, per_flow)
        drawn = max(regulated_rate, 0.0) / per_flow
        if not has_tube:
            return spool_rate, regulated_rate, 0.0, drawn, 0.0
    elif not shut:
        x = opening(spool, c[m + M_NULL], c[m + M_OVERLAP])
        if x > 0.0:
            drawn = flow(c[m + M_CONDUCTANCE] * x, critical, supply, upstream)
        elif x < 0.0:
            conductance = c[m + M_CONDUCTANCE] * c[m + M_EXHAUST]
            vented = flow(-conductance * x, critical, upstream, ambient)
    valve_pressure_rate = 0.0
    entering = drawn
    leaving = vented
    if has_tube:
        through = flow(c[m + M_TUBE_CONDUCTANCE], critical, valve_pressure, pressure)
        valve_pressure_rate = regulated_rate
        if not is_regulator or shut:
            valve_pressure_rate = per_mass * (drawn - vented - through) / c[m + M_TUBE_VOLUME]
        entering = max(through, 0.0)
        leaving = max(-through, 0.0)
    if c[m + M_LEAK] > 0.0:
        leaving += flow(c[m + M_LEAK], critical, pressure, ambient)
    if c[m + M_THERMAL] > 0.0:
        pressure_rate, temperature_rate = first_law_rates(
            m, c, pressure, temperature, volume, volume_per_pressure, entering, leaving
        )
        return spool_rate, pressure_rate, valve_pressure_rate, drawn, temperature_rate
    pressure_rate = per_mass * (entering - leaving) / volume
    if volume_per_pressure != 0.0:
        pressure_rate /= 1.0 + exponent * pressure * volume_per_pressure / volume
    return spool_rate, pressure_rate, valve_pressure_rate, drawn, 0.0
