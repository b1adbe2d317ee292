"""The pull of a bladder about its rest length: linear, stiffening or softening.

A cubic term above 0 stiffens. Below 0 it softens as rubber does (Treloar, The Physics of Rubber
Elasticity, chapter 5) and keeps its largest pull from there on: a polynomial's own fall beyond it
would be a bladder that drives the muscle away from rest.
"""

from __future__ import annotations

import math

from pam_model.effects.declaration import Effect
from pam_model.effects.parts import EffectParameter, Included, Portrait, Range, RigScales, Search
from pam_model.effects.slots import PassivePull


def bladder_pull(stretch: float, linear: float, cubic: float) -> tuple[float, float]:
    """Pull of the bladder and its slope.

    Parameters
    ----------
    stretch : float
        Length less rest length [m].
    linear : float
        k_1, at least 0 [N/m].
    cubic : float
        k_3 [N/m^3].

    Returns
    -------
    pull, slope : float
        k_1 s + k_3 s^3 [N] and its derivative [N/m]; held from where a softening one is largest.
    """
    slope = linear + 3.0 * cubic * stretch * stretch
    if cubic < 0.0 and slope < 0.0:
        furthest = math.copysign(math.sqrt(linear / (-3.0 * cubic)), stretch)
        return furthest * 2.0 / 3.0 * linear, 0.0
    return (linear + cubic * stretch * stretch) * stretch, slope


def pull_at_length(
    length: float, rest_length: float, linear: float, cubic: float
) -> tuple[float, float]:
    """Pull [N] at a length [m], and its slope [N/m]."""
    return bladder_pull(length - rest_length, linear, cubic)


def _ranges(rig: RigScales) -> dict[str, Range]:
    force, stroke = rig.force, rig.stroke
    return {
        "linear": Range(0.0, 40.0 * force / stroke, force / stroke * 0.2, (0.2 * force / stroke,)),
        "cubic": Range(
            -20.0 * force / stroke**3,
            100.0 * force / stroke**3,
            0.3 * force / stroke**3,
            (0.0,),
        ),
    }


EFFECT = Effect(
    name="bladder_elasticity",
    order=130,
    stage="muscle",
    scope="muscle",
    description="passive elastic force of the bladder about the rest length",
    law="F = F_static + k_1 s + k_3 s^3, s = L - rest_length; with k_3 < 0 the force keeps its "
    "largest value beyond it",
    source="polynomial elastic force",
    parameters={
        "linear": EffectParameter("k_1", "N/m", 0.0, 0.0, 1e5, "linear rate"),
        "cubic": EffectParameter("k_3", "N/m^3", 0.0, -1e9, 1e9, "cubic rate; below 0 it softens"),
    },
    slots=(PassivePull(pull_at_length),),
    control=Included("included in the muscle force and inverted exactly"),
    plausibility=Included("in the muscle's force of the torque balance"),
    search=Search(ranges=_ranges, shown_by=("position", "pulls")),
    portrait=Portrait(
        sizes={"linear": 400.0, "cubic": 4e5},
        signature="A force that depends on length and not on pressure: the joint is stiffer, at "
        "low pressure most visibly.",
        easily_taken_for="payload, end_caps, pulley_radius.",
        told_apart_by="A co-contraction sweep, down to low pressure.",
    ),
)
