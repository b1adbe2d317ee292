"""A spline that begins beside its path, and joins it while it moves.

A joint is held where its encoder showed it, some tenths of a milliradian from the beginning of
the next trajectory. If that begins at once, or 20 ms later, going there first would need hardly any
torque, but more flow than the valves have. The difference fades along the motion instead, as a
motion of minimum jerk does: d (1 - 10 x^3 + 15 x^4 - 6 x^5) with x = t/T, whose largest jerk is
60 d/T^3. A difference in speed and acceleration fades with it.

Source: T. Flash, N. Hogan, "The coordination of arm movements", Journal of Neuroscience 5 (1985)
1688-1703 (minimum jerk).
"""

from __future__ import annotations

from pam_control.references.spline import JointReference, JointSpline, Waypoint

LARGEST_JERK = 60.0  # rad/s^3 of a difference of 1 rad that fades within 1 s


def fading_time(offset: float, jerk: float) -> float:
    """Time in which a difference [rad] fades with at most a jerk [rad/s^3], in s."""
    return float((LARGEST_JERK * abs(offset) / jerk) ** (1.0 / 3.0))


class LedInSpline(JointSpline):
    """A path and a difference from it that fades.

    Parameters
    ----------
    path : JointSpline
        The path.
    begin : float
        When the difference begins to fade [s].
    difference : JointReference
        From the path at that time.
    duration : float
        In which it fades [s].
    """

    def __init__(
        self, path: JointSpline, begin: float, difference: JointReference, duration: float
    ) -> None:
        self._path = path
        first = Waypoint(begin, difference.position, difference.velocity, difference.acceleration)
        self._fading = JointSpline([first, Waypoint(begin + duration, 0.0, 0.0, 0.0)])
        self.lowest = path.lowest + min(self._fading.lowest, 0.0)
        self.highest = path.highest + max(self._fading.highest, 0.0)

    @property
    def start_time(self) -> float:
        """Time of the first waypoint [s]."""
        return self._path.start_time

    @property
    def end_time(self) -> float:
        """When the reference rests [s]."""
        return max(self._path.end_time, self._fading.end_time)

    @property
    def end_position(self) -> float:
        """Position of the last waypoint [rad]."""
        return self._path.end_position

    def sample(self, time: float) -> JointReference:
        """The reference at `time` [s]."""
        path, beside = self._path.sample(time), self._fading.sample(time)
        return JointReference(
            path.position + beside.position,
            path.velocity + beside.velocity,
            path.acceleration + beside.acceleration,
        )
