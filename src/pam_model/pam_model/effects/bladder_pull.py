"""The pull of a bladder about its rest length: linear, stiffening or softening.

A cubic term above 0 stiffens. Below 0 it softens as rubber does (Treloar, The Physics of Rubber
Elasticity, chapter 5) and keeps its largest pull from there on: a polynomial's own fall beyond it
would be a bladder that drives the muscle away from rest.
"""

from __future__ import annotations

import math


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
