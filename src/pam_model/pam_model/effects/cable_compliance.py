"""An elastic element in series between muscle and pulley."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Portrait, Range, Search
from pam_model.effects.slots import Adjusts


def series_compliance(compliance_before: float, compliance: float) -> float:
    """Stretch per force between muscle and pulley [m/N]; springs in series add."""
    return compliance_before + compliance


EFFECT = Effect(
    name="cable_compliance",
    order=160,
    stage="muscle",
    scope="muscle",
    description="elastic series element between muscle and pulley",
    law="L = L_path - c_c F, and the gas volume follows L",
    source="series spring",
    parameters={"compliance": EffectParameter("c_c", "m/N", 0.0, 0.0, 1e-3, "stretch per force")},
    slots=(Adjusts("series_compliance", series_compliance),),
    control=Included(
        "included in the muscle force and inverted by iteration; the gas volume remains that of "
        "the stiff braid"
    ),
    plausibility=Included("in the muscle's force of the torque balance"),
    search=Search(
        ranges=lambda rig: {
            "compliance": Range(
                0.0,
                rig.stroke / rig.force,
                0.1 * rig.stroke / rig.force,
                (0.1 * rig.stroke / rig.force,),
            )
        },
        shown_by=("position", "pulls"),
    ),
    portrait=Portrait(
        sizes={"compliance": 1e-5},
        signature="The muscle is shorter than the joint's angle says, under load: softer joint, "
        "and the gas volume moves although the joint does not.",
        easily_taken_for="dead_volume, end_caps.",
        told_apart_by="Lock the joint and change the pressure.",
    ),
)
