"""The elastic pull of a bladder about its rest length: linear, stiffening or softening.

A positive cubic term makes the bladder stiffer with stretch, a negative one makes it softer, as
rubber is (Treloar, The Physics of Rubber Elasticity, chapter 5). Beyond the stretch at which the
pull of a softening bladder is largest, the pull is held constant. The polynomial itself would fall
there and finally change its sign, and the bladder would drive the muscle away from its rest length.
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
        Length minus rest length [m].
    linear : float
        k_1, at least 0 [N/m].
    cubic : float
        k_3 [N/m^3].

    Returns
    -------
    pull, slope : float
        k_1 s + k_3 s^3 [N] and its derivative [N/m]. Beyond the largest pull of a softening bladder
        the pull is constant and the slope is 0.
    """
    slope = linear + 3.0 * cubic * stretch * stretch
    if cubic < 0.0 and slope < 0.0:
        furthest = math.copysign(math.sqrt(linear / (-3.0 * cubic)), stretch)
        return furthest * 2.0 / 3.0 * linear, 0.0
    return (linear + cubic * stretch * stretch) * stretch, slope


def pull_at_length(
    length: float, rest_length: float, linear: float, cubic: float
) -> tuple[float, float]:
    """Pull [N] at a length [m], and its slope dF/dL [N/m]."""
    return bladder_pull(length - rest_length, linear, cubic)


def _ranges(rig: RigScales) -> dict[str, Range]:
    force, stroke = rig.force, rig.stroke
    return {
        "linear": Range(
            0.0,
            40.0 * force / stroke,
            0.2 * force / stroke,
            (0.2 * force / stroke, 2.0 * force / stroke),
        ),
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
    law="F = F_static + k_1 s + k_3 s^3, s = L - rest_length; with k_3 < 0 the elastic force "
    "stays constant beyond its maximum",
    source="polynomial elastic force",
    parameters={
        "linear": EffectParameter("k_1", "N/m", 0.0, 0.0, 1e8, "linear stiffness"),
        "cubic": EffectParameter("k_3", "N/m^3", 0.0, -1e12, 1e12, "cubic; negative: softening"),
    },
    slots=(PassivePull(pull_at_length),),
    control=Included("included in the muscle force and inverted exactly"),
    plausibility=Included("included in the muscle force of the torque balance"),
    search=Search(ranges=_ranges, shown_by=("position", "pulls")),
    portrait=Portrait(
        sizes={"linear": 400.0, "cubic": 4e5},
        signature="The muscle has a force that depends on its length and not on its pressure. The "
        "joint is stiffer, which is most visible at low pressure.",
        easily_taken_for="payload, end_caps, pulley_radius.",
        told_apart_by="Sweep the co-contraction down to low pressure.",
    ),
)
