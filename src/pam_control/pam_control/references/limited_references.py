"""The references of all joints: from their sources through the limits of motion to any time.

The source of a joint is where it holds, a stream or a trajectory. Streamed positions pass a
critically damped second-order filter, because the feedforward needs a velocity and an acceleration.
Every source passes the limiter (`motion_limiter`), which runs ahead of the present time, up to the
time at which the valves will act. What it has given out is kept; the controller samples this
history at the times that it needs.

The functions of rows are compiled by numba if it is installed. A row of the history is its time and
then position, velocity and acceleration of each joint.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from pam_control.limited import limited
from pam_control.references.motion_limiter import (
    BEYOND,
    L_LOWER,
    L_OWN_PUSH,
    L_UPPER,
    L_VELOCITY,
    LONGEST_STEP,
    N_LIMITS,
    UNDECIDED,
    MotionLimits,
    State,
    limited_step,
)
from pam_control.references.spline import JointReference
from pam_model.plant.compiled import entry_point, for_kernel, prepare

LONGEST_FILTER_STEP: Final = 0.02  # s
KEPT_AT_LEAST: Final = 0.2  # s
FIRST_SIZE: Final = 256  # of the history; it grows when it is full

ADVANCED, EXPIRED = -1, -2
"""What `advance_references` returns instead of the number of a joint."""
HOLD, TRAJECTORY, STREAM = range(3)
(R_KIND, R_HELD, R_PLANNED, R_TARGET, R_SPEED, R_RECEIVED, R_POSITION, R_VELOCITY, R_ACCELERATION,
 R_ADVANCED, R_CLIPPED) = range(11)  # fmt: skip
N_SOURCE: Final = 11
"""Row of one joint's source: its kind; where it holds, or will [rad]; whether a trajectory stays in
the range; of a stream its target [rad], its speed [rad/s], when it was received [s], the state of
the filter, until when it was advanced [s], and whether limits changed it."""
(T_POSITION, T_VELOCITY, T_ACCELERATION, T_SHARE, T_LIMITED, T_GAP) = range(6)
N_TARGET: Final = 6
"""Row of one joint's step: the trajectory's state, the share of the valves' flow, and of the last
step, whether limits changed the reference, and by how much it is away from its source [rad]."""


def filter_stream(lim: Any, r: Any, until: float, bandwidth: float) -> None:
    """Advance the filter of a stream to a time [s]."""
    while r[R_ADVANCED] < until:
        step = min(until - r[R_ADVANCED], LONGEST_FILTER_STEP)
        pole = min(bandwidth, 0.5 / step)
        target = r[R_TARGET] + r[R_SPEED] * (r[R_ADVANCED] - r[R_RECEIVED])
        q, qd = r[R_POSITION], r[R_VELOCITY]
        gap = target - q
        closing = 0.5 * pole * abs(gap)
        # a large gap is closed no faster than the reference can brake
        closing = limited(math.sqrt(lim[L_OWN_PUSH] * abs(gap)), 0.0, closing)
        wanted = r[R_SPEED] + math.copysign(closing, gap)
        qdd = 2.0 * pole * (wanted - qd)
        most = lim[L_OWN_PUSH]
        highest = min(most, (lim[L_VELOCITY] - qd) / step)
        lowest = max(-most, (-lim[L_VELOCITY] - qd) / step)
        allowed = limited(qdd, min(lowest, most), max(highest, -most))
        r[R_CLIPPED] = 1.0 if allowed != qdd else 0.0
        qd += allowed * step
        r[R_POSITION], r[R_VELOCITY], r[R_ACCELERATION] = q + qd * step, qd, allowed
        r[R_ADVANCED] += step


def held_or_streamed(r: Any, time: float) -> State:
    """The source of a joint at a time [s], unless it is a trajectory."""
    if r[R_KIND] == STREAM:
        ahead = time - r[R_ADVANCED]
        return (
            r[R_POSITION] + ahead * (r[R_VELOCITY] + 0.5 * ahead * r[R_ACCELERATION]),
            r[R_VELOCITY] + ahead * r[R_ACCELERATION],
            r[R_ACCELERATION],
        )
    return r[R_HELD], 0.0, 0.0


def in_range(lim: Any, state: State) -> State:
    """The state, or rest at the end of the joint's range that it is beyond."""
    if state[0] < lim[L_LOWER]:
        return lim[L_LOWER], 0.0, 0.0
    if state[0] > lim[L_UPPER]:
        return lim[L_UPPER], 0.0, 0.0
    return state


def have_expired(sources: Any, now: float, timeout: float) -> bool:
    """Whether a stream is too old."""
    for i in range(len(sources)):
        if sources[i][R_KIND] == STREAM and now - sources[i][R_RECEIVED] > timeout:
            return True
    return False


@entry_point
def advance_references(
    now: float, until: float, time: float, oldest: float, timeout: float, bandwidth: float,
    limits: Any, sources: Any, targets: Any, history: Any, ends: Any,
) -> int:  # fmt: skip
    """Advance the streams, and the references of all joints by a step.

    Parameters
    ----------
    now, until : float
        Present time, and until when streams are filtered [s].
    time, oldest : float
        Time of the step; older rows of the history are forgotten, but for two [s].
    timeout, bandwidth : float
        Of streams [s], [rad/s].
    limits, sources, targets : rows
        `L_VELOCITY`, `R_KIND`, `T_POSITION` and their like.
    history : rows
        With room for one more.
    ends : (int, int)
        First row of the history, and how many there are.

    Returns
    -------
    int
        `ADVANCED`; or, with an unchanged history, `EXPIRED` if a stream is too old, or the first
        joint whose `T_SHARE` has to be computed.
    """
    if have_expired(sources, now, timeout):
        return EXPIRED
    for i in range(len(sources)):
        if sources[i][R_KIND] == STREAM:
            filter_stream(limits[i], sources[i], until, bandwidth)
    size = len(history)
    last = history[(ends[0] + ends[1] - 1) % size]
    new = history[(ends[0] + ends[1]) % size]
    step = time - last[0]
    if last[0] == -math.inf:
        last[0] = time
    if not 0.0 < step < math.inf:
        return ADVANCED
    for i in range(len(sources)):
        lim, t, o = limits[i], targets[i], 1 + 3 * i
        if sources[i][R_KIND] == TRAJECTORY:
            target = (t[T_POSITION], t[T_VELOCITY], t[T_ACCELERATION])
        else:
            target = held_or_streamed(sources[i], time)
        target = in_range(lim, target)
        before = (last[o], last[o + 1], last[o + 2])
        planned = sources[i][R_PLANNED] > 0.0
        verdict, state = limited_step(lim, before, target, step, planned, t[T_SHARE])
        if verdict == UNDECIDED:
            t[T_POSITION], t[T_VELOCITY], t[T_ACCELERATION] = target
            return i
        t[T_LIMITED] = 1.0 if verdict == BEYOND else 0.0
        t[T_GAP] = abs(target[0] - state[0])
        new[o], new[o + 1], new[o + 2] = state
    for i in range(len(targets)):
        targets[i][T_SHARE] = math.nan  # of this step
    new[0] = time
    ends[1] += 1
    while ends[1] > 2 and history[(ends[0] + 1) % size][0] < oldest:
        ends[0] = (ends[0] + 1) % size
        ends[1] -= 1
    return ADVANCED


def reference_at(history: Any, ends: Any, joint: int, time: float) -> State:
    """The reference of a joint at a time [s]: at rest before the history, a step on after it."""
    size, o = len(history), 1 + 3 * joint
    later = history[(ends[0] + ends[1] - 1) % size]
    if time >= later[0]:
        ahead = min(time - later[0], LONGEST_STEP)
        return (
            later[o] + ahead * (later[o + 1] + 0.5 * ahead * later[o + 2]),
            later[o + 1] + ahead * later[o + 2],
            later[o + 2],
        )
    for back in range(ends[1] - 2, -1, -1):
        earlier = history[(ends[0] + back) % size]
        if earlier[0] <= time:
            return between(earlier, later, o, time)
        later = earlier
    return later[o], later[o + 1], later[o + 2]


def between(earlier: Any, later: Any, o: int, time: float) -> State:
    """Cubic Hermite interpolation of the position, linear of velocity and acceleration."""
    span = later[0] - earlier[0]
    if span <= 0.0:
        return later[o], later[o + 1], later[o + 2]
    s = (time - earlier[0]) / span
    h = s * s * (3.0 - 2.0 * s)
    tangents = (s * (1.0 - s) ** 2) * earlier[o + 1] - (s * s * (1.0 - s)) * later[o + 1]
    return (
        earlier[o] + h * (later[o] - earlier[o]) + span * tangents,
        earlier[o + 1] + s * (later[o + 1] - earlier[o + 1]),
        earlier[o + 2] + s * (later[o + 2] - earlier[o + 2]),
    )


@entry_point
def sampled(history: Any, ends: Any, joint: int, time: float) -> State:
    """`reference_at` for Python."""
    return reference_at(history, ends, joint, time)


class LimitedReferences:
    """The references of joints.

    Parameters
    ----------
    limits : sequence of MotionLimits
        Of every joint.
    bounds : sequence of (float, float)
        Lowest and highest position of every joint [rad].

    Attributes
    ----------
    limits : list of MotionLimits
        In force.
    rows, sources, history, ends
        What the compiled functions of the control cycle take.
    keep : float
        How long the history reaches back before the last step [s].
    """

    def __init__(
        self, limits: Sequence[MotionLimits], bounds: Sequence[tuple[float, float]]
    ) -> None:
        count = len(limits)
        self._bounds = list(bounds)
        self.limits = list(limits)
        self.keep = KEPT_AT_LEAST
        self.rows = for_kernel(np.zeros((count, N_LIMITS)))
        self.sources = for_kernel(np.zeros((count, N_SOURCE)))
        targets = np.zeros((count, N_TARGET))
        targets[:, T_SHARE] = math.nan
        self._targets = for_kernel(targets)
        self.history = for_kernel(np.zeros((FIRST_SIZE, 1 + 3 * count)))
        self.ends = for_kernel(np.array([0, 1]))
        self.history[0][0] = self._newest = -math.inf
        self._room = 0  # rows for which there is room in the history, at least
        for joint in range(count):
            self.use(joint, limits[joint])
        rows, sources, history, ends = self.rows, self.sources, self.history, self.ends
        numbers = (0.0,) * 6
        prepare(advance_references, *numbers, rows, sources, self._targets, history, ends)
        prepare(sampled, history, ends, 0, 0.0)

    def use(self, joint: int, limits: MotionLimits) -> None:
        """Use other limits from the next step on."""
        self.limits[joint] = limits
        for place, number in enumerate(limits.row(self._bounds[joint])):
            self.rows[joint][place] = number

    def reset(self, joint: int, position: float) -> None:
        """Rest at `position` [rad], now and before."""
        for row in self.history:
            row[1 + 3 * joint] = position
            row[2 + 3 * joint] = row[3 + 3 * joint] = 0.0
        self._targets[joint][T_LIMITED] = self._targets[joint][T_GAP] = 0.0

    def restart(self) -> None:
        """Begin the history anew at the next step."""
        last = self._last
        self.ends[0], self.ends[1] = 0, 1
        self.history[0][:] = last
        self.history[0][0] = self._newest = -math.inf

    @property
    def _last(self) -> Any:
        return self.history[(self.ends[0] + self.ends[1] - 1) % len(self.history)]

    def state(self, joint: int) -> JointReference:
        """The last reference."""
        return JointReference(*map(float, self._last[1 + 3 * joint : 4 + 3 * joint]))

    def is_limited(self, joint: int) -> bool:
        """Whether the last reference differs from its source because of the limits."""
        return bool(self._targets[joint][T_LIMITED] > 0.0)

    def gap(self, joint: int) -> float:
        """Distance between the source and the last reference [rad]."""
        return float(self._targets[joint][T_GAP])

    def sample(self, joint: int, time: float) -> JointReference:
        """The limited reference at `time` [s]: at rest before the history, a step on after it."""
        return JointReference(*sampled(self.history, self.ends, joint, time))

    def advance(
        self,
        now: float,
        until: float,
        timeout: float,
        bandwidth: float,
        trajectories: Sequence[tuple[int, Callable[[float], JointReference]]],
    ) -> bool:
        """Follow the sources; return False, without a change, if a stream is too old.

        Parameters
        ----------
        now, until : float
            Present time, and until when the sources are followed [s]; an earlier time than before
            changes nothing.
        timeout, bandwidth : float
            Of streams [s], [rad/s].
        trajectories : sequence of (int, callable)
            The joints that follow one, and its state at a time [s].
        """
        targets, oldest = self._targets, until - self.keep
        while True:
            left, time = until - self._newest, until
            if 1.5 * LONGEST_STEP <= left < math.inf:
                time = self._newest + LONGEST_STEP
            # else a remainder of rounding would be a step of no length
            for joint, source in trajectories:
                state, target = source(time), targets[joint]
                target[T_POSITION], target[T_VELOCITY], target[T_ACCELERATION] = (
                    state.position, state.velocity, state.acceleration,
                )  # fmt: skip
            self._make_room()
            arguments = (
                now, until, time, oldest, timeout, bandwidth, self.rows, self.sources, targets,
                self.history, self.ends,
            )  # fmt: skip
            while (found := advance_references(*arguments)) >= 0:
                self._share(found, time)
            if found == EXPIRED:
                return False
            self._newest = max(self._newest, time)
            if self._newest >= until:
                return True

    def _share(self, joint: int, time: float) -> None:
        """Compute `T_SHARE` of a joint for a step to a time [s]."""
        target, last = self._targets[joint], self._last
        state = JointReference(
            float(target[T_POSITION]), float(target[T_VELOCITY]), float(target[T_ACCELERATION])
        )
        push = (state.acceleration - float(last[3 + 3 * joint])) / (time - float(last[0]))
        target[T_SHARE] = self.limits[joint].share(state, push)

    def _make_room(self) -> None:
        """Let there be room for one row more in the history."""
        self._room -= 1
        if self._room <= 0:
            self._room = len(self.history) - int(self.ends[1])
            if self._room == 0:
                self._grow()

    def _grow(self) -> None:
        """Double the room of the history."""
        first, count = int(self.ends[0]), int(self.ends[1])
        rows = np.array(self.history)
        rows = np.concatenate((rows[first:], rows[:first], np.zeros_like(rows)))
        self.history, self.ends = for_kernel(rows), for_kernel(np.array([0, count]))
        self._room = len(rows) - count
