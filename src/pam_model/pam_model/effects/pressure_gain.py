"""The gain of one pressure sensor is not 1."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import Correction, EffectParameter, Portrait, Range, Search
from pam_model.effects.slots import Adjusts


def sensor_gain(gain_before: float, gain: float) -> float:
    """Reading over pressure [-]."""
    return gain_before * gain


EFFECT = Effect(
    name="pressure_gain",
    order=240,
    stage="sensing",
    scope="muscle",
    description="the gain of one pressure sensor is not 1",
    law="p_measured = g p",
    source="sensor model",
    parameters={"gain": EffectParameter("g", "-", 1.0, 0.5, 2.0, "reading over pressure")},
    slots=(Adjusts("pressure_sensor.gain", sensor_gain),),
    control=Correction("corrects the measurements; `pressure_states` still shows the raw reading"),
    plausibility=Correction("pressures are corrected before they are checked"),
    search=Search(
        ranges=lambda rig: {"gain": Range(0.6, 1.6, 0.05, (1.04, 0.96), ordinary=3e-3)},
        shown_by=(),
        is_one_sided=True,
        is_sharp=True,
    ),
    portrait=Portrait(
        sizes={"gain": 1.08},
        signature="The error of one sensor is proportional to the pressure: torque and flow do not "
        "agree with the readings of this muscle.",
        easily_taken_for="pressure_bias, when the pressure hardly changes; unequal valves.",
        told_apart_by="Hold several pressures, and vent to zero.",
    ),
)
