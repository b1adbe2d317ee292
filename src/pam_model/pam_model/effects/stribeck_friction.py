"""Dry friction at the joint that decreases with speed.

A Stribeck curve never rises with speed: static friction below kinetic friction counts as equal.

Source: Stribeck curve as in H. Olsson, K. J. Astrom, C. Canudas de Wit, M. Gafvert, P. Lischinsky,
"Friction models and friction compensation", European Journal of Control 4(3), 1998; presliding:
P. R. Dahl, A solid friction model, Aerospace Corporation 1968.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import (
    EffectParameter,
    Included,
    Portrait,
    Range,
    Richer,
    Search,
    TorqueFeedforward,
)
from pam_model.effects.slots import DryFriction
from pam_model.physics.decay import decay

START_SPEEDS: Final = (0.05, 0.3)
"""Starting points of the Stribeck speed in a search [rad/s]."""


def stribeck_curve(
    velocity: float, static_torque: float, torque: float, speed: float, presliding_angle: float
) -> float:
    """Magnitude of the friction [N m] at a joint velocity [rad/s]."""
    share = velocity / speed
    return torque + max(static_torque - torque, 0.0) * decay(share * share)


def starts_from_coulomb(known: Mapping[str, float]) -> tuple[Mapping[str, float], ...]:
    """Similar torque, the same presliding, more static friction, a low and a high speed.

    A joint that jumps (static friction of three times the kinetic one) is not found from a mild
    law, as its jumps come at other times.
    """
    mild, low = (1.4, 0.9), START_SPEEDS[0]
    shares = (*((*mild, speed) for speed in START_SPEEDS), (2.0, 0.65, low))
    return tuple(
        {"static_torque": most * known["torque"], "torque": least * known["torque"], "speed": speed}
        for most, least, speed in shares
    )


EFFECT = Effect(
    name="stribeck_friction",
    order=180,
    stage="joint",
    scope="joint",
    description="dry friction that decreases with speed",
    law="torque = -(T_c + (T_s - T_c) exp(-(qd/w_s)^2)) z; z as in coulomb_friction",
    source="Stribeck curve; presliding: Dahl, A solid friction model (1968)",
    parameters={
        "static_torque": EffectParameter("T_s", "N m", 0.0, 0.0, 1000.0, "at rest; T_c if smaller"),
        "torque": EffectParameter("T_c", "N m", 0.0, 0.0, 1000.0, "at speed"),
        "speed": EffectParameter("w_s", "rad/s", 0.1, 1e-3, 10.0, "Stribeck speed", True),
        "presliding_angle": EffectParameter(
            "q_p", "rad", 0.0, 0.0, 0.1, "elastic rotation before sliding", True
        ),
    },
    slots=(DryFriction(stribeck_curve, presliding="presliding_angle"),),
    control=TorqueFeedforward(
        "adds the friction torque along the reference, with its presliding angle; it fades below "
        "0.03 rad/s at the end of a motion. The change of the friction with the measured "
        "speed is compensated, so that friction that falls with speed does not drive the joint"
    ),
    plausibility=Included("the torque balance tolerates the magnitude of the friction"),
    search=Search(
        ranges=lambda rig: {
            "static_torque": Range(0.0, 5.0 * rig.torque, 0.05 * rig.torque, (0.06 * rig.torque,)),
            "torque": Range(0.0, 5.0 * rig.torque, 0.05 * rig.torque, (0.04 * rig.torque,)),
            "speed": Range(5e-3, 3.0, 0.7, START_SPEEDS, True),
            "presliding_angle": Range(1e-4, 3e-2, 0.7, (1e-3,), True),
        },
        shown_by=("position",),
        richer=Richer(than="coulomb_friction", starts=starts_from_coulomb),
    ),
    portrait=Portrait(
        sizes={"static_torque": 1.0, "torque": 0.4, "speed": 0.1},
        signature="As coulomb_friction, but the joint breaks away with a jump: stick-slip motion "
        "at low speed.",
        easily_taken_for="coulomb_friction, if the motion is never slow.",
        told_apart_by="Move in very slow ramps.",
    ),
)
