"""The gas heats and cools: first law with heat transfer to the wall.

Gas arrives at the wall's temperature; what leaves a warmer chamber flows as sqrt(T_wall/T).
"""

from __future__ import annotations

import math
from typing import Final

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Nothing, Portrait, Range, Search
from pam_model.effects.slots import Chamber
from pam_model.gas.chamber import first_law_pressure_rate, temperature_rate
from pam_model.gas.constants import GAS_CONSTANT, HEAT_CAPACITY_RATIO

HEAT_CAPACITY: Final = GAS_CONSTANT / (HEAT_CAPACITY_RATIO - 1.0)
"""At constant volume [J/(kg K)]."""


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
    """dP/dt [Pa/s] and dT/dt [K/s] at constant length; flows [kg/s] as at the wall temperature."""
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


def heat_rate(mass: float, conductance: float) -> float:
    """Rate [1/s] at which `mass` [kg] of gas takes the wall's temperature."""
    return conductance / (mass * HEAT_CAPACITY)


EFFECT = Effect(
    name="thermal",
    order=100,
    stage="valve",
    scope="muscle",
    description="the gas heats and cools: first law with heat transfer to the wall at "
    "gas.temperature",
    law="dT/dt from the first law, Q = G (T_wall - T); replaces the polytropic chamber while G > 0",
    source="first law of an open chamber of ideal gas",
    parameters={
        "conductance": EffectParameter(
            "G",
            "W/K",
            0.0,
            0.0,
            1e3,
            "gas to wall; exactly 0 keeps the nominal polytropic chamber, a small value "
            "(1e-6) is adiabatic, a large one isothermal",
        )
    },
    slots=(Chamber(first_law_rates, exponent=HEAT_CAPACITY_RATIO, heat_rate=heat_rate),),
    control=Nothing(
        "nothing, because the effective exponent depends on the speed; the pressure loop "
        "corrects the error"
    ),
    plausibility=Nothing(
        "lies between the isothermal and the adiabatic chamber; the observer is pulled to the "
        "measurement faster than the difference grows"
    ),
    search=Search(
        ranges=lambda rig: {"conductance": Range(1e-4, 100.0, 1.0, (0.1, 1.0), True)},
        shown_by=("commands",),
        shows_when_shut=True,
    ),
    portrait=Portrait(
        sizes={"conductance": 0.5},
        signature="Fast changes are stiffer than slow ones; after a fast fill the pressure sinks "
        "back within a second with shut valves.",
        easily_taken_for="dead_volume, leakage (which does not stop sinking).",
        told_apart_by="A fast fill, then a hold with shut valves.",
    ),
)
