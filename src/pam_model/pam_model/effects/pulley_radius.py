"""The moment arm of the muscles differs from the rig file."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Portrait, Range, Search
from pam_model.effects.slots import Adjusts


def true_radius(pulley_radius: float, scale: float) -> float:
    """Moment arm of the muscles [m]."""
    return pulley_radius * scale


EFFECT = Effect(
    name="pulley_radius",
    order=210,
    stage="joint",
    scope="joint",
    description="the moment arm differs from the rig file",
    law="r = pulley_radius * s",
    source="geometry",
    parameters={"scale": EffectParameter("s", "-", 1.0, 0.5, 2.0, "true over stated radius")},
    slots=(Adjusts("joint.pulley_radius", true_radius),),
    control=Included("included in torque, stiffness, lengths and gain design"),
    plausibility=Included("torque balance and gas volumes use the true radius"),
    search=Search(
        ranges=lambda rig: {"scale": Range(0.5, 2.0, 0.05, (1.05, 0.95))},
        shown_by=("position",),
        is_sharp=True,
    ),
    portrait=Portrait(
        sizes={"scale": 0.9},
        signature="Torque and muscle travel per radian are wrong by the same factor.",
        easily_taken_for="payload, end_caps, bladder_elasticity.",
        told_apart_by="Move the joint with shut valves: the pressures show the travel.",
    ),
)
