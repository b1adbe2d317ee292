"""Limits of a joint's reference: speed, acceleration, and what the valves can drive.

A reference that the valves can follow passes unchanged. Otherwise the limiter makes a motion of its
own towards it, with limited speed, acceleration and jerk: in every step it takes the acceleration
with which it would come to rest exactly at the target (`jerk_limited_stop`), seen from a target
that may move. Near the target it approaches it as three equal poles do, so that the discrete steps
do not chatter. It stops before the ends of the joint's range in the same way. Therefore a jump, a
corner or a stop of the source becomes a motion that the joint can follow.

The limiter runs ahead of the present time, up to the time at which the valves will act, and keeps
what it has given out. The controller samples this history at the times that it needs.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from pam_control.limited import limited
from pam_control.references.jerk_limited_stop import rest_position
from pam_control.references.spline import Array, JointReference

REFERENCE_SHARE = 0.6
"""Part of the joint's largest speed that a reference may have; overshoot needs the rest."""
BRAKING_SHARE = 0.9  # of acceleration and jerk, to come to rest; the rest covers discrete steps
LONGEST_STEP = 0.02  # s
ROUNDING = 1.01  # a reference that was scaled to its limit exceeds it by less
MATCH_SHARE = 0.02  # of the largest change of position in one step; taken as no difference
KEPT_AT_LEAST = 0.2  # s
SUDDEN = 0.02  # s, over which the jumps of a planned trajectory's acceleration are evened out
AT_ONCE = 0.005  # s; what the valves can drive in it may jump at once
POLE = 80.0  # 1/s, of the approach near the target
LONGEST_POLE_STEP = 0.4  # product of pole and step
LARGEST_JERK = 1e8  # rad/s^3, where nothing limits it
HALVINGS = 10  # of the interval in which the acceleration of a step is sought

ValveShare = Callable[[Array, Array, Array, Array], Array]
"""Share of the valves' full flow that positions, speeds, accelerations and jerks need [-]."""


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Limits of one joint's reference.

    Attributes
    ----------
    velocity : float
        [rad/s].
    acceleration : float
        [rad/s^2].
    own_velocity, own_acceleration, own_jerk : float
        Limits of the motions that the limiter makes itself, which the valves can drive anywhere in
        the joint's range, see `pam_control.valve_limits` [rad/s], [rad/s^2], [rad/s^3].
    own_speed, own_push : float
        Largest speed and acceleration of the limiter's own motions, by all limits [rad/s],
        [rad/s^2].
    jerk : float
        What the valves can drive of a planned trajectory's jerk, at rest [rad/s^3].
    valve_share : ValveShare or None
        What a motion needs of the valves; None if nothing is known.
    """

    velocity: float
    acceleration: float
    own_velocity: float = math.inf
    own_acceleration: float = math.inf
    own_jerk: float = LARGEST_JERK
    jerk: float = math.inf
    valve_share: ValveShare | None = None
    own_speed: float = field(init=False)
    own_push: float = field(init=False)

    def __post_init__(self) -> None:
        # computed once, because they are needed ten times in each control cycle
        object.__setattr__(self, "own_speed", min(self.velocity, self.own_velocity))
        object.__setattr__(self, "own_push", min(self.acceleration, self.own_acceleration))

    def rest(self, state: JointReference) -> float:
        """Where the limiter brings a reference to rest [rad]."""
        brake, jerk = BRAKING_SHARE * self.own_push, BRAKING_SHARE * self.own_jerk
        return rest_position(state.position, state.velocity, state.acceleration, brake, jerk)


class MotionLimiter:
    """The limited reference of one joint.

    Parameters
    ----------
    limits : MotionLimits
        Of speed, acceleration and jerk.
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
        self.gap = 0.0  # rad, between the source and the last reference
        self.keep = KEPT_AT_LEAST
        self._history: deque[tuple[float, JointReference]] = deque()

    def reset(self, position: float) -> None:
        """Rest at `position` [rad]; the next step begins the history."""
        self._rest = JointReference(position)
        self._history.clear()
        self.limited, self.gap = False, 0.0

    @property
    def state(self) -> JointReference:
        """The last reference."""
        return self._history[-1][1] if self._history else self._rest

    def advance(
        self, time: float, source: Callable[[float], JointReference], planned: bool = False
    ) -> None:
        """Follow the source up to `time` [s]; an earlier time than before changes nothing.

        Parameters
        ----------
        time : float
            [s].
        source : callable
            The reference before its limits at a time [s].
        planned : bool, optional
            The source was planned for these limits and stays in the joint's range.
        """
        if not self._history:
            self._history.append((time, self._rest))
            return
        last = self._history[-1][0]
        while last < time:
            # a remainder of rounding would be a step of no length
            step = time - last if time - last < 1.5 * LONGEST_STEP else LONGEST_STEP
            last = time if step == time - last else last + step
            target = source(last)
            reference = self._step(target, step, planned)
            self.gap = abs(target.position - reference.position)
            self._history.append((last, reference))
        while len(self._history) > 2 and self._history[1][0] < time - self.keep:
            self._history.popleft()

    def _step(self, target: JointReference, step: float, planned: bool) -> JointReference:
        now = self.state
        if self._reaches(now, target, step, planned):
            self.limited = False
            return target
        self.limited = True
        low, high = self._accelerations(now, step)
        acceleration = self._towards(now, target, step, low, high)
        lower, upper = self.bounds
        moved = _moved(now, acceleration, step)
        if not lower <= self.limits.rest(moved) <= upper:
            acceleration = self._before_the_ends(acceleration, step, low, high)
        # the limits of the rig file come last, because they hold whatever was asked for
        fastest = (self.limits.velocity - now.velocity) / step
        slowest = (-self.limits.velocity - now.velocity) / step
        most = self.limits.acceleration
        acceleration = limited(limited(acceleration, slowest, fastest), -most, most)
        if acceleration != moved.acceleration:
            moved = _moved(now, acceleration, step)
        if not lower <= moved.position <= upper:
            return JointReference(limited(moved.position, lower, upper))
        return moved

    def _before_the_ends(self, acceleration: float, step: float, low: float, high: float) -> float:
        """The acceleration [rad/s^2] with which the motion can stop before the range ends."""
        for bound, sign, brake in zip(self.bounds, (-1.0, 1.0), (high, low), strict=True):
            if self._passes(bound, sign, acceleration, step):
                # the end is at rest, so that the whole step is judged, unlike with a moving target
                too_much, acceleration = acceleration, brake
                for _ in range(HALVINGS):
                    middle = 0.5 * (acceleration + too_much)
                    if self._passes(bound, sign, middle, step):
                        too_much = middle
                    else:
                        acceleration = middle
        return acceleration

    def _passes(self, bound: float, sign: float, acceleration: float, step: float) -> bool:
        """Whether the motion would only stop behind a bound after a step with an acceleration."""
        return sign * (self.limits.rest(_moved(self.state, acceleration, step)) - bound) > 0.0

    def _accelerations(self, now: JointReference, step: float) -> tuple[float, float]:
        """The range of accelerations that the limits leave for the next step [rad/s^2]."""
        limits = self.limits
        reach, most = limits.own_jerk * step, limits.own_push
        lowest, highest = now.acceleration - reach, now.acceleration + reach
        low = min(max(lowest, -most), highest)
        high = max(min(highest, most), lowest)
        # so that the speed keeps its limit when the acceleration fades with the limited jerk
        faster = _fading(limits.own_speed - now.velocity, limits.own_jerk, step)
        slower = -_fading(limits.own_speed + now.velocity, limits.own_jerk, step)
        high = max(low, min(high, faster))
        return min(high, max(low, slower)), high

    def _towards(
        self, now: JointReference, target: JointReference, step: float, low: float, high: float
    ) -> float:
        """The acceleration [rad/s^2] of the next step towards a target at its end."""
        limits = self.limits
        pole = min(POLE, LONGEST_POLE_STEP / step)
        at = limited(target.acceleration, -limits.own_push, limits.own_push)
        gap = now.position + step * (now.velocity + 0.5 * step * now.acceleration)
        gap -= target.position
        speed = now.velocity + step * now.acceleration - target.velocity
        push = now.acceleration - at
        a, b, c = pole**3 * gap, 3.0 * pole**2 * speed, 3.0 * pole * push
        if abs(a) + abs(b) + abs(c) <= min(limits.own_jerk, pole * limits.own_push):
            return limited(now.acceleration - step * (a + b + c), low, high)
        aim = JointReference(target.position, target.velocity, at)
        return _landing(now, aim, step, low, high, limits)

    def _reaches(
        self, now: JointReference, target: JointReference, step: float, planned: bool
    ) -> bool:
        """Whether the target can be taken as it is, without leaving the limits."""
        limits = self.limits
        way = 0.5 * (now.velocity + target.velocity) * step
        change = limits.acceleration * step
        if (
            abs(target.velocity) > ROUNDING * limits.velocity
            or abs(target.acceleration) > ROUNDING * limits.acceleration
            or abs(target.velocity - now.velocity) > ROUNDING * change
            or abs(target.position - now.position - way) > MATCH_SHARE * change * step
        ):
            return False
        jump = abs(target.acceleration - now.acceleration)
        if planned:
            return jump <= ROUNDING * limits.jerk * max(step, AT_ONCE)
        push = 0.5 * (now.acceleration + target.acceleration) * step
        lower, upper = self.bounds
        return (
            jump <= ROUNDING * limits.own_jerk * step
            and abs(target.velocity - now.velocity - push) <= MATCH_SHARE * limits.own_push * step
            and lower <= limits.rest(target) <= upper
            and (
                abs(target.velocity) <= limits.own_speed
                or _share(limits, target, (target.acceleration - now.acceleration) / step) <= 1.0
            )
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


def _moved(now: JointReference, acceleration: float, step: float) -> JointReference:
    """The reference after a step with a constant acceleration [rad/s^2]."""
    velocity = now.velocity + acceleration * step
    position = now.position + 0.5 * (now.velocity + velocity) * step
    return JointReference(position, velocity, acceleration)


def _landing(
    now: JointReference,
    target: JointReference,
    step: float,
    low: float,
    high: float,
    limits: MotionLimits,
) -> float:
    """The acceleration between two [rad/s^2] after which the motion would end at the target.

    It ends there with the limits' jerk and acceleration; a target that moves on is where it would
    be then. The place where the motion ends grows with the acceleration, so that halving finds it.
    Accelerations that are constant during each step change as a steady jerk does if each of them is
    that of the middle of its step.
    """
    half = 0.5 * step
    there = target.position - half * (target.velocity - half * target.acceleration / 2.0)

    def beyond(acceleration: float) -> float:
        moved = _moved(now, acceleration, half)
        return limits.rest(
            JointReference(
                moved.position - there,
                moved.velocity - target.velocity + half * target.acceleration,
                moved.acceleration - target.acceleration,
            )
        )

    if beyond(high) <= 0.0:
        return high
    if beyond(low) >= 0.0:
        return low
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if beyond(middle) < 0.0 else (low, middle)
    return low


def _fading(room: float, jerk: float, step: float) -> float:
    """Acceleration after which a speed grows by `room` [rad/s] if it fades with a jerk [rad/s^3].

    It lasts for a step [s] and then fades: a step + a^2/(2 jerk) = room.
    """
    if room <= 0.0:
        return room / step
    return 2.0 * room / (step + math.sqrt(step * step + 2.0 * room / jerk))


def _share(limits: MotionLimits, target: JointReference, jerk: float) -> float:
    if limits.valve_share is None:
        return 0.0
    state = (np.array([x]) for x in (target.position, target.velocity, target.acceleration, jerk))
    return float(limits.valve_share(*state)[0])


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
