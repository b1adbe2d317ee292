"""The damping of the joint is larger than the rig file states."""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Portrait, Range, Search
from pam_model.effects.slots import Adjusts


def larger_damping(viscous_friction: float, extra: float) -> float:
    """Damping of the joint [N m s/rad], at least 0."""
    return max(0.0, viscous_friction + extra)


EFFECT = Effect(
    name="viscous_friction",
    order=190,
    stage="joint",
    scope="joint",
    description="the viscous damping is larger than the rig file states",
    law="torque = -(viscous_friction + d_x) qd",
    source="linear damping",
    parameters={
        "extra": EffectParameter("d_x", "N m s/rad", 0.0, -1.0, 100.0, "added to viscous_friction")
    },
    slots=(Adjusts("joint.viscous_friction", larger_damping),),
    control=Included("included in the inverse dynamics and in the gain design"),
    plausibility=Included("the torque balance uses the true damping"),
    search=Search(
        ranges=lambda rig: {
            "extra": Range(
                -rig.viscous_friction,
                10.0,
                0.5 * rig.viscous_friction + 0.05,
                (rig.viscous_friction * 0.5 + 0.05,),
            )
        },
        shown_by=("position",),
        is_sharp=True,
    ),
    portrait=Portrait(
        sizes={"extra": 0.4},
        signature="Oscillations decay faster; the joint lags in proportion to its speed.",
        easily_taken_for="position_delay, cable_compliance.",
        told_apart_by="Let the joint swing with vented muscles.",
    ),
)
