"""Limits of a joint's reference: speed, acceleration, and what the valves can drive.

A reference that the valves can follow passes unchanged. Otherwise the limiter makes a motion of its
own towards it, with limited speed, acceleration and jerk: in every step it takes the acceleration
with which it would come to rest exactly at the target (`jerk_limited_stop`), seen from a target
that may move. Near the target it approaches it as three equal poles do, so that the discrete steps
do not chatter. It stops before the ends of the joint's range in the same way. Therefore a jump, a
corner or a stop of the source becomes a motion that the joint can follow.

`limited_step` is a function of one joint's limits, state, target and step, which numba compiles
together with its caller. A state is a tuple of position [rad], velocity [rad/s] and acceleration
[rad/s^2].
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

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
SUDDEN = 0.02  # s, over which the jumps of a planned trajectory's acceleration are evened out
AT_ONCE = 0.005  # s; what the valves can drive in it may jump at once
POLE = 80.0  # 1/s, of the approach near the target
LONGEST_POLE_STEP = 0.4  # product of pole and step
LARGEST_JERK = 1e8  # rad/s^3, where nothing limits it
HALVINGS = 10  # of the interval in which the acceleration of a step is sought

(L_VELOCITY, L_ACCELERATION, L_OWN_SPEED, L_OWN_PUSH, L_OWN_JERK, L_JERK, L_LOWER, L_UPPER,
 L_KNOWS_VALVES) = range(9)  # fmt: skip
N_LIMITS: Final = 9
"""Row of one joint's limits: those of `MotionLimits`, the ends of its range, and whether what a
motion needs of the valves is known."""
BEYOND, REACHED, UNDECIDED = range(3)

State = tuple[float, float, float]
ValveShare = Callable[[Array, Array, Array, Array], Array]
"""Share of the valves' full flow that positions, speeds, accelerations and jerks need [-]."""


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Limits of one joint's reference."""

    velocity: float  # [rad/s]
    acceleration: float  # [rad/s^2]
    # own_velocity, own_acceleration, own_jerk: limits of the motions that the limiter makes itself,
    # which the valves can drive anywhere in the joint's range, see `pam_control.valve_limits`
    # [rad/s], [rad/s^2], [rad/s^3]
    own_velocity: float = math.inf
    own_acceleration: float = math.inf
    own_jerk: float = LARGEST_JERK
    # what the valves can drive of a planned trajectory's jerk, at rest [rad/s^3]
    jerk: float = math.inf
    # what a motion needs of the valves; None if nothing is known
    valve_share: ValveShare | None = None
    # own_speed, own_push: largest speed and acceleration of the limiter's own motions, by all
    # limits [rad/s], [rad/s^2]
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

    def share(self, target: JointReference, jerk: float) -> float:
        """Share of the valves' flow that a motion with this jerk [rad/s^3] needs [-]."""
        if self.valve_share is None:
            return 0.0
        state = target.position, target.velocity, target.acceleration, jerk
        return float(self.valve_share(*(np.array([number]) for number in state))[0])

    def row(self, bounds: tuple[float, float]) -> list[float]:
        """The row of a joint with these ends of its range [rad]."""
        return [
            self.velocity, self.acceleration, self.own_speed, self.own_push, self.own_jerk,
            self.jerk, *bounds, float(self.valve_share is not None),
        ]  # fmt: skip


NO_LIMITS: Final = MotionLimits(math.inf, math.inf)


def resting(lim: Any, state: State) -> float:
    """Where the limiter brings a state to rest [rad]."""
    brake, jerk = BRAKING_SHARE * lim[L_OWN_PUSH], BRAKING_SHARE * lim[L_OWN_JERK]
    return rest_position(state[0], state[1], state[2], brake, jerk)


def limited_step(
    lim: Any, now: State, target: State, step: float, planned: bool, share: float
) -> tuple[int, State]:
    """The reference after a step.

    Parameters
    ----------
    lim : row of limits
        `L_VELOCITY` and its like.
    now, target : State
        Of the reference before the step, and of its source after it.
    step : float
        [s].
    planned : bool
        The source was planned for these limits and stays in the joint's range.
    share : float
        Share of the valves' flow that the step to the target needs [-]; NaN if not computed.

    Returns
    -------
    verdict : int
        REACHED: the reference is the target; BEYOND: the limits change it; UNDECIDED: `share` has
        to be computed, and nothing is known before.
    state : State
        After the step.
    """
    verdict = reaches(lim, now, target, step, planned, share)
    if verdict != BEYOND:
        return verdict, target
    low, high = accelerations(lim, now, step)
    acceleration = towards(lim, now, target, step, low, high)
    lower, upper = lim[L_LOWER], lim[L_UPPER]
    after = moved(now, acceleration, step)
    if not lower <= resting(lim, after) <= upper:
        # the end is at rest, so that the whole step is judged, unlike with a moving target
        acceleration = before_an_end(lim, now, lower, -1.0, acceleration, high, step)
        acceleration = before_an_end(lim, now, upper, 1.0, acceleration, low, step)
    # the limits of the rig file come last, because they hold whatever was asked for
    fastest = (lim[L_VELOCITY] - now[1]) / step
    slowest = (-lim[L_VELOCITY] - now[1]) / step
    most = lim[L_ACCELERATION]
    acceleration = limited(limited(acceleration, slowest, fastest), -most, most)
    if acceleration != after[2]:
        after = moved(now, acceleration, step)
    if not lower <= after[0] <= upper:
        return BEYOND, (limited(after[0], lower, upper), 0.0, 0.0)
    return BEYOND, after


def reaches(lim: Any, now: State, target: State, step: float, planned: bool, share: float) -> int:
    """Whether the target can be taken as it is, without leaving the limits; see `limited_step`."""
    way = 0.5 * (now[1] + target[1]) * step
    change = lim[L_ACCELERATION] * step
    if (
        abs(target[1]) > ROUNDING * lim[L_VELOCITY]
        or abs(target[2]) > ROUNDING * lim[L_ACCELERATION]
        or abs(target[1] - now[1]) > ROUNDING * change
        or abs(target[0] - now[0] - way) > MATCH_SHARE * change * step
    ):
        return BEYOND
    jump = abs(target[2] - now[2])
    if planned:
        return REACHED if jump <= ROUNDING * lim[L_JERK] * max(step, AT_ONCE) else BEYOND
    push = 0.5 * (now[2] + target[2]) * step
    if not (
        jump <= ROUNDING * lim[L_OWN_JERK] * step
        and abs(target[1] - now[1] - push) <= MATCH_SHARE * lim[L_OWN_PUSH] * step
        and lim[L_LOWER] <= resting(lim, target) <= lim[L_UPPER]
    ):
        return BEYOND
    if abs(target[1]) <= lim[L_OWN_SPEED] or lim[L_KNOWS_VALVES] == 0.0:
        return REACHED
    if math.isnan(share):
        return UNDECIDED
    return REACHED if share <= 1.0 else BEYOND


def accelerations(lim: Any, now: State, step: float) -> tuple[float, float]:
    """The range of accelerations that the limits leave for the next step [rad/s^2]."""
    reach, most = lim[L_OWN_JERK] * step, lim[L_OWN_PUSH]
    lowest, highest = now[2] - reach, now[2] + reach
    low = min(max(lowest, -most), highest)
    high = max(min(highest, most), lowest)
    # so that the speed keeps its limit when the acceleration fades with the limited jerk
    faster = fading(lim[L_OWN_SPEED] - now[1], lim[L_OWN_JERK], step)
    slower = -fading(lim[L_OWN_SPEED] + now[1], lim[L_OWN_JERK], step)
    high = max(low, min(high, faster))
    return min(high, max(low, slower)), high


def towards(lim: Any, now: State, target: State, step: float, low: float, high: float) -> float:
    """The acceleration [rad/s^2] of the next step towards a target at its end."""
    pole = min(POLE, LONGEST_POLE_STEP / step)
    push = lim[L_OWN_PUSH]
    at = limited(target[2], -push, push)
    gap = now[0] + step * (now[1] + 0.5 * step * now[2])
    gap -= target[0]
    a = pole**3 * gap
    b = 3.0 * pole**2 * (now[1] + step * now[2] - target[1])
    c = 3.0 * pole * (now[2] - at)
    if abs(a) + abs(b) + abs(c) <= min(lim[L_OWN_JERK], pole * push):
        return limited(now[2] - step * (a + b + c), low, high)
    return landing(lim, now, (target[0], target[1], at), step, low, high)


def landing(lim: Any, now: State, target: State, step: float, low: float, high: float) -> float:
    """The acceleration between two [rad/s^2] after which the motion would end at the target.

    It ends there with the limits' jerk and acceleration; a target that moves on is where it would
    be then. The place where the motion ends grows with the acceleration, so that halving finds it.
    """
    if passed(lim, now, target, step, high) <= 0.0:
        return high
    if passed(lim, now, target, step, low) >= 0.0:
        return low
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if passed(lim, now, target, step, middle) < 0.0:
            low = middle
        else:
            high = middle
    return low


def passed(lim: Any, now: State, target: State, step: float, acceleration: float) -> float:
    """How far behind the target the motion would end after a step with an acceleration [rad].

    Accelerations that are constant during each step change as a steady jerk does if each of them is
    that of the middle of its step.
    """
    half = 0.5 * step
    there = target[0] - half * (target[1] - half * target[2] / 2.0)
    after = moved(now, acceleration, half)
    gap = (after[0] - there, after[1] - target[1] + half * target[2], after[2] - target[2])
    return resting(lim, gap)


def before_an_end(
    lim: Any, now: State, end: float, sign: float, acceleration: float, brake: float, step: float
) -> float:
    """The acceleration [rad/s^2] with which the motion can stop before an end of the range."""
    if not sign * (resting(lim, moved(now, acceleration, step)) - end) > 0.0:
        return acceleration
    too_much, enough = acceleration, brake
    for _ in range(HALVINGS):
        middle = 0.5 * (enough + too_much)
        if sign * (resting(lim, moved(now, middle, step)) - end) > 0.0:
            too_much = middle
        else:
            enough = middle
    return enough


def moved(now: State, acceleration: float, step: float) -> State:
    """The state after a step with a constant acceleration [rad/s^2]."""
    velocity = now[1] + acceleration * step
    return now[0] + 0.5 * (now[1] + velocity) * step, velocity, acceleration


def fading(room: float, jerk: float, step: float) -> float:
    """Acceleration after which a speed grows by `room` [rad/s] if it fades with a jerk [rad/s^3].

    It lasts for a step [s] and then fades: a step + a^2/(2 jerk) = room.
    """
    if room <= 0.0:
        return room / step
    return 2.0 * room / (step + math.sqrt(step * step + 2.0 * room / jerk))
