"""The pressure sensors filter their readings."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Nothing, Portrait, Range, Search
from pam_model.effects.slots import Adjusts


def longer_lag(lag_before: float, time_constant: float) -> float:
    """Time constant of the sensor's first-order filter [s]."""
    return lag_before + time_constant


EFFECT = Effect(
    name="pressure_lag",
    order=260,
    stage="sensing",
    scope="muscle",
    description="the pressure sensor filters its reading",
    law="dp_measured/dt = (p - p_measured)/tau_p",
    source="sensor model",
    parameters={
        "time_constant": EffectParameter("tau_p", "s", 0.0, 0.0, 0.5, "of the first-order lag")
    },
    slots=(Adjusts("pressure_sensor.lag", longer_lag),),
    control=Included(
        "compares the pressures with the plan as a sensor with this lag shows it, and includes "
        "the lag in the gain design as a delay"
    ),
    plausibility=Nothing(
        "nothing, because the observer corrects itself with the measurement; "
        "`plausibility.pressure_residual` must be larger than the lag error in fast changes"
    ),
    search=Search(
        ranges=lambda rig: {"time_constant": Range(0.0, 0.3, 0.01, (0.01, 0.03))},
        shown_by=("commands",),
    ),
    portrait=Portrait(
        sizes={"time_constant": 0.03},
        signature="Pressure readings are late and smoothed: the joint moves before the sensor "
        "shows the pressure that moves it.",
        easily_taken_for="valve_lag, where the joint is late as well.",
        told_apart_by="Move with a chirp and compare angle and pressure.",
    ),
)
