"""The waypoints of each joint from the points of a message.

What a message leaves open is decided here: velocities that are missing (`waypoint_velocities`), and
where it has positions only, what is sampled more finely than joints move (`sampled_path`) and an
end in motion (`braked_end`). The velocity at the first waypoint may be made smaller when the
trajectory is joined to the present reference.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from pam_control.references.braked_end import braked_end, rests_in_time, stopping_time
from pam_control.references.motion_limiter import NO_LIMITS, MotionLimits
from pam_control.references.sampled_path import thinned
from pam_control.references.spline import Array, Waypoints
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.references.waypoint_velocities import velocities_at


def waypoints_of(
    names: Sequence[str],
    points: Sequence[TrajectoryPoint],
    times: Array,
    limits: Mapping[str, MotionLimits],
    bounds: Mapping[str, tuple[float, float]],
) -> dict[str, Waypoints]:
    """The waypoints of each joint.

    Parameters
    ----------
    names, points, limits, bounds
        As for `planned_trajectory.plan`.
    times : ndarray, shape (n,)
        Of the points, on the controller's time axis [s].
    """
    positions = np.array([point.positions for point in points], dtype=float)
    ranges = [bounds.get(name, (-math.inf, math.inf)) for name in names]
    low, high = np.array(ranges).T
    positions = np.clip(positions, low, high)  # a start at the stop, and rounding
    given = _field([point.velocities for point in points], len(names))
    accelerations = _field([point.accelerations for point in points], len(names))
    free_start = times.size > 1 and bool(np.isnan(given[0]).all())
    if times.size > 1 and np.isnan(given).all():
        times, positions = thinned(times, positions)
        given, accelerations = np.full((2, *positions.shape), math.nan)
        last_speeds = (positions[-1] - positions[-2]) / (times[-1] - times[-2])
        ends = [limits.get(name, NO_LIMITS) for name in names]
        in_motion = [
            not rests_in_time(float(speed), float(times[-1] - times[-2]), end)
            for speed, end in zip(last_speeds, ends, strict=True)
        ]
        given[-1] = np.where(in_motion, math.nan, 0.0)
        velocities = _velocities(times, positions, given, ranges)
        fading = max(map(stopping_time, velocities[-1].tolist(), ends))
        if fading > 0.0:
            times, velocities = braked_end(times, positions, velocities, fading)
    else:
        given[-1] = np.nan_to_num(given[-1])
        velocities = _velocities(times, positions, given, ranges)
    return {
        name: Waypoints(times, positions[:, i], velocities[:, i], accelerations[:, i], free_start)
        for i, name in enumerate(names)
    }


def _velocities(
    times: Array, positions: Array, given: Array, ranges: Sequence[tuple[float, float]]
) -> Array:
    columns = zip(positions.T, given.T, ranges, strict=True)
    return np.stack([velocities_at(times, *column) for column in columns], axis=1)


def _field(rows: Sequence[Sequence[float]], size: int) -> Array:
    missing = [math.nan] * size
    return np.array([row if len(row) else missing for row in rows], dtype=float)
