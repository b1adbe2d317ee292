"""Ends of the braid that are no cylinder: a factor on the contraction ratio.

Ends pull less than a cylinder, never more: the factor of the force model as a whole is at least 1.

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
    """Length [m] at which a cylinder pulls as the muscle does: its contraction times the factor."""
    return length - (factor - 1.0) * (rest_length - length)


EFFECT = Effect(
    name="end_caps",
    order=140,
    stage="muscle",
    scope="muscle",
    description="the ends of the muscle are not cylindrical: a factor on the contraction ratio",
    law="force at eps' = k eps, eps = (rest_length - L)/rest_length",
    source="Tondu and Lopez, IEEE Control Systems Magazine 20(2), 2000",
    parameters={"factor": EffectParameter("k", "-", 1.0, 0.8, 1.5, "on the contraction ratio")},
    slots=(Adjusts("contraction_factor", contraction_factor),),
    control=Included("included in the muscle force and inverted exactly"),
    plausibility=Included("in the muscle's force of the torque balance"),
    search=Search(
        ranges=lambda rig: {"factor": Range(1.0 / rig.contraction_factor, 1.5, 0.1, (1.07,))},
        shown_by=("position", "pulls"),
    ),
    portrait=Portrait(
        sizes={"factor": 1.12},
        signature="Contracted muscles pull less than the cylinder says, in proportion to pressure.",
        easily_taken_for="bladder_elasticity (no pressure), pulley_radius, braid_extensibility.",
        told_apart_by="A co-contraction sweep at two angles.",
    ),
)
