"""From a checked trajectory message to splines that keep the limits of speed and acceleration.

A trajectory that is too fast is played more slowly: all of its joints by the same factor, so that
its path does not change. With factor s, a velocity becomes v/s and an acceleration a/s^2. The way
from the present reference to the first waypoint is stretched separately, because the reference may
be moving.

The work is divided so that the control thread never waits: `plan` needs a message alone and may
take long, `joined` needs the present reference and takes the same time for any number of points.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pam_control.references.motion_limiter import MotionLimits
from pam_control.references.spline import (
    Array,
    JointReference,
    JointSpline,
    Waypoint,
    Waypoints,
    peaks,
    spline_coefficients,
)
from pam_control.references.trajectory import (
    CommandError,
    PastTrajectoryError,
    TrajectoryPoint,
)

RESERVE = 1.001  # a scaled trajectory stays below its limits by this factor
SLOWER = 1.1  # step of the search for the duration of the first segment
MOST_STEPS = 200
SHORTEST = 1e-3  # s, of the first segment
NEAR = 0.01  # rad
TOLD_FROM = 1e-3  # relative change of the duration that the caller is told


@dataclass(frozen=True, slots=True)
class PlannedTrajectory:
    """A trajectory that keeps the limits from its first waypoint on.

    Attributes
    ----------
    waypoints : mapping of str to Waypoints
        By joint; the times are those of the scaled trajectory on the controller's time axis [s].
    end : float
        When the trajectory would end if it were not scaled [s].
    excess : str
        Which joint would exceed which limit; empty if none.
    """

    waypoints: Mapping[str, Waypoints]
    end: float
    excess: str


def plan(
    names: Sequence[str],
    points: Sequence[TrajectoryPoint],
    *,
    start: float,
    now: float,
    limits: Mapping[str, MotionLimits],
) -> PlannedTrajectory:
    """Scale a trajectory that `check_trajectory` has accepted.

    Parameters
    ----------
    names, points
        Names and points of the message.
    start : float
        Time at which time_from_start is zero [s].
    now : float
        The present time [s].
    limits : mapping of str to MotionLimits
        Limits of the joints; a joint without limits is not scaled.

    Raises
    ------
    CommandError
        When the whole trajectory lies in the past, or when its start is so far away that the times
        of two points become equal by rounding.
    """
    times = start + np.array([point.time_from_start for point in points])
    if times[-1] < now:
        raise PastTrajectoryError(f"trajectory rejected: it ended {now - times[-1]:.3g} s ago")
    if np.any(np.diff(times) <= 0.0):
        raise CommandError("trajectory rejected: its points are too close in time")
    fields = (
        np.array([point.positions for point in points], dtype=float),
        _field([point.velocities for point in points], len(names)),
        _field([point.accelerations for point in points], len(names)),
    )
    found = {
        name: Waypoints(times, *(field[:, index] for field in fields))
        for index, name in enumerate(names)
    }
    factor, excess = 1.0, ""
    for name, waypoints in found.items():
        if name not in limits:
            continue
        speed, acceleration = peaks(spline_coefficients(waypoints), np.diff(times))
        speed = max(speed, _largest(waypoints.velocities))
        acceleration = max(acceleration, _largest(waypoints.accelerations))
        wanted = _factor(speed, acceleration, limits[name])
        if wanted > factor:
            factor, excess = wanted, _excess(name, speed, acceleration, limits[name])
    if factor > 1.0:
        origin = max(start, now)
        found = {
            name: waypoints.stretched(origin, factor * RESERVE) for name, waypoints in found.items()
        }
    return PlannedTrajectory(found, float(times[-1]), excess)


def _field(rows: Sequence[Sequence[float]], size: int) -> Array:
    missing = [math.nan] * size
    return np.array([row if len(row) else missing for row in rows], dtype=float)


def _largest(values: Array) -> float:
    """Largest absolute value; 0 if all are missing."""
    return float(np.nan_to_num(np.abs(values)).max())


def _factor(speed: float, acceleration: float, limits: MotionLimits) -> float:
    return max(speed / limits.velocity, math.sqrt(acceleration / limits.acceleration))


def _excess(name: str, speed: float, acceleration: float, limits: MotionLimits) -> str:
    return (
        f"{name} would need {speed:.3g} rad/s and {acceleration:.3g} rad/s^2 "
        f"(limits {limits.velocity:.3g} rad/s, {limits.acceleration:.3g} rad/s^2)"
    )


def joined(
    planned: PlannedTrajectory,
    *,
    now: float,
    at: float,
    references: Mapping[str, JointReference],
    limits: Mapping[str, MotionLimits],
) -> tuple[dict[str, JointSpline], str]:
    """Join a planned trajectory to the present references.

    Parameters
    ----------
    planned : PlannedTrajectory
        From `plan`.
    now : float
        The present time [s].
    at : float
        Time at which the trajectory replaces the present references [s].
    references : mapping of str to JointReference
        Reference of each of its joints at that time.
    limits : mapping of str to MotionLimits
        As for `plan`.

    Returns
    -------
    splines : dict of str to JointSpline
        By joint.
    note : str
        How much slower than asked the trajectory is played, and why; empty if it is not.
    """
    delay, excess = 0.0, planned.excess
    for name, waypoints in planned.waypoints.items():
        if name in limits and _needs_way(waypoints, now, at, references[name].position):
            late, why = _first_delay(name, waypoints, at, references[name], limits[name])
            if late > delay:
                delay, excess = late, excess or why
    splines = {}
    for name, waypoints in planned.waypoints.items():
        moved = Waypoints(
            waypoints.times + delay,
            waypoints.positions,
            waypoints.velocities,
            waypoints.accelerations,
        )
        if moved.times[0] > at:
            r = references[name]
            moved = moved.joined_to(Waypoint(at, r.position, r.velocity, r.acceleration))
        splines[name] = JointSpline(moved)
    end = max(spline.end_time for spline in splines.values())
    if end - planned.end <= TOLD_FROM * max(planned.end - at, 0.0) + 1e-6:
        return splines, ""
    asked = max(planned.end - at, 0.0)
    return splines, (
        f"trajectory slowed down: it takes {end - at:.3g} s instead of {asked:.3g} s, because "
        f"{excess}"
    )


def _needs_way(waypoints: Waypoints, now: float, at: float, position: float) -> bool:
    """Whether a way from the present reference to the first waypoint has to be planned.

    A trajectory that has begun in the past is joined where it is now. One that begins before its
    commands can act is joined there, too, if the reference is there already.
    """
    if waypoints.times[0] > at or waypoints.times[0] < now:
        return bool(waypoints.times[0] > at)
    return abs(JointSpline(waypoints).sample(at).position - position) > NEAR


def _first_delay(
    name: str, waypoints: Waypoints, at: float, reference: JointReference, limits: MotionLimits
) -> tuple[float, str]:
    """How much later than planned the first waypoint can be reached [s], and why."""
    first = Waypoint(
        float(waypoints.times[0]),
        float(waypoints.positions[0]),
        _or_none(waypoints.velocities[0]),
        _or_none(waypoints.accelerations[0]),
    )
    asked = first.time - at
    duration = max(asked, SHORTEST)
    why = ""
    for _ in range(MOST_STEPS):
        ends = Waypoints.of(
            [
                Waypoint(0.0, reference.position, reference.velocity, reference.acceleration),
                Waypoint(duration, first.position, first.velocity, first.acceleration),
            ]
        )
        speed, acceleration = peaks(spline_coefficients(ends), np.array([duration]))
        wanted = _factor(speed, acceleration, limits)
        if wanted <= RESERVE:
            break
        why = why or _excess(name, speed, acceleration, limits)
        # exact from rest; from a motion the search creeps up to the shortest duration
        ends_at_rest = not first.velocity and not first.acceleration
        still = reference.velocity == reference.acceleration == 0.0 and ends_at_rest
        duration *= wanted if still else min(wanted, SLOWER)
    return duration - asked, why


def _or_none(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
