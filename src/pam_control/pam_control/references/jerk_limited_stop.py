"""Where a motion comes to rest that brakes with limited jerk and acceleration.

From a position, a speed v and an acceleration a, the fastest way to rest with at most the jerk j
and the deceleration a_max has three parts (Biagiotti and Melchiorri, Trajectory Planning for
Automatic Machines and Robots, 2008, section 3.4, for its second half): the deceleration grows to
its peak, stays there if the peak is a_max, and fades to nothing. With w = v + a|a|/(2 j), the speed
that is left when the acceleration alone is taken back, it brakes against the sign of w, and its
peak without a limit is sqrt(j |v| + a^2/2).
"""

from __future__ import annotations

import math


def rest_position(
    position: float, velocity: float, acceleration: float, deceleration: float, jerk: float
) -> float:
    """Where the motion comes to rest [rad].

    Parameters
    ----------
    position, velocity, acceleration : float
        The present state [rad], [rad/s], [rad/s^2].
    deceleration, jerk : float
        The limits, above 0 and finite [rad/s^2], [rad/s^3].
    """
    left = velocity + acceleration * abs(acceleration) / (2.0 * jerk)
    if left < 0.0:
        return -_forward(-position, -velocity, -acceleration, deceleration, jerk)
    return _forward(position, velocity, acceleration, deceleration, jerk)


def _forward(q: float, v: float, a: float, most: float, jerk: float) -> float:
    """The same for a motion that has to brake in negative direction."""
    peak = math.sqrt(max(jerk * v + 0.5 * a * a, 0.0))
    if peak <= most:
        rise, fall = (a + peak) / jerk, peak / jerk
        q += rise * (v + rise * (0.5 * a - jerk * rise / 6.0))
        v = 0.5 * peak * fall
        return q + fall * (v - fall * (0.5 * peak - jerk * fall / 6.0))
    rise, fall = abs(a + most) / jerk, most / jerk
    turn = -jerk if a > -most else jerk
    q += rise * (v + rise * (0.5 * a + turn * rise / 6.0))
    v += 0.5 * (a - most) * rise
    even = max(v - 0.5 * most * fall, 0.0) / most
    q += even * (v - 0.5 * most * even)
    v -= most * even
    return q + fall * (v - fall * (0.5 * most - jerk * fall / 6.0))
