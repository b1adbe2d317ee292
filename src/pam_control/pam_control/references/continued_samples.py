"""Joins samples of a motion that replace each other while the joint moves.

A learned policy or a remote hand sends the next tenths of a second over and over, as positions that
are 20 ms apart. Each message goes on about where the one before is at that time, but not exactly.
A way to its first waypoint would have to end within some milliseconds, or make everything later.
The path of the new message is followed from now on instead, and the difference of the present
reference from it, in position, speed and acceleration, fades along the motion.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from pam_control.references.evened_spline import EvenedSpline, largest_jump
from pam_control.references.led_in_spline import LedInSpline
from pam_control.references.motion_limiter import AT_ONCE, SUDDEN, MotionLimits
from pam_control.references.spline import (
    PEAK_SHARES,
    JointReference,
    JointSpline,
    Waypoint,
    Waypoints,
    peaks,
    spline_coefficients,
)
from pam_control.references.waypoint_velocities import SAMPLES

FADING_SHARE = 0.5  # of the limiter's speed, acceleration and jerk, for the difference
SHORTEST, LONGER, LONGEST = 0.02, 1.2, 0.3  # s, -, s; the times in which it fades


def continued(
    planned: Mapping[str, Waypoints],
    at: float,
    references: Mapping[str, JointReference],
    limits: Mapping[str, MotionLimits],
) -> dict[str, JointSpline] | None:
    """The splines, or None if the trajectory is to be joined at its first waypoint.

    Parameters
    ----------
    planned, at, references, limits
        As for `joined_trajectory.joined`.
    """
    moves = any(each.velocity or each.acceleration for each in references.values())
    if not moves or not all(_goes_on(waypoints, at) for waypoints in planned.values()):
        return None
    found: dict[str, JointSpline] = {}
    for name, waypoints in planned.items():
        if name not in limits:
            return None
        path = _path(waypoints, at, limits[name])
        here, reference = path.sample(at), references[name]
        difference = JointReference(
            reference.position - here.position,
            reference.velocity - here.velocity,
            reference.acceleration - here.acceleration,
        )
        duration = _fading_time(difference, limits[name])
        if duration > LONGEST:
            return None
        found[name] = LedInSpline(path, at, difference, duration)
    return found


def _goes_on(waypoints: Waypoints, at: float) -> bool:
    """Whether these are samples of a motion that is under way, as far as they say."""
    if not waypoints.free_start:
        return False
    gap = float(waypoints.times[1] - waypoints.times[0])
    return gap <= SAMPLES and float(waypoints.times[0]) - at <= gap


def _path(waypoints: Waypoints, at: float, limits: MotionLimits) -> JointSpline:
    """The path of a message alone, from `at` [s] on at least; its jumps are evened out."""
    early = at - float(waypoints.times[0])
    if early < 0.0:  # its first segment goes on to the time before it
        c0, c1, c2, c3, _, _ = map(float, spline_coefficients(waypoints.part(slice(2)))[0])
        position = c0 + early * (c1 + early * (c2 + early * c3))
        before = Waypoint(at, position, c1 + early * (2.0 * c2 + early * 3.0 * c3))
        waypoints = dataclasses.replace(waypoints, free_start=False).joined_to(before)
    segments = spline_coefficients(waypoints)
    position, velocity, half = map(float, segments[0, :3])
    if largest_jump(waypoints, segments, 2.0 * half) <= limits.jerk * AT_ONCE:
        return JointSpline(waypoints)
    return EvenedSpline(waypoints, SUDDEN, JointReference(position, velocity, 2.0 * half))


def _fading_time(difference: JointReference, limits: MotionLimits) -> float:
    """In which a difference fades within the limits [s]; longer than `LONGEST` if it does not.

    It may begin with a larger speed or acceleration, which is there already.
    """
    state = difference.position, difference.velocity, difference.acceleration
    fastest = max(FADING_SHARE * limits.own_speed, abs(state[1]))
    push = max(FADING_SHARE * limits.own_push, abs(state[2]))
    jerk = FADING_SHARE * limits.own_jerk
    duration = SHORTEST
    while duration <= LONGEST:
        ends = Waypoints.of([Waypoint(0.0, *state), Waypoint(duration, 0.0, 0.0, 0.0)])
        segments = spline_coefficients(ends)
        speed, acceleration = peaks(segments, np.array([duration]))
        t = duration * PEAK_SHARES
        jerks = 6.0 * segments[0, 3] + t * (24.0 * segments[0, 4] + t * 60.0 * segments[0, 5])
        if speed <= fastest and acceleration <= push and np.abs(jerks).max() <= jerk:
            break
        duration *= LONGER
    return duration
