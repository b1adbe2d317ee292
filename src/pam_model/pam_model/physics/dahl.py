"""Friction with presliding: Dahl's first-order bristle, of the braid's threads and of a joint.

The state z turns by dz = (1 - sign(dx) z) dx/s_p and stays within [-1, 1]; friction is z times its
saturated value. It does not depend on time, so that it can be run along a reference.

Source: P. R. Dahl, "Solid friction damping of mechanical vibrations", AIAA Journal 14(12), 1976.
"""

from __future__ import annotations

import math


def dahl_rate(state: float, speed: float, presliding: float, step: float) -> float:
    """dz/dt [1/s], no faster than an integration step can follow.

    Parameters
    ----------
    state : float
        z [-].
    speed : float
        dx/dt [m/s or rad/s].
    presliding : float
        s_p, travel over which friction builds up [m or rad].
    step : float
        Of the integration [s].
    """
    turn = min(max(speed / presliding, -1.0 / step), 1.0 / step)
    return turn - abs(turn) * state


def dahl_step(state: float, travel: float, presliding: float) -> float:
    """State z after a monotonic travel [m or rad] of any size; exact."""
    if travel == 0.0:
        return state
    end = math.copysign(1.0, travel)
    return end + (state - end) * math.exp(-abs(travel) / presliding)


def dahl_slope(state: float, direction: float, presliding: float) -> float:
    """dz/dx [1/m or 1/rad] while moving in `direction` (1 or -1)."""
    return (1.0 - direction * state) / presliding
