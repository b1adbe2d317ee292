"""Pressure and temperature of a chamber of changing volume, filled with an ideal gas.

The plant compiles these functions of floats; `pressure_rate` and `flow_for_pressure_rate` also
accept arrays, element by element. Pressures are absolute.

Source: ideal gas law; polytropic chamber; first law of an open chamber,
dP/dt = (g R/V)(m_in T_in - m_out T) - g P V'/V + (g - 1) Q/V, and dT/dt from P V = m R T. The same
V(L) must be used in the force F = -P dV/dL; otherwise the joint creates energy.
"""

from __future__ import annotations

from typing import Any

from pam_model.gas.constants import GAS_CONSTANT, HEAT_CAPACITY_RATIO, REFERENCE_TEMPERATURE


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
        Including the dead volume [m^3].
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
    temperature: Any = REFERENCE_TEMPERATURE,
    exponent: Any = 1.0,
) -> Any:
    """Mass flow [kg/s] for dP/dt = `rate` [Pa/s]; the inverse of `pressure_rate`."""
    return (rate * volume / exponent + pressure * volume_rate) / (GAS_CONSTANT * temperature)


def first_law_pressure_rate(
    pressure: float,
    temperature: float,
    volume: float,
    volume_rate: float,
    volume_per_pressure: float,
    flow_in: float,
    entering_temperature: float,
    flow_out: float,
    heat: float,
) -> float:
    """dP/dt [Pa/s] of a chamber by the first law.

    Parameters
    ----------
    pressure, temperature : float
        [Pa], [K].
    volume, volume_rate, volume_per_pressure : float
        V [m^3], its rate at constant pressure [m^3/s], dV/dP [m^3/Pa].
    flow_in, entering_temperature, flow_out : float
        Mass flows, both at least 0 [kg/s], and the temperature of the entering gas [K].
    heat : float
        Heat flow from the wall into the gas [W].
    """
    enthalpy = flow_in * entering_temperature - flow_out * temperature
    gained = HEAT_CAPACITY_RATIO * GAS_CONSTANT * enthalpy
    work = HEAT_CAPACITY_RATIO * pressure * volume_rate
    rate = (gained - work + (HEAT_CAPACITY_RATIO - 1.0) * heat) / volume
    return rate / (1.0 + HEAT_CAPACITY_RATIO * pressure * volume_per_pressure / volume)


def temperature_rate(
    pressure: float,
    temperature: float,
    volume: float,
    pressure_rate: float,
    volume_rate: float,
    flow: float,
) -> float:
    """dT/dt [K/s] from P V = m R T, so that temperature, pressure and mass cannot drift apart.

    Parameters
    ----------
    pressure, temperature, volume : float
        [Pa], [K], [m^3].
    pressure_rate, volume_rate : float
        Total rates [Pa/s], [m^3/s].
    flow : float
        Net mass flow into the chamber [kg/s].
    """
    mass = pressure * volume / (GAS_CONSTANT * temperature)
    return temperature * (pressure_rate / pressure + volume_rate / volume - flow / mass)
