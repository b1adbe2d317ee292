"""Friction with presliding by Dahl's first-order model, for the braid's threads and for a joint.

The state z changes by dz = (1 - sign(dx) z) dx/s_p and stays within [-1, 1]; the friction is z
times its saturated value. The model is rate-independent, so that z can be computed along a
reference path.

Source: P. R. Dahl, "Solid friction damping of mechanical vibrations", AIAA Journal 14(12), 1976.
"""

from __future__ import annotations

import math


def dahl_rate(state: float, speed: float, presliding: float, step: float) -> float:
    """dz/dt [1/s], limited to what an integration step can follow.

    Parameters
    ----------
    state : float
        z [-].
    speed : float
        dx/dt [m/s or rad/s].
    presliding : float
        s_p, the travel over which the friction builds up [m or rad].
    step : float
        Integration step [s].
    """
    turn = min(max(speed / presliding, -1.0 / step), 1.0 / step)
    return turn - abs(turn) * state


def dahl_step(state: float, travel: float, presliding: float) -> float:
    """Exact state z after a monotonic travel [m or rad] of any size."""
    if travel == 0.0:
        return state
    end = math.copysign(1.0, travel)
    return end + (state - end) * math.exp(-abs(travel) / presliding)


def dahl_slope(state: float, direction: float, presliding: float) -> float:
    """dz/dx [1/m or 1/rad] while moving in `direction` (1 or -1)."""
    return (1.0 - direction * state) / presliding
