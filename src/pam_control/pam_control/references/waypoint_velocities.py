"""Velocities at waypoints that have positions only.

They are those of the cubic spline whose acceleration has no jumps, and then made smaller where this
spline would leave the range of the two waypoints around it: a joint does not go beyond a waypoint
before it holds there, nor back and forth on its way. Only where waypoints are so close that they
are samples of a curve, and where the curve bends to the same side around, its turning point may lie
between two of them. Velocities that are always 0 at the outermost sample would flatten it: the
acceleration would jump there, and a sine of 1 Hz would be followed five times worse.

Sources: C. de Boor, "A Practical Guide to Splines", Springer 1978, chapter IV (the spline);
F. N. Fritsch, R. E. Carlson, "Monotone piecewise cubic interpolation", SIAM Journal on Numerical
Analysis 17 (1980) 238-246 (three times the mean speed is monotone); H. T. Huynh, "Accurate monotone
cubic interpolation", the same 30 (1993) 57-100 (the limit at turning points, his M3).
"""

from __future__ import annotations

import numpy as np

from pam_control.references.spline import (
    MONOTONE,
    Array,
    Waypoints,
    segment_ranges,
    spline_coefficients,
)

SAMPLES = 0.1  # s; waypoints that are not further apart are samples of a curve
TURNING = 1.5  # times the speed of a parabola through the samples, which their curve may have
SWEEPS = 40  # each halves the error, at least


def velocities_at(
    times: Array,
    positions: Array,
    given: Array,
    bounds: tuple[float, float] = (-np.inf, np.inf),
) -> Array:
    """The velocities at waypoints [rad/s], with those that are given.

    A velocity that is missing at the first or the last waypoint is that of a parabola through the
    nearest three.

    Parameters
    ----------
    times, positions : ndarray, shape (n,)
        Increasing [s]; [rad].
    given : ndarray, shape (n,)
        Velocities, NaN where they are missing [rad/s].
    bounds : (float, float), optional
        Lowest and highest position, which the positions keep [rad].
    """
    is_given = np.isfinite(given)
    if times.size == 1 or is_given.all():
        return np.nan_to_num(given)
    h = np.diff(times)
    speeds = np.diff(positions) / h
    found = np.where(is_given, given, 0.0)
    if not is_given[0]:
        found[0] = _end_speed(h, speeds, found[-1], bool(is_given[-1]))
    if not is_given[-1]:
        found[-1] = _end_speed(h[::-1], speeds[::-1], found[0], bool(is_given[0]))
    missing = ~is_given[1:-1]
    _smooth(h, speeds, found, missing)
    lowest, highest = _monotone_box(speeds)
    low, high = _turning_box(h, speeds, lowest, highest)
    free = ~is_given
    found[free] = np.clip(found, low, high)[free]
    segments = spline_coefficients(Waypoints(times, positions, found, np.full_like(found, np.nan)))
    beneath, above = segment_ranges(segments, h)
    outside = (beneath < bounds[0]) | (above > bounds[1])
    strict = free & (np.append(outside, False) | np.append(False, outside))
    found[strict] = np.clip(found, lowest, highest)[strict]
    return found


def _end_speed(h: Array, speeds: Array, other: float, is_other_known: bool) -> float:
    """Speed at the first waypoint, of a parabola through the first three [rad/s]."""
    if speeds.size > 1:
        found = ((2.0 * h[0] + h[1]) * speeds[0] - h[0] * speeds[1]) / (h[0] + h[1])
    else:
        found = 1.5 * speeds[0] - 0.5 * other if is_other_known else speeds[0]
    most = (MONOTONE if h[0] <= SAMPLES else TURNING) * speeds[0]
    return float(np.clip(found, min(most, 0.0), max(most, 0.0)))


def _smooth(h: Array, speeds: Array, found: Array, missing: Array) -> None:
    """Fill in the velocities for which the acceleration does not jump, by iteration."""
    before, after = h[:-1], h[1:]
    pull = 3.0 * (after * speeds[:-1] + before * speeds[1:])
    found[1:-1][missing] = (pull / (3.0 * (before + after)))[missing]
    for _ in range(SWEEPS):
        better = (pull - after * found[:-2] - before * found[2:]) / (2.0 * (before + after))
        found[1:-1][missing] = better[missing]


def _monotone_box(speeds: Array) -> tuple[Array, Array]:
    """Lowest and highest velocities with which the spline stays between its waypoints [rad/s]."""
    most = MONOTONE * _smaller(
        np.concatenate([speeds[:1], speeds]), np.concatenate([speeds, speeds[-1:]])
    )
    return np.minimum(most, 0.0), np.maximum(most, 0.0)


def _turning_box(h: Array, speeds: Array, lowest: Array, highest: Array) -> tuple[Array, Array]:
    """The same, wider where samples of a curve turn [rad/s]."""
    bends = np.zeros(speeds.size + 1)
    bends[1:-1] = np.diff(speeds) / (h[1:] + h[:-1])
    bend = _smaller(bends[:-1], bends[1:])
    turning = np.zeros_like(bends)
    turning[1:-1] = TURNING * _smaller((speeds + h * bend)[:-1], (speeds - h * bend)[1:])
    turning[1:-1][(h[:-1] > SAMPLES) | (h[1:] > SAMPLES)] = 0.0
    return np.minimum(lowest, turning), np.maximum(highest, turning)


def _smaller(first: Array, second: Array) -> Array:
    """The smaller one of two numbers of the same sign, or 0."""
    same = first * second > 0.0
    return np.where(same, np.sign(first) * np.minimum(np.abs(first), np.abs(second)), 0.0)
