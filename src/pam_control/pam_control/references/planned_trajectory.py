"""From a checked trajectory message to splines that keep the limits of speed and acceleration.

A trajectory that is too fast is played more slowly: all of its joints by the same factor, so that
its path does not change. With factor s, a velocity becomes v/s and an acceleration a/s^2.

The work is divided so that the control thread never waits: `plan` needs a message alone and may
take long; `joined_trajectory.joined` needs the present reference and takes the same time for any
number of points.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pam_control.references.drivable_pace import SHORT, VALVE_SHARE, drivable_factor
from pam_control.references.message_waypoints import waypoints_of
from pam_control.references.motion_limiter import MotionLimits
from pam_control.references.spline import (
    Array,
    JointReference,
    Waypoints,
    peaks,
    spline_coefficients,
)
from pam_control.references.trajectory import (
    CommandError,
    PastTrajectoryError,
    TrajectoryPoint,
)
from pam_model.within_limits import within

RESERVE = 1.001  # a scaled trajectory stays below its limits by this factor
SLOWER = 1.1  # step of a search for a duration
MOST_FOR_STOP = 5.0  # how much slower a trajectory is played to be stopped in time


@dataclass(frozen=True, slots=True)
class PlannedTrajectory:
    """A trajectory that keeps the limits from its first waypoint on."""

    # by joint; the times are those of the scaled trajectory on the controller's time axis [s]
    waypoints: Mapping[str, Waypoints]
    end: float  # when the trajectory would end if it were not scaled [s]
    excess: str  # which joint would exceed which limit; empty if none


def plan(
    names: Sequence[str],
    points: Sequence[TrajectoryPoint],
    *,
    start: float,
    now: float,
    limits: Mapping[str, MotionLimits],
    bounds: Mapping[str, tuple[float, float]],
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
    bounds : mapping of str to (float, float)
        Lowest and highest position of the joints [rad].

    Raises
    ------
    CommandError
        When the whole trajectory lies in the past, when its start is so far away that the times
        of two points become equal by rounding, or when it ends in a motion that cannot be stopped
        before the end of a joint's range.
    """
    times = start + np.array([point.time_from_start for point in points])
    if times[-1] < now:
        raise PastTrajectoryError(f"trajectory rejected: it ended {now - times[-1]:.3g} s ago")
    if np.any(np.diff(times) <= 0.0):
        raise CommandError("trajectory rejected: its points are too close in time")
    found = waypoints_of(names, points, times, limits, bounds)
    factor, excess = 1.0, ""
    for name, path in found.items():
        for waypoints in (path, *_from_rest(path)):
            if name not in limits:
                continue
            coefficients = spline_coefficients(waypoints)
            speed, acceleration = peaks(coefficients, np.diff(waypoints.times))
            speed = max(speed, _largest(waypoints.velocities))
            acceleration = max(acceleration, _largest(waypoints.accelerations))
            wanted = slowing_factor(speed, acceleration, limits[name])
            if wanted > factor:
                factor, excess = wanted, excess_of(name, speed, acceleration, limits[name])
            wanted, share = drivable_factor(waypoints, coefficients, factor, limits[name])
            if wanted > factor:
                factor, excess = wanted, too_much_air(name, share)
    for name, waypoints in found.items():
        if name in limits and name in bounds:
            wanted = _stopping_factor(name, waypoints, factor, limits[name], bounds[name])
            if wanted > factor:
                factor, excess = wanted, f"{name} has to stop inside its range"
    if factor > 1.0:
        origin = max(start, now)
        found = {
            name: waypoints.stretched(origin, factor * RESERVE) for name, waypoints in found.items()
        }
    return PlannedTrajectory(found, float(times[-1]), excess)


def _from_rest(waypoints: Waypoints) -> list[Waypoints]:
    """The first segment as it is when the joint rests before it; none if that is no difference.

    A short one is the beginning of a motion that is under way: the limiter catches up with it, and
    nothing else is played more slowly because of it.
    """
    if not waypoints.free_start or waypoints.times[1] - waypoints.times[0] < SHORT:
        return []
    return [waypoints.part(slice(2)).starting_with(0.0)]


def _largest(values: Array) -> float:
    """Largest absolute value; 0 if all are missing."""
    return float(np.nan_to_num(np.abs(values)).max())


def slowing_factor(speed: float, acceleration: float, limits: MotionLimits) -> float:
    """How much more slowly a motion with these peaks has to be played; below 1 within limits."""
    return max(speed / limits.velocity, math.sqrt(acceleration / limits.acceleration))


def excess_of(name: str, speed: float, acceleration: float, limits: MotionLimits) -> str:
    """The limits that a joint would exceed, as text."""
    return (
        f"{name} would need {speed:.3g} rad/s and {acceleration:.3g} rad/s^2 "
        f"(limits {limits.velocity:.3g} rad/s, {limits.acceleration:.3g} rad/s^2)"
    )


def too_much_air(name: str, share: float) -> str:
    """How far a joint would exceed what its valves can drive, as text."""
    return f"{name} would need {share / VALVE_SHARE:.3g} times what its valves can drive"


def _stopping_factor(
    name: str,
    waypoints: Waypoints,
    factor: float,
    limits: MotionLimits,
    bounds: tuple[float, float],
) -> float:
    """How much more slowly a trajectory that ends in motion must be played to stop in time."""
    velocity = float(waypoints.velocities[-1])
    if velocity == 0.0:
        return factor
    position = float(waypoints.positions[-1])
    acceleration = float(np.nan_to_num(waypoints.accelerations[-1]))
    lower, upper = bounds
    slowest = MOST_FOR_STOP * factor
    while factor < slowest:
        state = JointReference(position, velocity / factor, acceleration / factor**2)
        if within(limits.rest(state), lower, upper):
            return factor
        factor *= SLOWER
    raise CommandError(
        f"trajectory rejected: {name} ends at {position:g} rad with {velocity:g} rad/s, "
        f"which cannot be stopped inside its position_limits [{lower:g}, {upper:g}] rad"
    )
