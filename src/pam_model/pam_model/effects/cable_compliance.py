"""An elastic element in series between muscle and pulley."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Portrait, Range, Search
from pam_model.effects.slots import Adjusts


def series_compliance(compliance_before: float, compliance: float) -> float:
    """Compliance between muscle and pulley [m/N]; the compliances of springs in series add up."""
    return compliance_before + compliance


EFFECT = Effect(
    name="cable_compliance",
    order=160,
    stage="muscle",
    scope="muscle",
    description="elastic series element between muscle and pulley",
    law="L = L_path - c_c F; the gas volume is that at L",
    source="series spring",
    parameters={"compliance": EffectParameter("c_c", "m/N", 0.0, 0.0, 5e-3, "stretch per force")},
    slots=(Adjusts("series_compliance", series_compliance),),
    control=Included(
        "included in the muscle force and inverted by iteration; included in the gas volume, which "
        "grows with the pressure"
    ),
    plausibility=Included("included in the muscle force of the torque balance"),
    search=Search(
        ranges=lambda rig: {
            "compliance": Range(
                0.0,
                3.0 * rig.stroke / rig.force,
                0.1 * rig.stroke / rig.force,
                (0.1 * rig.stroke / rig.force,),
            )
        },
        shown_by=("position", "pulls"),
    ),
    portrait=Portrait(
        sizes={"compliance": 1e-5},
        signature="Under load the muscle is shorter than the joint angle implies. The joint is "
        "softer, and the gas volume changes although the joint does not move.",
        easily_taken_for="dead_volume, end_caps.",
        told_apart_by="Lock the joint and change the pressure.",
    ),
)
