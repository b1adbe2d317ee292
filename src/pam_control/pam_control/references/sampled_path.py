"""Waypoints for positions that are sampled faster than a joint can follow them.

A spline through every one of them would follow their rounding and noise: positions that are rounded
to a step of the encoder (0.4 mrad), 2 ms apart, jump back and forth with 100 rad/s^2. The path
passes through its mean over 20 ms instead, at waypoints that are about as far apart. The mean of
straight lines and of a hold is what they are; it never leaves the range of the positions; and where
the joint accelerates with 10 rad/s^2, it differs by 0.2 mrad.
"""

from __future__ import annotations

import numpy as np

from pam_control.references.motion_limiter import SUDDEN
from pam_control.references.spline import Array

NEAREST = 0.75 * SUDDEN  # s between waypoints, so that a little jitter changes nothing


def thinned(times: Array, positions: Array) -> tuple[Array, Array]:
    """Times and positions that are not too dense; unchanged if they are not.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Increasing [s].
    positions : ndarray, shape (n, joints)
        [rad].
    """
    gaps = np.diff(times)
    if not np.any(gaps < NEAREST):
        return times, positions
    kept = _kept(times.tolist())
    dense = np.minimum(np.append(np.inf, gaps), np.append(gaps, np.inf))[kept] < NEAREST
    at = times[kept]
    half = np.minimum(0.5 * SUDDEN, np.minimum(at - times[0], times[-1] - at))
    dense &= half > 0.0
    found = positions[kept]
    at, half = at[dense], half[dense, None]
    found[dense] = (
        _area(times, positions, at + half[:, 0]) - _area(times, positions, at - half[:, 0])
    ) / (2.0 * half)
    return times[kept], found


def _kept(times: list[float]) -> list[int]:
    """The first and the last place, and some between them that are far enough apart."""
    kept = [0]
    for index in range(1, len(times) - 1):
        if times[index] - times[kept[-1]] >= NEAREST and times[-1] - times[index] >= NEAREST:
            kept.append(index)
    return [*kept, len(times) - 1]


def _area(times: Array, positions: Array, until: Array) -> Array:
    """Integral of the straight lines through positions, from their start to some times [rad s]."""
    gaps = np.diff(times)[:, None]
    areas = np.cumsum(0.5 * (positions[1:] + positions[:-1]) * gaps, axis=0)
    areas = np.concatenate([np.zeros((1, positions.shape[1])), areas])
    index = np.clip(np.searchsorted(times, until, side="right") - 1, 0, gaps.size - 1)
    since = (until - times[index])[:, None]
    slope = (positions[index + 1] - positions[index]) / gaps[index]
    return areas[index] + since * (positions[index] + 0.5 * since * slope)
