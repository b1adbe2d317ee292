"""The end of positions that stop in motion, as a chunk of a policy or a cut recording does.

A joint cannot stop at once at the last waypoint. It would go beyond it and come back, or the whole
trajectory would have to be slow for its end. Instead, time passes more and more slowly over its
last piece: the path is the same, and the joint rests at its end, a little later. The speed falls as
1 - 3 u^2 + 2 u^3 with u = t/T, so that T seconds are spent where T/2 were asked for; the largest
deceleration is 1.5 v/T, and the largest jerk 6 v/T^2.
"""

from __future__ import annotations

import math

import numpy as np

from pam_control.references.motion_limiter import MotionLimits
from pam_control.references.spline import MONOTONE, Array

PLACES = np.linspace(0.0, 1.0, 201)
WAYS = PLACES - PLACES**3 + 0.5 * PLACES**4  # share of T that has passed of the original time


def rests_in_time(speed: float, time: float, limits: MotionLimits) -> bool:
    """Whether a joint can stop over a segment with this mean speed [rad/s] and time [s].

    The end of a cubic segment then needs 6 speed/time, and its jerk is 12 speed/time^2.
    """
    return (
        6.0 * abs(speed) <= limits.own_push * time
        and 12.0 * abs(speed) <= limits.own_jerk * time**2
    )


def stopping_time(speed: float, limits: MotionLimits) -> float:
    """The time T in which a speed [rad/s] fades within a joint's limits [s]."""
    return max(1.5 * abs(speed) / limits.own_push, math.sqrt(6.0 * abs(speed) / limits.own_jerk))


def braked_end(
    times: Array, positions: Array, velocities: Array, duration: float
) -> tuple[Array, Array]:
    """Times [s] and velocities [rad/s] of a path whose speed fades at its end.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Two at least [s].
    positions, velocities : ndarray, shape (n, joints)
        [rad], [rad/s].
    duration : float
        The time T [s].
    """
    duration = min(duration, 2.0 * float(times[-1] - times[0]))
    begin = times[-1] - 0.5 * duration
    u = np.interp((times - begin) / duration, WAYS, PLACES)
    fades = u > 0.0
    found = np.where(fades, begin + u * duration, times)
    pace = np.where(fades, 1.0 - u * u * (3.0 - 2.0 * u), 1.0)[:, None]
    most = MONOTONE * np.abs(np.diff(positions, axis=0) / np.diff(found)[:, None])
    most = np.minimum(np.concatenate([most[:1], most]), np.concatenate([most, most[-1:]]))
    slower = np.clip(velocities * pace, -most, most)
    return found, np.where(fades[:, None], slower, velocities)
