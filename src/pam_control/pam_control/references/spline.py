"""Splines through the waypoints of one joint.

Between two waypoints the spline is cubic, and quintic where the accelerations of both are given.
After the last waypoint, it holds the position. That is how ros2_control's
joint_trajectory_controller reads a trajectory, but for positions without velocities: there it makes
straight lines, whose corners no valve can follow; here they have `waypoint_velocities`.
"""

from __future__ import annotations

import dataclasses
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pam_control.limited import limited

Array = npt.NDArray[np.float64]

MONOTONE = 3.0  # times the mean speed of a cubic segment, which its ends may have without overshoot
PEAK_SHARES = np.linspace(0.0, 1.0, 25)  # where a segment is searched for its peaks


@dataclass(slots=True)
class JointReference:
    """Reference of one joint: position [rad], velocity [rad/s], acceleration [rad/s^2]."""

    position: float
    velocity: float = 0.0
    acceleration: float = 0.0


@dataclass(frozen=True, slots=True)
class Waypoint:
    """Reference of one joint at one time; an acceleration that is not given is None."""

    time: float  # seconds, on the controller's time axis
    # position, velocity, acceleration: [rad], [rad/s], [rad/s^2]
    position: float
    velocity: float = 0.0
    acceleration: float | None = None


@dataclass(frozen=True, slots=True)
class Waypoints:
    """The waypoints of one joint as arrays of shape (n,); a missing acceleration is NaN."""

    times: Array  # increasing [s]
    # positions, velocities, accelerations: [rad], [rad/s], [rad/s^2]
    positions: Array
    velocities: Array
    accelerations: Array
    # the first velocity was not given: it may be made smaller to suit the way to it
    free_start: bool = False

    @classmethod
    def of(cls, waypoints: Sequence[Waypoint]) -> Waypoints:
        """Create the arrays from single waypoints."""
        return cls(
            np.array([point.time for point in waypoints], dtype=float),
            np.array([point.position for point in waypoints], dtype=float),
            np.array([point.velocity for point in waypoints], dtype=float),
            np.array([point.acceleration for point in waypoints], dtype=float),
        )

    def stretched(self, origin: float, factor: float) -> Waypoints:
        """The same path, `factor` times as slow; the time `origin` [s] stays where it is."""
        return Waypoints(
            origin + (self.times - origin) * factor,
            self.positions,
            self.velocities / factor,
            self.accelerations / factor**2,
            self.free_start,
        )

    def part(self, which: slice) -> Waypoints:
        """Some of the waypoints."""
        return Waypoints(
            self.times[which],
            self.positions[which],
            self.velocities[which],
            self.accelerations[which],
            self.free_start,
        )

    def starting_with(self, speed: float) -> Waypoints:
        """With this first velocity [rad/s], as far as the first one is free and not smaller."""
        if not self.free_start:
            return self
        free = float(self.velocities[0])
        velocities = self.velocities.copy()
        velocities[0] = limited(speed, min(free, 0.0), max(free, 0.0))
        return dataclasses.replace(self, velocities=velocities)

    def joined_to(self, first: Waypoint) -> Waypoints:
        """With one more waypoint in front; on the way from it, a free start does not overshoot."""
        one = Waypoints.of([first])
        way = float(self.positions[0]) - first.position
        rest = self.starting_with(MONOTONE * way / (float(self.times[0]) - first.time))
        return Waypoints(
            np.concatenate([one.times, rest.times]),
            np.concatenate([one.positions, rest.positions]),
            np.concatenate([one.velocities, rest.velocities]),
            np.concatenate([one.accelerations, rest.accelerations]),
        )


def spline_coefficients(points: Waypoints) -> Array:
    """Polynomial coefficients of all segments.

    Parameters
    ----------
    points : Waypoints
        n waypoints.

    Returns
    -------
    ndarray, shape (n - 1, 6)
        Coefficients in seconds since the start of the segment, constant term first. A segment is
        quintic if both of its ends have an acceleration, and else cubic.
    """
    T = np.diff(points.times)
    x0, gap = points.positions[:-1], np.diff(points.positions)
    v0, v1 = points.velocities[:-1], points.velocities[1:]
    a0, a1 = points.accelerations[:-1], points.accelerations[1:]
    quintic = np.isfinite(a0) & np.isfinite(a1)
    found = np.zeros((T.size, 6))
    found[:, 0] = x0
    found[:, 1] = v0
    found[:, 2] = (3.0 * gap / T - 2.0 * v0 - v1) / T
    found[:, 3] = (-2.0 * gap / T + v0 + v1) / T**2
    fifth = (
        0.5 * a0,
        (20.0 * gap - (8.0 * v1 + 12.0 * v0) * T - (3.0 * a0 - a1) * T**2) / (2.0 * T**3),
        (-30.0 * gap + (14.0 * v1 + 16.0 * v0) * T + (3.0 * a0 - 2.0 * a1) * T**2) / (2.0 * T**4),
        (12.0 * gap - 6.0 * (v1 + v0) * T - (a0 - a1) * T**2) / (2.0 * T**5),
    )
    for power, column in enumerate(fifth, 2):
        found[:, power] = np.where(quintic, column, found[:, power])
    return found


def peaks(coefficients: Array, durations: Array) -> tuple[float, float]:
    """Largest speed [rad/s] and acceleration [rad/s^2] of segments, at 25 places of each.

    Parameters
    ----------
    coefficients : ndarray, shape (n, 6)
        As from `spline_coefficients`.
    durations : ndarray, shape (n,)
        [s].
    """
    if not durations.size:
        return 0.0, 0.0
    t = durations[:, None] * PEAK_SHARES
    _, c1, c2, c3, c4, c5 = (column[:, None] for column in coefficients.T)
    speed = c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5)))
    acceleration = 2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5))
    return float(np.abs(speed).max()), float(np.abs(acceleration).max())


def segment_ranges(coefficients: Array, durations: Array) -> tuple[Array, Array]:
    """Lowest and highest position [rad] of each segment, at 25 places."""
    t = durations[:, None] * PEAK_SHARES
    c0, c1, c2, c3, c4, c5 = (column[:, None] for column in coefficients.T)
    found = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
    return found.min(axis=1), found.max(axis=1)


def position_range(points: Waypoints, coefficients: Array) -> tuple[float, float]:
    """Lowest and highest position [rad] of a spline, at 25 places of each segment."""
    low, high = segment_ranges(coefficients, np.diff(points.times))
    return (
        float(np.append(low, points.positions).min()),
        float(np.append(high, points.positions).max()),
    )


class JointSpline:
    """The spline of one joint through its waypoints.

    Parameters
    ----------
    waypoints : Waypoints or sequence of Waypoint
        At least one, with increasing times; the first may be the reference at the start.

    Attributes
    ----------
    lowest, highest : float
        Range of the positions, searched at 25 places of each segment [rad].
    """

    def __init__(self, waypoints: Waypoints | Sequence[Waypoint]) -> None:
        points = waypoints if isinstance(waypoints, Waypoints) else Waypoints.of(waypoints)
        self._times: list[float] = points.times.tolist()
        self._first = float(points.positions[0])
        self._last = float(points.positions[-1])
        coefficients = spline_coefficients(points)
        self._segments: list[list[float]] = coefficients.tolist()
        self.lowest, self.highest = position_range(points, coefficients)

    @property
    def start_time(self) -> float:
        """Time of the first waypoint [s]."""
        return self._times[0]

    @property
    def end_time(self) -> float:
        """Time of the last waypoint [s]."""
        return self._times[-1]

    @property
    def end_position(self) -> float:
        """Position of the last waypoint [rad]."""
        return self._last

    def sample(self, time: float) -> JointReference:
        """The reference at `time` [s]: held at the ends."""
        if time >= self._times[-1]:
            return JointReference(self._last)
        if time < self._times[0]:
            return JointReference(self._first)
        index = bisect_right(self._times, time) - 1
        c0, c1, c2, c3, c4, c5 = self._segments[index]
        t = time - self._times[index]
        return JointReference(
            c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5)))),
            c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5))),
            2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5)),
        )
