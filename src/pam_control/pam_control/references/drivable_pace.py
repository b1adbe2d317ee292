"""How much slower a trajectory has to be played so that the valves can follow it.

A trajectory that is played f times as slowly has speeds 1/f, accelerations 1/f^2 and jerks 1/f^3
times as large. Its jerk is taken over a short time, because a cubic spline changes its acceleration
at once at a waypoint, and the joint itself evens out what is short.
"""

from __future__ import annotations

import numpy as np

from pam_control.references.motion_limiter import SUDDEN, MotionLimits
from pam_control.references.spline import Array, Waypoints

VALVE_SHARE = 0.95  # of the valves' flow that a planned trajectory may need for longer
SHORT = 0.15  # s; a quarter period of a joint on its air: what is shorter hardly moves it
PEAK_SHARE = 3.0  # what a trajectory may need for a moment: such peaks alternate and even out
STEP_SHARE = 1.25  # the same on the way to its first waypoint, which may be a step
WAYPOINT_SHARE = 1.1  # the same in a waypoint, so that there is a way to it
MOST_SAMPLES = 25  # of a segment
FEWEST_SAMPLES = 3
SAMPLES = 20000  # of a trajectory, where its segments have more than the fewest
FINEST = 1.01  # relative accuracy of the pace
LARGEST_STEP = 2.0
MOST_STEPS = 40


def valve_share(
    times: Array,
    coefficients: Array,
    factor: float,
    limits: MotionLimits,
    peak: float = PEAK_SHARE,
) -> float:
    """Largest share of what the valves can drive that a trajectory needs [-]; 0 if unknown.

    It is `VALVE_SHARE` where the trajectory just may be played: with a mean over `SHORT` of that
    share of the flow, or a peak of `peak`.

    Parameters
    ----------
    times : ndarray, shape (n + 1,)
        Of the waypoints [s].
    coefficients : ndarray, shape (n, 6)
        As from `spline_coefficients`.
    factor : float
        How much more slowly it is played [-].
    limits : MotionLimits
        Of the joint.
    peak : float, optional
        Share of the flow that it may need for a moment [-].
    """
    if limits.valve_share is None or not len(coefficients):
        return 0.0
    count = max(FEWEST_SAMPLES, min(MOST_SAMPLES, SAMPLES // len(coefficients)))
    shares = np.linspace(0.0, 1.0, count)
    t = np.diff(times)[:, None] * shares
    c0, c1, c2, c3, c4, c5 = (column[:, None] for column in coefficients.T)
    position = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
    speed = c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5)))
    push = 2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5))
    at = (times[:-1, None] + t).ravel()
    half = 0.5 * SUDDEN / factor
    jerk = (
        _acceleration(times, coefficients, at + half)
        - _acceleration(times, coefficients, at - half)
    ) / (2.0 * half)
    found = limits.valve_share(
        position.ravel(), speed.ravel() / factor, push.ravel() / factor**2, jerk / factor**3
    )
    return max(_longer(at * factor, found), float(found.max()) / peak * VALVE_SHARE)


def _longer(times: Array, shares: Array) -> float:
    """Largest mean over `SHORT` of shares [-] at increasing times [s]."""
    moved = np.concatenate([[0.0], np.cumsum(0.5 * (shares[1:] + shares[:-1]) * np.diff(times))])
    begin, end = (np.interp(times + side * SHORT, times, moved) for side in (-0.5, 0.5))
    return float((end - begin).max()) / SHORT


def _acceleration(times: Array, coefficients: Array, at: Array) -> Array:
    """Accelerations [rad/s^2] at some times [s]; 0 outside the trajectory."""
    index = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(coefficients) - 1)
    t = at - times[index]
    _, _, c2, c3, c4, c5 = coefficients[index].T
    found: Array = 2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5))
    return np.where((at >= times[0]) & (at < times[-1]), found, 0.0)


def _waypoint_share(waypoints: Waypoints, factor: float, limits: MotionLimits) -> float:
    """What the waypoints alone need, as a share of the share that they may need [-]."""
    if limits.valve_share is None:
        return 0.0
    speeds = waypoints.velocities / factor
    pushes = np.nan_to_num(waypoints.accelerations) / factor**2
    found = limits.valve_share(waypoints.positions, speeds, pushes, np.zeros_like(speeds))
    return float(found.max()) / WAYPOINT_SHARE * VALVE_SHARE


def drivable_factor(
    waypoints: Waypoints, coefficients: Array, factor: float, limits: MotionLimits
) -> tuple[float, float]:
    """The smallest factor, at least `factor`, at which the valves can drive a trajectory.

    Parameters
    ----------
    coefficients, factor, limits
        As for `valve_share`.

    Returns
    -------
    found, needed : float
        This factor [-], and the share that the trajectory would need without it, see `valve_share`.
    """

    def share_at(pace: float) -> float:
        return max(
            valve_share(waypoints.times, coefficients, pace, limits),
            _waypoint_share(waypoints, pace, limits),
        )

    needed = share = share_at(factor)
    low = high = factor
    for _ in range(MOST_STEPS):
        if share <= VALVE_SHARE:
            break
        low = high
        high *= max(FINEST, min((share / VALVE_SHARE) ** 0.5, LARGEST_STEP))
        share = share_at(high)
    while high > FINEST * low:
        middle = (low * high) ** 0.5
        if share_at(middle) <= VALVE_SHARE:
            high = middle
        else:
            low = middle
    return high, needed
