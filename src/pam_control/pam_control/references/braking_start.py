"""The way from a reference in motion to a waypoint: it brakes first where it would overshoot.

A quintic that begins with a motion and has much time for its way carries the motion on for a share
of that time, so that its detour grows with the time that a caller leaves: braking at 2 rad/s^2, a
reference that is to be 1 rad away in 20 s would turn around only after several rad.
"""

from __future__ import annotations

import numpy as np

from pam_control.references.motion_limiter import BRAKING_SHARE, MotionLimits
from pam_control.references.spline import (
    JointReference,
    Waypoint,
    Waypoints,
    peaks,
    position_range,
    spline_coefficients,
)

DETOUR = 0.01  # rad beyond start, stop and waypoint that is no overshoot yet
SHORTEST = 0.02  # s, of braking
LONGER = 1.2  # step of the search for the duration of braking


def way_from(
    waypoints: Waypoints, at: float, reference: JointReference, limits: MotionLimits | None
) -> Waypoints:
    """The waypoints with the present reference in front of them, and a stop where it is needed.

    Parameters
    ----------
    waypoints : Waypoints
        The first one later than `at`.
    at : float
        Time of the reference [s].
    reference : JointReference
        Where the way begins.
    limits : MotionLimits, optional
        Of the joint; without them, nothing is put between.
    """
    start = Waypoint(at, reference.position, reference.velocity, reference.acceleration)
    direct = waypoints.joined_to(start)
    time = float(waypoints.times[0]) - at
    if limits is None or reference.velocity == reference.acceleration == 0.0:
        return direct
    stop = braked(reference, limits)
    if 2.0 * stop.time >= time:
        return direct
    ends = direct.part(slice(2))
    low, high = position_range(ends, spline_coefficients(ends))
    near = [reference.position, stop.position, float(waypoints.positions[0])]
    if min(near) - DETOUR <= low and high <= max(near) + DETOUR:
        return direct
    return waypoints.joined_to(Waypoint(at + stop.time, stop.position, 0.0, 0.0)).joined_to(start)


def braked(reference: JointReference, limits: MotionLimits) -> Waypoint:
    """Where and when a reference rests if it brakes within its limits; times from now.

    Of all ways to rest within a time T, it is the one of fourth order, x = v T/2 + a T^2/12 long.
    """
    v, a = reference.velocity, reference.acceleration
    jerk, push = BRAKING_SHARE * limits.own_jerk, BRAKING_SHARE * limits.own_push
    duration = SHORTEST
    while True:
        rest = reference.position + duration * (0.5 * v + a * duration / 12.0)
        start, end = Waypoint(0.0, reference.position, v, a), Waypoint(duration, rest, 0.0, 0.0)
        ends = Waypoints.of([start, end])
        _, acceleration = peaks(spline_coefficients(ends), np.array([duration]))
        needed = abs(6.0 * v / duration**2 + 4.0 * a / duration)
        needed = max(needed, abs(6.0 * v / duration**2 + 2.0 * a / duration))
        if needed <= jerk and acceleration <= max(push, abs(a)):
            return Waypoint(duration, rest, 0.0, 0.0)
        duration *= LONGER
