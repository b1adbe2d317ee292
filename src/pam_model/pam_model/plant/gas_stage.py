"""The gas of one muscle: valve, tube, leak and chamber, as rates of change.

The flows and the chamber are those of pam_model.gas; effects change the valve's opening, add a leak
or replace the polytropic chamber. Pressures here are absolute.
"""

from __future__ import annotations

from typing import Any

from pam_model.gas.flow import reference_flow
from pam_model.plant.compiled import compiled
from pam_model.plant.composition import chamber, leak, opening
from pam_model.plant.layout import (
    C_AMBIENT,
    C_DENSITY,
    C_EXPONENT,
    C_RT,
    M_CONDUCTANCE,
    M_CRITICAL,
    M_EXHAUST,
    M_PER_LAG,
    M_REGULATOR,
    M_SWING,
    M_THERMAL,
    M_THREAD,
    M_TUBE,
    M_TUBE_CONDUCTANCE,
    M_TUBE_VOLUME,
)


@compiled
def regulator_rate(
    m: int, c: Any, spool: float, outlet: float, supply: float, per_flow: float
) -> float:
    """Rate of a regulator's outlet pressure [Pa/s]: it follows `spool` within the valve's flow."""
    critical = c[m + M_CRITICAL]
    wanted = (spool + c[C_AMBIENT] - outlet) * c[m + M_PER_LAG]
    fills = wanted >= 0.0
    filling, venting, ambient = c[m + M_CONDUCTANCE], c[m + M_EXHAUST], c[C_AMBIENT]
    source, sink = (supply, outlet) if fills else (outlet, ambient)
    flow = reference_flow(filling if fills else venting, critical, source, sink)
    most = max(per_flow * flow, 0.0)
    return float(min(wanted, most) if fills else -min(-wanted, most))


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
    per_volume: float,
    volume_per_pressure: float,
    shut: bool,
) -> tuple[float, float, float, float, float]:
    """Rates of the spool and of the gas, and the flow drawn from the supply.

    `per_volume` is 1/`volume`, which the caller needs as well.

    Returns
    -------
    spool_rate : float
        [1/s]; for a regulator, of the pressure s that its outlet p follows [Pa/s]: with
        w = 1/time_constant, p' = w (s - p) and s' = w (u - s) + 2 (1 - damping) p', which is
        p'' + 2 damping w p' + w^2 p = w^2 u. Where the flow limits p', s stays near u: with
        w (s - p) in place of p' it would wind up.
    pressure_rate : float
        dP/dt [Pa/s] at constant length.
    valve_pressure_rate : float
        [Pa/s] of the tube; 0 without a tube.
    drawn : float
        Mass flow from the supply over rho0 [m^3/s].
    temperature_rate : float
        [K/s] at constant length; 0 without the thermal effect.
    """
    ambient = c[C_AMBIENT]
    critical = c[m + M_CRITICAL]
    has_tube = c[m + M_TUBE] > 0.0
    upstream = valve_pressure if has_tube else pressure
    spool_rate = (command - spool) * c[m + M_PER_LAG]
    is_regulator = c[m + M_REGULATOR] > 0.0
    exponent = c[C_EXPONENT]
    per_mass = exponent * c[C_RT] * c[C_DENSITY]
    drawn = 0.0
    vented = 0.0
    regulated_rate = 0.0
    if is_regulator and not shut:
        per_flow = per_mass / (c[m + M_TUBE_VOLUME] if has_tube else volume)
        regulated_rate = regulator_rate(m, c, spool, upstream, supply, per_flow)
        spool_rate += c[m + M_SWING] * regulated_rate
        drawn = max(regulated_rate, 0.0) / per_flow
        if not has_tube:
            return spool_rate, regulated_rate, 0.0, drawn, 0.0
    elif not is_regulator:
        x = 0.0 if shut else opening(m, c, spool)
        fills = x >= 0.0
        # One of both is 0. A choice of the conductance would become a choice of its address, with
        # which no loop over lanes becomes vector code.
        conductance = max(x, 0.0) * c[m + M_CONDUCTANCE] + max(-x, 0.0) * c[m + M_EXHAUST]
        source, sink = (supply, upstream) if fills else (upstream, ambient)
        flow = reference_flow(conductance, critical, source, sink)
        drawn = flow if fills else 0.0
        vented = 0.0 if fills else flow
    valve_pressure_rate = 0.0
    entering = drawn
    leaving = vented
    if has_tube:
        through = reference_flow(c[m + M_TUBE_CONDUCTANCE], critical, valve_pressure, pressure)
        valve_pressure_rate = regulated_rate
        if not is_regulator or shut:
            valve_pressure_rate = per_mass * (drawn - vented - through) / c[m + M_TUBE_VOLUME]
        entering = max(through, 0.0)
        leaving = max(-through, 0.0)
    leaving += leak(m, c, pressure)
    if c[m + M_THERMAL] > 0.0:
        density = c[C_DENSITY]
        pressure_rate, temperature_rate = chamber(
            m,
            c,
            pressure,
            temperature,
            volume,
            volume_per_pressure,
            density * entering,
            density * leaving,
        )
        return spool_rate, pressure_rate, valve_pressure_rate, drawn, temperature_rate
    pressure_rate = per_mass * (entering - leaving) * per_volume
    if c[m + M_THREAD] > 0.0:
        pressure_rate /= 1.0 + exponent * pressure * volume_per_pressure * per_volume
    return spool_rate, pressure_rate, valve_pressure_rate, drawn, 0.0
