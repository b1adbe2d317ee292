"""Joint trajectories as ros2 joint_trajectory_controller reads them: splines through waypoints.

Between two waypoints the spline is linear if only positions are given, cubic with velocities, and
quintic with accelerations as well. Before the first waypoint, it starts at the joint's reference at
the time when the trajectory was received. After the last waypoint, it holds the position.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from pam_model.errors import PamError

# [rad/s], [rad/s^2]: no joint moves so fast, and larger numbers would overflow a spline.
LARGEST = {"velocities": 100.0, "accelerations": 1e5}
DEFAULT_END_SPEED = 1e-3


class CommandError(PamError):
    """A command that is rejected as a whole; the message names the wrong part and the reason."""


@dataclass(frozen=True, slots=True)
class JointReference:
    """Reference of one joint: position [rad], velocity [rad/s], acceleration [rad/s^2]."""

    position: float
    velocity: float = 0.0
    acceleration: float = 0.0


@dataclass(frozen=True, slots=True)
class Waypoint:
    """Reference of one joint at one time; a field that the message does not give is None.

    Attributes
    ----------
    time : float
        Seconds, on the controller's time axis.
    position, velocity, acceleration : float or None
        [rad], [rad/s], [rad/s^2].
    """

    time: float
    position: float
    velocity: float | None = None
    acceleration: float | None = None


@dataclass(frozen=True, slots=True)
class TrajectoryPoint:
    """One point of a message; each field is empty or has one value per joint name."""

    time_from_start: float
    positions: Sequence[float]
    velocities: Sequence[float] = ()
    accelerations: Sequence[float] = ()


def spline_coefficients(start: Waypoint, end: Waypoint) -> tuple[float, ...]:
    """Six polynomial coefficients in seconds since `start`, constant term first.

    Parameters
    ----------
    start, end : Waypoint
        `end` is later than `start`.

    Returns
    -------
    tuple of float
        Linear, cubic or quintic, according to the fields that both ends have.
    """
    T = end.time - start.time
    x0, x1 = start.position, end.position
    if start.velocity is None or end.velocity is None:
        return x0, (x1 - x0) / T, 0.0, 0.0, 0.0, 0.0
    v0, v1 = start.velocity, end.velocity
    if start.acceleration is None or end.acceleration is None:
        return (
            x0,
            v0,
            (3.0 * (x1 - x0) / T - 2.0 * v0 - v1) / T,
            (2.0 * (x0 - x1) / T + v0 + v1) / T**2,
            0.0,
            0.0,
        )
    a0, a1 = start.acceleration, end.acceleration
    gap = x1 - x0
    return (
        x0,
        v0,
        0.5 * a0,
        (20.0 * gap - (8.0 * v1 + 12.0 * v0) * T - (3.0 * a0 - a1) * T**2) / (2.0 * T**3),
        (-30.0 * gap + (14.0 * v1 + 16.0 * v0) * T + (3.0 * a0 - 2.0 * a1) * T**2) / (2.0 * T**4),
        (12.0 * gap - 6.0 * (v1 + v0) * T - (a0 - a1) * T**2) / (2.0 * T**5),
    )


class JointSpline:
    """The spline of one joint through its waypoints.

    Parameters
    ----------
    waypoints : sequence of Waypoint
        At least one, with increasing times; the first may be the reference at the start.
    """

    def __init__(self, waypoints: Sequence[Waypoint]) -> None:
        self._times = [waypoint.time for waypoint in waypoints]
        self._first = waypoints[0]
        self._last = waypoints[-1]
        self._segments = [spline_coefficients(start, end) for start, end in pairwise(waypoints)]

    @property
    def end_time(self) -> float:
        """Time of the last waypoint [s]."""
        return self._times[-1]

    def sample(self, time: float) -> JointReference:
        """The reference at `time` [s]: held at the ends."""
        if time >= self._times[-1]:
            return JointReference(self._last.position)
        if time < self._times[0]:
            return JointReference(self._first.position)
        index = bisect_right(self._times, time) - 1
        c0, c1, c2, c3, c4, c5 = self._segments[index]
        t = time - self._times[index]
        return JointReference(
            c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5)))),
            c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5))),
            2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5)),
        )


def check_trajectory(
    names: Sequence[str],
    points: Sequence[TrajectoryPoint],
    limits: Mapping[str, tuple[float, float]],
    *,
    allow_nonzero_end_velocity: bool = False,
) -> None:
    """Reject a trajectory that cannot be followed.

    Parameters
    ----------
    names : sequence of str
        The message's joint names; a subset of the rig's joints, in any order.
    points : sequence of TrajectoryPoint
        Not empty.
    limits : mapping of str to (float, float)
        Position limits [rad] of every joint of the rig.
    allow_nonzero_end_velocity : bool, optional
        Accept a last point with a velocity; the reference then stops there abruptly.

    Raises
    ------
    CommandError
        For an unknown, repeated or missing joint name, a field of the wrong size, a number that
        is not finite, times that do not increase, or a position outside the limits.
    """
    if not names:
        raise CommandError("trajectory rejected: it names no joint")
    for name in names:
        if name not in limits:
            known = ", ".join(limits)
            raise CommandError(f"trajectory rejected: unknown joint {name!r}; known: {known}")
    if len(set(names)) != len(names):
        raise CommandError("trajectory rejected: a joint is named twice")
    previous = -math.inf
    for number, point in enumerate(points):
        where = f"trajectory rejected: point {number}"
        if not math.isfinite(point.time_from_start) or point.time_from_start < 0.0:
            raise CommandError(f"{where}: time_from_start = {point.time_from_start} s")
        if point.time_from_start <= previous:
            raise CommandError(
                f"{where}: time_from_start = {point.time_from_start:g} s is not later than "
                f"the point before, {previous:g} s"
            )
        previous = point.time_from_start
        _check_point(where, names, point, limits)
    if not allow_nonzero_end_velocity:
        for name, velocity in zip(names, points[-1].velocities, strict=False):
            if abs(velocity) > DEFAULT_END_SPEED:
                raise CommandError(
                    f"trajectory rejected: {name} still moves at {velocity:g} rad/s at its end"
                )


def _check_point(
    where: str,
    names: Sequence[str],
    point: TrajectoryPoint,
    limits: Mapping[str, tuple[float, float]],
) -> None:
    fields = (
        ("positions", point.positions, True),
        ("velocities", point.velocities, False),
        ("accelerations", point.accelerations, False),
    )
    for field, values, needed in fields:
        if len(values) != len(names) and (needed or len(values) > 0):
            raise CommandError(f"{where}: {len(values)} {field} for {len(names)} joints")
        for name, value in zip(names, values, strict=False):
            if not math.isfinite(value):
                raise CommandError(f"{where}: {field} of {name} is {value}")
            if field != "positions" and abs(value) > LARGEST[field]:
                raise CommandError(
                    f"{where}: {field} of {name} is {value:g}, expected {LARGEST[field]:g} at most"
                )
    if len(point.accelerations) > 0 and len(point.velocities) == 0:
        raise CommandError(f"{where}: accelerations without velocities")
    for name, position in zip(names, point.positions, strict=True):
        lower, upper = limits[name]
        if not lower <= position <= upper:
            raise CommandError(
                f"{where}: {name} at {position:g} rad is outside its position_limits "
                f"[{lower:g}, {upper:g}] rad"
            )


def splines_from_points(
    names: Sequence[str],
    points: Sequence[TrajectoryPoint],
    *,
    start: float,
    now: float,
    references: Mapping[str, JointReference],
) -> dict[str, JointSpline]:
    """Splines for the joints of a checked trajectory.

    Parameters
    ----------
    names, points
        Arguments that `check_trajectory` has accepted.
    start : float
        Time at which time_from_start is zero [s].
    now : float
        The present time [s].
    references : mapping of str to JointReference
        Reference of each named joint at `now`.

    Raises
    ------
    CommandError
        When the whole trajectory lies in the past, or when its start is so far away that the
        times of two points become equal by rounding.
    """
    if start + points[-1].time_from_start < now:
        late = now - start - points[-1].time_from_start
        raise CommandError(f"trajectory rejected: it ended {late:.3g} s ago")
    splines = {}
    for index, name in enumerate(names):
        waypoints = [
            Waypoint(
                start + point.time_from_start,
                point.positions[index],
                point.velocities[index] if len(point.velocities) else None,
                point.accelerations[index] if len(point.accelerations) else None,
            )
            for point in points
        ]
        if waypoints[0].time > now:
            reference = references[name]
            waypoints.insert(
                0,
                Waypoint(now, reference.position, reference.velocity, reference.acceleration),
            )
        if any(later.time <= earlier.time for earlier, later in pairwise(waypoints)):
            raise CommandError("trajectory rejected: its points are too close in time")
        splines[name] = JointSpline(waypoints)
    return splines
