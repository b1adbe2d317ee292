"""A spline whose acceleration changes gradually where that of the waypoints jumps.

A cubic spline changes its acceleration at once at every waypoint, and at its start and its end. The
valves cannot: the pressures lag behind, and the joint overshoots its reference. The reference
is therefore the mean of the spline over a short time around each moment. The mean of the
acceleration then changes at most with the jump divided by this time, and the position differs by
a T^2/24 at an acceleration a: 0.8 mrad at 50 rad/s^2 and 20 ms.
"""

from __future__ import annotations

from bisect import bisect_right

import numpy as np

from pam_control.references.spline import Array, JointReference, JointSpline, Waypoints


class EvenedSpline(JointSpline):
    """The mean of a spline over a time.

    Parameters
    ----------
    waypoints : Waypoints
        As for `JointSpline`.
    window : float
        The time [s].
    before : JointReference
        At the first waypoint, with which the motion before it continues.
    """

    def __init__(self, waypoints: Waypoints, window: float, before: JointReference) -> None:
        super().__init__(waypoints)
        self._half, self._before = 0.5 * window, before
        lengths = np.diff(waypoints.times)
        powers = lengths[:, None] ** np.arange(1, 7) / np.arange(1, 7)
        areas = (np.array(self._segments).reshape(-1, 6) * powers).sum(axis=1)
        self._areas: list[float] = [0.0, *np.cumsum(areas).tolist()]  # up to each waypoint

    @property
    def end_time(self) -> float:
        """When the reference rests [s]."""
        return self._times[-1] + self._half

    def sample(self, time: float) -> JointReference:
        """The mean of the spline around `time` [s]."""
        if time >= self.end_time:
            return JointReference(self._last)
        early, late = time - self._half, time + self._half
        first, last = self._single(early), self._single(late)
        span = 2.0 * self._half
        return JointReference(
            (self._area(late) - self._area(early)) / span,
            (last.position - first.position) / span,
            (last.velocity - first.velocity) / span,
        )

    def _single(self, time: float) -> JointReference:
        """The spline itself at a time [s]."""
        since = time - self._times[0]
        if since >= 0.0:
            return super().sample(time)
        start = self._before
        return JointReference(
            start.position + since * (start.velocity + 0.5 * since * start.acceleration),
            start.velocity + since * start.acceleration,
            start.acceleration,
        )

    def _area(self, time: float) -> float:
        """Integral of the position from the first waypoint to a time [rad s]."""
        since = time - self._times[0]
        if since < 0.0:
            q, v, a = self._before.position, self._before.velocity, self._before.acceleration
            return since * (q + since * (v / 2.0 + since * a / 6.0))
        if time >= self._times[-1]:
            return self._areas[-1] + (time - self._times[-1]) * self._last
        index = bisect_right(self._times, time) - 1
        c0, c1, c2, c3, c4, c5 = self._segments[index]
        t = time - self._times[index]
        area = c0 + t * (c1 / 2 + t * (c2 / 3 + t * (c3 / 4 + t * (c4 / 5 + t * c5 / 6))))
        return self._areas[index] + t * area


def largest_jump(waypoints: Waypoints, coefficients: Array, before: float) -> float:
    """Largest change of a spline's acceleration at once [rad/s^2].

    Parameters
    ----------
    waypoints : Waypoints
        Of the spline; after the last one it rests.
    coefficients : ndarray, shape (n, 6)
        As from `spline_coefficients`.
    before : float
        Acceleration before the first waypoint [rad/s^2].
    """
    if not len(coefficients):
        return 0.0
    t = np.diff(waypoints.times)
    _, _, c2, c3, c4, c5 = coefficients.T
    starts = np.append(2.0 * c2, 0.0)
    ends = np.append(before, 2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5)))
    return float(np.abs(starts - ends).max())
