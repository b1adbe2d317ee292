"""The ends of the braid are not cylindrical: a factor on the contraction ratio.

The ends never pull more than a cylinder does. Therefore the factor of the whole force model is at
least 1. Muscles whose threads lie in the rubber lose more of their pull as they contract: measured
at Festo muscles of 10 mm, held at 0 to 12 % contraction, factors of 2 to 3.5.

Source: B. Tondu, P. Lopez, "Modeling and control of McKibben artificial muscle robot actuators",
IEEE Control Systems Magazine 20(2), 2000.
"""

from __future__ import annotations

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Portrait, Range, Search
from pam_model.effects.slots import Adjusts


def contraction_factor(factor_before: float, factor: float) -> float:
    """Factor on the contraction ratio [-]."""
    return factor_before * factor


def length_inside_caps(length: float, rest_length: float, factor: float) -> float:
    """Length [m] at which the cylinder has the pull of the muscle; its contraction is k times."""
    return length - (factor - 1.0) * (rest_length - length)


EFFECT = Effect(
    name="end_caps",
    order=140,
    stage="muscle",
    scope="muscle",
    description="the ends of the muscle are not cylindrical: a factor on the contraction ratio",
    law="force at eps' = k eps, eps = (rest_length - L)/rest_length",
    source="Tondu and Lopez, IEEE Control Systems Magazine 20(2), 2000",
    parameters={"factor": EffectParameter("k", "-", 1.0, 0.8, 3.5, "of the contraction ratio")},
    slots=(Adjusts("contraction_factor", contraction_factor),),
    control=Included("included in the muscle force and inverted exactly"),
    plausibility=Included("included in the muscle force of the torque balance"),
    search=Search(
        ranges=lambda rig: {"factor": Range(1.0 / rig.contraction_factor, 3.5, 0.1, (1.07,))},
        shown_by=("position", "pulls"),
    ),
    portrait=Portrait(
        sizes={"factor": 1.12},
        signature="Contracted muscles pull less than the cylinder model predicts; the difference "
        "is proportional to pressure.",
        easily_taken_for="bladder_elasticity, which does not depend on pressure; pulley_radius; "
        "braid_extensibility.",
        told_apart_by="Sweep the co-contraction at two angles.",
    ),
)
