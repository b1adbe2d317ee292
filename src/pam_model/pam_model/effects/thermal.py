"""The gas heats and cools: first law with heat transfer to the wall.

Gas enters at the wall's temperature. The flow out of a warmer chamber is smaller by the factor
sqrt(T_wall/T).
"""

from __future__ import annotations

import math
from typing import Final

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Nothing, Portrait, Range, RigScales, Search
from pam_model.effects.slots import Chamber
from pam_model.gas.chamber import first_law_pressure_rate, temperature_rate
from pam_model.gas.constants import GAS_CONSTANT, HEAT_CAPACITY_RATIO, REFERENCE_TEMPERATURE

HEAT_CAPACITY: Final = GAS_CONSTANT / (HEAT_CAPACITY_RATIO - 1.0)
"""Specific heat capacity at constant volume [J/(kg K)]."""
ATMOSPHERE: Final = 101325.0
"""Standard atmosphere [Pa]."""


def first_law_rates(
    pressure: float,
    temperature: float,
    volume: float,
    volume_per_pressure: float,
    flow_in: float,
    flow_out: float,
    wall_temperature: float,
    conductance: float,
) -> tuple[float, float]:
    """dP/dt [Pa/s], dT/dt [K/s] at constant length; flows [kg/s] for gas at wall temperature."""
    leaving = flow_out * math.sqrt(wall_temperature / temperature)
    rate = first_law_pressure_rate(
        pressure,
        temperature,
        volume,
        0.0,
        volume_per_pressure,
        flow_in,
        wall_temperature,
        leaving,
        conductance * (wall_temperature - temperature),
    )
    growth = volume_per_pressure * rate
    return rate, temperature_rate(pressure, temperature, volume, rate, growth, flow_in - leaving)


def heat_capacity(pressure: float, volume: float) -> float:
    """Heat capacity [J/K] of the gas in a volume at an absolute pressure and room temperature."""
    return pressure * volume / (GAS_CONSTANT * REFERENCE_TEMPERATURE) * HEAT_CAPACITY


def heat_rate(mass: float, conductance: float) -> float:
    """Rate [1/s] at which `mass` [kg] of gas approaches the wall's temperature."""
    return conductance / (mass * HEAT_CAPACITY)


def search_ranges(rig: RigScales) -> dict[str, Range]:
    """Ranges of the search: the gas takes the wall's temperature within 4 ms to an hour."""
    capacity = heat_capacity(rig.pressure + ATMOSPHERE, rig.volume)
    return {
        "conductance": Range(
            capacity / 4000.0, capacity / 0.004, 1.0, (capacity / 4.0, capacity / 0.4), True
        )
    }


EFFECT = Effect(
    name="thermal",
    order=100,
    stage="valve",
    scope="muscle",
    description="the gas heats and cools: first law with heat transfer to the wall, which is at "
    "gas.temperature",
    law="dT/dt from the first law, Q = G (T_wall - T); replaces the polytropic chamber if G > 0",
    source="first law of an open chamber of ideal gas",
    parameters={
        "conductance": EffectParameter(
            "G",
            "W/K",
            0.0,
            0.0,
            1e4,
            "gas to wall; exactly 0 keeps the nominal polytropic chamber, a small value "
            "(1e-6) is adiabatic, a large value isothermal",
        )
    },
    slots=(Chamber(first_law_rates, exponent=HEAT_CAPACITY_RATIO, heat_rate=heat_rate),),
    control=Nothing(
        "nothing, because the effective exponent depends on the speed; the pressure loop "
        "corrects the error"
    ),
    plausibility=Nothing(
        "nothing, because the chamber lies between an isothermal and an adiabatic one; the "
        "observer corrects itself with the measurement faster than the difference grows"
    ),
    search=Search(
        ranges=search_ranges,
        shown_by=("commands",),
        shows_when_shut=True,
    ),
    portrait=Portrait(
        sizes={"conductance": 0.5},
        signature="The muscle is stiffer in fast changes than in slow ones; when the valves "
        "shut after a fast fill, the pressure falls a little within a second.",
        easily_taken_for="dead_volume; leakage, where the pressure continues to fall.",
        told_apart_by="Fill fast, then hold with shut valves.",
    ),
)
