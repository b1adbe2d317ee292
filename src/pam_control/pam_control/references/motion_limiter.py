"""Limits of speed and acceleration of a joint's reference.

A reference that keeps the limits passes unchanged. Otherwise the limiter follows it as fast as the
limits allow: it accelerates at most with the limit and brakes in time, both before the target and
before the ends of the joint's range (the switching curve v^2 = 2 a e of a time-optimal double
integrator). On its way to the target it also keeps what the valves can drive. Therefore a jump, a
corner or a stop of the source becomes a motion that the joint can follow.

The limiter runs ahead of the present time, up to the time at which the valves will act, and keeps
what it has given out. The controller samples this history at the times that it needs.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from pam_control.references.spline import JointReference

REFERENCE_SHARE = 0.6
"""Part of the joint's largest speed that a reference may have; overshoot needs the rest."""
BRAKING_SHARE = 0.9  # of the acceleration limit; the rest covers the discrete steps
LONGEST_STEP = 0.02  # s
ROUNDING = 1.01  # a reference that was scaled to its limit exceeds it by less
MATCH_SHARE = 0.02  # of the largest change of position in one step; taken as no difference
KEPT_AT_LEAST = 0.2  # s
LEAST_SHARE = 0.05  # of the acceleration that the valves can drive, which every speed leaves


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Limits of one joint's reference.

    Attributes
    ----------
    velocity : float
        [rad/s].
    acceleration : float
        [rad/s^2].
    drive_acceleration, drive_velocity : float
        What the valves can drive, see `pam_control.valve_limits` [rad/s^2], [rad/s].
    """

    velocity: float
    acceleration: float
    drive_acceleration: float = math.inf
    drive_velocity: float = math.inf

    def driven(self, velocity: float) -> tuple[float, float]:
        """Largest accelerations [rad/s^2] that the valves can drive at a velocity [rad/s].

        The first makes the joint faster, the second slower.
        """
        start = min(self.acceleration, self.drive_acceleration)
        share = abs(velocity) / self.drive_velocity
        faster = start * max(1.0 - share, LEAST_SHARE)
        return faster, min(start * (1.0 + share), self.acceleration)

    def stopping_distance(self, velocity: float) -> float:
        """Way [rad] on which a reference with this velocity [rad/s] stops, with its sign."""
        return velocity * abs(velocity) / (2.0 * BRAKING_SHARE * self.acceleration)


class MotionLimiter:
    """The limited reference of one joint.

    Parameters
    ----------
    limits : MotionLimits
        Of speed and acceleration.
    bounds : (float, float)
        Lowest and highest position [rad].

    Attributes
    ----------
    limited : bool
        The reference of the last step differs from its source because of the limits.
    keep : float
        How long the history reaches back before the last step [s].
    """

    def __init__(self, limits: MotionLimits, bounds: tuple[float, float]) -> None:
        self.limits = limits
        self.bounds = bounds
        self.limited = False
        self.keep = KEPT_AT_LEAST
        self._history: deque[tuple[float, JointReference]] = deque()

    def reset(self, position: float) -> None:
        """Rest at `position` [rad]; the next step begins the history."""
        self._rest = JointReference(position)
        self._history.clear()
        self.limited = False

    @property
    def state(self) -> JointReference:
        """The last reference."""
        return self._history[-1][1] if self._history else self._rest

    def advance(self, time: float, source: Callable[[float], JointReference]) -> None:
        """Follow the source up to `time` [s]; an earlier time than before changes nothing."""
        if not self._history:
            self._history.append((time, self._rest))
            return
        last = self._history[-1][0]
        while last < time:
            # a remainder of rounding would be a step of no length
            step = time - last if time - last < 1.5 * LONGEST_STEP else LONGEST_STEP
            last = time if step == time - last else last + step
            self._history.append((last, self._step(source(last), step)))
        while len(self._history) > 2 and self._history[1][0] < time - self.keep:
            self._history.popleft()

    def _step(self, target: JointReference, step: float) -> JointReference:
        now, limits = self.state, self.limits
        if self._reaches(target, step):
            self.limited = False
            return target
        self.limited = True
        lower, upper = self.bounds
        brake = BRAKING_SHARE * limits.acceleration
        faster, slower = limits.driven(now.velocity)
        gap = target.position - now.position - now.velocity * step
        # near the target the curve is a line, so that the discrete steps do not overshoot
        softly = BRAKING_SHARE * min(limits.acceleration, limits.drive_acceleration)
        closing = min(math.sqrt(2.0 * softly * abs(gap)), 0.25 * abs(gap) / step)
        wanted = target.velocity + math.copysign(closing, gap)
        highest = min(
            limits.velocity, _braking_speed(brake, upper - now.position, now.velocity, step)
        )
        lowest = max(
            -limits.velocity, -_braking_speed(brake, now.position - lower, -now.velocity, step)
        )
        if not lowest <= now.velocity <= highest:
            slower = limits.acceleration  # the range ends, or the speed is too high
        wanted = max(lowest, min(highest, wanted))
        acceleration = (wanted - now.velocity) / step
        acceleration = max(
            -slower if now.velocity > 0.0 else -faster,
            min(slower if now.velocity < 0.0 else faster, acceleration),
        )
        velocity = now.velocity + acceleration * step
        position = now.position + 0.5 * (now.velocity + velocity) * step
        if not lower <= position <= upper:
            return JointReference(max(lower, min(upper, position)))
        return JointReference(position, velocity, acceleration)

    def _reaches(self, target: JointReference, step: float) -> bool:
        """Whether the target can be taken as it is, without leaving the limits."""
        now, limits = self.state, self.limits
        lower, upper = self.bounds
        brake = BRAKING_SHARE * limits.acceleration
        room = upper - target.position if target.velocity > 0.0 else target.position - lower
        change = limits.acceleration * step
        way = 0.5 * (now.velocity + target.velocity) * step
        return (
            abs(target.velocity) <= ROUNDING * limits.velocity
            and abs(target.acceleration) <= ROUNDING * limits.acceleration
            and abs(target.velocity)
            <= _braking_speed(brake, room, abs(target.velocity), step) + change
            and abs(target.velocity - now.velocity) <= ROUNDING * change
            and abs(target.position - now.position - way) <= MATCH_SHARE * change * step
        )

    def sample(self, time: float) -> JointReference:
        """The limited reference at `time` [s]: at rest before the history, a step on after it."""
        if not self._history:
            return self._rest
        end, later = self._history[-1]
        if time >= end:
            ahead = min(time - end, LONGEST_STEP)
            return JointReference(
                later.position + ahead * (later.velocity + 0.5 * ahead * later.acceleration),
                later.velocity + ahead * later.acceleration,
                later.acceleration,
            )
        for start, earlier in reversed(self._history):
            if start <= time:
                return _between(start, earlier, end, later, time)
            end, later = start, earlier
        return later


def _braking_speed(brake: float, room: float, speed: float, step: float) -> float:
    """Largest speed [rad/s] at the end of a step that still permits to stop within the room.

    During the step the speed changes evenly from `speed` [rad/s] to the result; then the joint
    brakes with `brake` [rad/s^2]. The result is the root of v^2/(2 brake) + v step/2 = room left.
    """
    left = room - 0.5 * speed * step
    if left <= 0.0:
        return 0.0
    half = 0.5 * step
    return brake * (math.sqrt(half * half + 2.0 * left / brake) - half)


def _between(
    start: float, earlier: JointReference, end: float, later: JointReference, time: float
) -> JointReference:
    """Cubic Hermite interpolation of the position, linear of velocity and acceleration."""
    span = end - start
    if span <= 0.0:
        return later
    s = (time - start) / span
    h = s * s * (3.0 - 2.0 * s)
    tangents = (s * (1.0 - s) ** 2) * earlier.velocity - (s * s * (1.0 - s)) * later.velocity
    return JointReference(
        earlier.position + h * (later.position - earlier.position) + span * tangents,
        earlier.velocity + s * (later.velocity - earlier.velocity),
        earlier.acceleration + s * (later.acceleration - earlier.acceleration),
    )
