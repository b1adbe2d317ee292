"""Dry friction at the joint, independent of speed.

Source: Coulomb friction; presliding: P. R. Dahl, A solid friction model, Aerospace Corporation
1968.
"""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import (
    EffectParameter,
    Included,
    Portrait,
    Range,
    Search,
    TorqueFeedforward,
)
from pam_model.effects.slots import DryFriction


def coulomb_friction(speed: float, torque: float, presliding_angle: float) -> float:
    """Magnitude of the friction [N m]."""
    return torque


EFFECT = Effect(
    name="coulomb_friction",
    order=170,
    stage="joint",
    scope="joint",
    description="dry friction at the joint",
    law="torque = -T_c z, dz = (1 - sign(dq) z) dq/q_p (Dahl); q_p = 0: z = sign(qd)",
    source="Coulomb friction; presliding: Dahl, A solid friction model (1968)",
    parameters={
        "torque": EffectParameter("T_c", "N m", 0.0, 0.0, 1000.0, "magnitude"),
        "presliding_angle": EffectParameter(
            "q_p", "rad", 0.0, 0.0, 0.1, "elastic rotation before sliding", True
        ),
    },
    slots=(DryFriction(coulomb_friction, presliding="presliding_angle"),),
    control=TorqueFeedforward(
        "adds the friction torque along the reference, with its presliding angle; it fades below "
        "0.03 rad/s at the end of a motion"
    ),
    plausibility=Included("the torque balance tolerates the magnitude of the friction"),
    search=Search(
        ranges=lambda rig: {
            "torque": Range(
                0.0,
                5.0 * rig.torque,
                0.05 * rig.torque,
                (0.03 * rig.torque, 0.15 * rig.torque),
                ordinary=0.005 * rig.torque,
            ),
            "presliding_angle": Range(1e-4, 3e-2, 0.7, (1e-3,), True),
        },
        shown_by=("position",),
    ),
    portrait=Portrait(
        sizes={"torque": 0.6},
        signature="The joint stands still until the torque exceeds the friction; the angle has a "
        "flat top at every reversal.",
        easily_taken_for="hysteresis, which grows with pressure; stribeck_friction.",
        told_apart_by="Move in slow cycles at two co-contraction levels.",
    ),
)
