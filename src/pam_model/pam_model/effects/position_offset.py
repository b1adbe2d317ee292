"""The zero of a joint's encoder is displaced."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import Correction, EffectParameter, Portrait, Range, Search
from pam_model.effects.slots import Adjusts


def shifted_zero(offset_before: float, offset: float) -> float:
    """Offset that the encoder adds to the position [rad]."""
    return offset_before + offset


EFFECT = Effect(
    name="position_offset",
    order=220,
    stage="sensing",
    scope="joint",
    description="the zero of the encoder is displaced",
    law="q_measured = q + q_0",
    source="sensor model",
    parameters={"offset": EffectParameter("q_0", "rad", 0.0, -1.0, 1.0, "added to the reading")},
    slots=(Adjusts("position_sensor.offset", shifted_zero),),
    control=Correction("corrects the measurements; `joint_states` still shows the raw reading"),
    plausibility=Correction("positions are corrected before they are checked"),
    search=Search(
        ranges=lambda rig: {"offset": Range(-0.9, 0.9, 0.03, (0.03, -0.03), ordinary=1e-3)},
        shown_by=("position",),
        is_sharp=True,
    ),
    portrait=Portrait(
        sizes={"offset": 0.05},
        signature="Only the zero of the angle is wrong: gravity torque and muscle lengths belong "
        "to different angles.",
        easily_taken_for="unequal neutral lengths; a payload mounted at an angle.",
        told_apart_by="Let the joint hang with vented muscles.",
    ),
)
