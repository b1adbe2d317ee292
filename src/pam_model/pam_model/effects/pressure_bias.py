"""One pressure sensor does not read zero at ambient pressure."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import Correction, EffectParameter, Portrait, Range, Search
from pam_model.effects.slots import Adjusts


def sensor_bias(bias_before: float, bias: float) -> float:
    """Bias that the sensor adds to the pressure [Pa]."""
    return bias_before + bias


EFFECT = Effect(
    name="pressure_bias",
    order=250,
    stage="sensing",
    scope="muscle",
    description="one pressure sensor does not read zero at ambient pressure",
    law="p_measured = p + p_0",
    source="sensor model",
    parameters={"bias": EffectParameter("p_0", "Pa", 0.0, -1e5, 1e5, "added to the reading")},
    slots=(Adjusts("pressure_sensor.bias", sensor_bias),),
    control=Correction("corrects the measurements; `pressure_states` still shows the raw reading"),
    plausibility=Correction("pressures are corrected before they are checked"),
    search=Search(
        ranges=lambda rig: {"bias": Range(-9e4, 9e4, 5e3, (5e3, -5e3), ordinary=1e3)},
        shown_by=(),
        is_one_sided=True,
        is_sharp=True,
    ),
    portrait=Portrait(
        sizes={"bias": 1.2e4},
        signature="The readings of one sensor are wrong by the same amount at every pressure.",
        easily_taken_for="pressure_gain, when the pressure hardly changes.",
        told_apart_by="Vent the muscles and read the sensors.",
    ),
)
