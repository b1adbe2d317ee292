"""Joins a planned trajectory to the present references, however these move.

The way from the present reference to the first waypoint is stretched separately from the rest,
because the reference may be moving. It may have to wait, to brake first, or to begin with a gradual
change of the acceleration where the valves could not follow a sudden one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from pam_control.references.braking_start import braked, way_from
from pam_control.references.continued_samples import continued
from pam_control.references.drivable_pace import STEP_SHARE, VALVE_SHARE, valve_share
from pam_control.references.evened_spline import EvenedSpline, largest_jump
from pam_control.references.led_in_spline import LedInSpline, fading_time
from pam_control.references.motion_limiter import AT_ONCE, SUDDEN, MotionLimits
from pam_control.references.planned_trajectory import (
    RESERVE,
    SLOWER,
    PlannedTrajectory,
    excess_of,
    slowing_factor,
    too_much_air,
)
from pam_control.references.spline import (
    Array,
    JointReference,
    JointSpline,
    Waypoint,
    Waypoints,
    peaks,
    spline_coefficients,
)

MOST_STEPS = 50  # 1.1^50 = 117
STRETCH, MOST_STRETCHES = 1.5, 12  # 1.5^12 = 130
SHORTEST = 1e-3  # s, of the first segment, and of a difference that fades
NEAR = 0.01  # rad
CALM_SHARE = 0.1  # of the jerk of the limiter, with which a small difference from the path fades
TOLD_FROM = 1e-3  # relative change of the duration that the caller is informed of


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
    splines, excess = continued(planned.waypoints, at, references, limits), planned.excess
    if splines is None:
        splines, why = _led_to(planned.waypoints, now, at, references, limits)
        excess = excess or why
    end = max(spline.end_time for spline in splines.values())
    if not excess or end - planned.end <= TOLD_FROM * max(planned.end - at, 0.0) + 1e-6:
        return splines, ""
    asked = max(planned.end - at, 0.0)
    return splines, (
        f"trajectory slowed down: it takes {end - at:.3g} s instead of {asked:.3g} s, because "
        f"{excess}"
    )


def _led_to(
    planned: Mapping[str, Waypoints],
    now: float,
    at: float,
    references: Mapping[str, JointReference],
    limits: Mapping[str, MotionLimits],
) -> tuple[dict[str, JointSpline], str]:
    """Splines that lead to the first waypoint, and what made them later."""
    delay, excess = 0.0, ""
    found: Mapping[str, Waypoints] = {
        name: _begun(waypoints, at, references[name]) for name, waypoints in planned.items()
    }
    beside = {
        name: _beside(waypoints, at, references[name], limits[name])
        for name, waypoints in found.items()
        if name in limits
    }
    begins = {
        name: _moved(reference, -beside.get(name, 0.0)) for name, reference in references.items()
    }
    for _ in range(MOST_STRETCHES):
        delay, why, is_way = _delay(found, now, at, begins, limits)
        excess = excess or why
        if is_way:
            break
        found = {name: each.stretched(at, STRETCH) for name, each in found.items()}
    moved = {
        name: dataclasses.replace(waypoints, times=waypoints.times + delay)
        for name, waypoints in found.items()
    }
    if any(_is_sudden(moved[name], at, begins[name], limits.get(name)) for name in moved):
        splines = _evened(moved, at, begins, limits)
    else:
        splines = {
            name: JointSpline(_from(waypoints, at, begins[name], limits.get(name)))
            for name, waypoints in moved.items()
        }
    for name, offset in beside.items():
        if offset:
            duration = max(fading_time(offset, CALM_SHARE * limits[name].own_jerk), SHORTEST)
            difference = JointReference(offset)
            splines[name] = LedInSpline(splines[name], at, difference, duration)
    return splines, excess


def _begun(waypoints: Waypoints, at: float, reference: JointReference) -> Waypoints:
    """The waypoints; a free start that has passed has the speed that the reference had there."""
    since = at - float(waypoints.times[0])
    if since < 0.0:
        return waypoints
    return waypoints.starting_with(reference.velocity - since * reference.acceleration)


def _beside(
    waypoints: Waypoints, at: float, reference: JointReference, limits: MotionLimits
) -> float:
    """Distance of the reference from a trajectory that it joins [rad], if that is to fade.

    It is not where the trajectory is far away, or leaves time to go to its first waypoint.
    """
    early = float(waypoints.times[0]) - at
    if early > 0.0:
        speed = float(waypoints.velocities[0])
        path = float(waypoints.positions[0]) - 0.5 * early * (speed + reference.velocity)
    else:
        path = JointSpline(waypoints).sample(at).position
    offset = reference.position - path
    if abs(offset) > NEAR or early > fading_time(offset, CALM_SHARE * limits.own_jerk):
        return 0.0
    return offset


def _moved(reference: JointReference, offset: float) -> JointReference:
    return dataclasses.replace(reference, position=reference.position + offset)


def _is_sudden(
    waypoints: Waypoints, at: float, reference: JointReference, limits: MotionLimits | None
) -> bool:
    """Whether the acceleration of a joint changes faster than its valves can drive."""
    if limits is None:
        return False
    points = _from(waypoints, at, reference, limits)
    jump = largest_jump(points, spline_coefficients(points), reference.acceleration)
    return jump > limits.jerk * AT_ONCE


def _from(
    waypoints: Waypoints, at: float, reference: JointReference, limits: MotionLimits | None
) -> Waypoints:
    if not waypoints.times[0] > at:
        return waypoints
    return way_from(waypoints, at, reference, limits)


def _evened(
    moved: Mapping[str, Waypoints],
    at: float,
    references: Mapping[str, JointReference],
    limits: Mapping[str, MotionLimits],
) -> dict[str, JointSpline]:
    """The same splines with gradual changes of the acceleration, half of `SUDDEN` later."""
    late = 0.5 * SUDDEN
    found: dict[str, JointSpline] = {}
    for name, waypoints in moved.items():
        now = references[name]
        if waypoints.times[0] > at:
            now = JointReference(
                now.position + late * (now.velocity + 0.5 * late * now.acceleration),
                now.velocity + late * now.acceleration,
                now.acceleration,
            )
        shifted = dataclasses.replace(waypoints, times=waypoints.times + late)
        way = _from(shifted, at + late, now, limits.get(name))
        found[name] = EvenedSpline(way, SUDDEN, now)
    return found


def _needs_way(waypoints: Waypoints, now: float, at: float, position: float) -> bool:
    """Whether a way from the present reference to the first waypoint has to be planned.

    A trajectory that has begun in the past is joined where it is now. One that begins before its
    commands can act is joined there, too, if the reference is there already.
    """
    if waypoints.times[0] > at or waypoints.times[0] < now:
        return bool(waypoints.times[0] > at)
    return abs(JointSpline(waypoints).sample(at).position - position) > NEAR


def _delay(
    planned: Mapping[str, Waypoints],
    now: float,
    at: float,
    references: Mapping[str, JointReference],
    limits: Mapping[str, MotionLimits],
) -> tuple[float, str, bool]:
    """How much later than planned all joints reach their first waypoints [s], why, and if at all.

    There may be no way at all to a waypoint in motion, whatever time it takes: a quick one goes
    beyond the limits, and a slow one swings far.
    """
    delay, because, is_way = 0.0, "", True
    for name, waypoints in planned.items():
        if name not in limits or not _needs_way(waypoints, now, at, references[name].position):
            continue
        asked = float(waypoints.times[0]) - at
        way = _duration(name, waypoints, asked, references[name], limits[name])
        if way is None:  # perhaps the present motion itself exceeds the limits
            stop = braked(references[name], limits[name])
            rest = JointReference(stop.position, 0.0, 0.0)
            way = _duration(name, waypoints, asked - stop.time, rest, limits[name])
            if way is not None:
                way = (stop.time + way[0], way[1])
        if way is None:
            is_way, because = False, because or f"{name} cannot reach its first point at that speed"
        elif way[0] - asked > delay:
            delay, because = way[0] - asked, because or way[1]
    return delay, because, is_way


def _duration(
    name: str, waypoints: Waypoints, asked: float, reference: JointReference, limits: MotionLimits
) -> tuple[float, str] | None:
    """How long the way to the first waypoint takes [s], and why; None if none keeps the limits."""
    first = waypoints.part(slice(1))
    start = Waypoint(0.0, reference.position, reference.velocity, reference.acceleration)
    rests = reference.velocity == reference.acceleration == 0.0
    still = rests and not first.velocities[0] and not np.nan_to_num(first.accelerations[0])
    duration = max(asked, SHORTEST)
    if not still:
        way = abs(float(first.positions[0]) - reference.position)
        duration = max(duration, way / limits.velocity)
    why = ""
    for _ in range(MOST_STEPS):
        ends = dataclasses.replace(first, times=np.array([duration])).joined_to(start)
        coefficients = spline_coefficients(ends)
        speed, acceleration = peaks(coefficients, np.array([duration]))
        wanted = slowing_factor(speed, acceleration, limits)
        share = 0.0
        if wanted <= RESERVE:
            # the whole way in one piece: its own ends are judged with what is before and behind it
            share = valve_share(*_with(ends, waypoints, duration), 1.0, limits, STEP_SHARE)
            wanted = max((share / VALVE_SHARE) ** 0.5, wanted)
        if wanted <= RESERVE:
            return duration, why
        why = excess_of(name, speed, acceleration, limits)
        if share:
            why = too_much_air(name, share)
        # exact from rest; from a motion the search creeps up to the shortest duration
        duration *= wanted if still else min(wanted, SLOWER)
    return None


def _with(ends: Waypoints, waypoints: Waypoints, duration: float) -> tuple[Array, Array]:
    """Times and coefficients of the way to the first waypoint and of the segment behind it."""
    later = duration + waypoints.times[1:2] - waypoints.times[0]
    both = Waypoints(
        np.concatenate([ends.times, later]),
        np.concatenate([ends.positions, waypoints.positions[1:2]]),
        np.concatenate([ends.velocities, waypoints.velocities[1:2]]),
        np.concatenate([ends.accelerations, waypoints.accelerations[1:2]]),
    )
    return both.times, spline_coefficients(both)
