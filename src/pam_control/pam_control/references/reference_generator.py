"""The reference of each joint at and near the present time: trajectory, stream or hold.

For each joint, the latest command replaces the one before. If a stream stops, the joint brakes and
holds after a time-out. Streamed positions pass a critically damped second-order filter, because the
feedforward needs a velocity and an acceleration. If velocities are streamed as well, they
compensate the filter's lag.

Every reference keeps the joint's limits of speed and acceleration: a trajectory is scaled in time
when it arrives, and whatever remains (a streamed step, a corner, a stop) passes a limiter, which
runs ahead by `horizon`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

from pam_control.limited import limited
from pam_control.references.joined_trajectory import joined
from pam_control.references.motion_limiter import MotionLimiter, MotionLimits
from pam_control.references.planned_trajectory import PlannedTrajectory, plan
from pam_control.references.spline import JointReference, JointSpline
from pam_control.references.streamed_command import check_streamed_command
from pam_control.references.trajectory import (
    LATEST_START,
    START_MARGIN,
    CommandError,
    TrajectoryPoint,
    check_trajectory,
)
from pam_model.within_limits import within

LONGEST_FILTER_STEP = 0.02
RESUMED_WITHIN = 0.05  # rad


@dataclass(slots=True)
class _Stream:
    """A filtered stream: the last commanded target, and the state of the filter."""

    target: float
    velocity: float
    received: float
    state: JointReference
    advanced: float
    limited: bool = False


@dataclass(slots=True)
class _Source:
    """The present source of one joint; if stream and spline are None, the joint holds."""

    held: float
    spline: JointSpline | None = None
    stream: _Stream | None = field(default=None)
    planned: bool = False  # a trajectory that stays inside the range


class ReferenceGenerator:
    """References of all joints.

    Parameters
    ----------
    limits : mapping of str to (float, float)
        Position limits [rad] of every joint, in the rig's order.
    motion : mapping of str to MotionLimits, optional
        Limits of speed and acceleration; a joint without them is not limited.
    max_velocities : mapping of str to float, optional
        Speed [rad/s] above which a waypoint is refused, by joint.
    start_margin : float, optional
        How far the driver permits a joint beyond its position limits [rad].
    stream_timeout : float
        Age at which a streamed command expires [s].
    stream_bandwidth : float
        Bandwidth of the filter for streamed commands [rad/s].

    Attributes
    ----------
    horizon : float
        How far ahead of the present time references are needed [s].
    """

    def __init__(
        self,
        limits: Mapping[str, tuple[float, float]],
        motion: Mapping[str, MotionLimits] | None = None,
        *,
        max_velocities: Mapping[str, float] | None = None,
        start_margin: float = START_MARGIN,
        stream_timeout: float = 0.2,
        stream_bandwidth: float = 40.0,
    ) -> None:
        self.limits = dict(limits)
        self.motion = dict(motion or {})
        self.max_velocities = dict(max_velocities or {})
        self._start_margin = start_margin
        self.stream_timeout = stream_timeout
        self.stream_bandwidth = stream_bandwidth
        self.allow_nonzero_end_velocity = False
        self.horizon = 0.0
        self._sources = {name: _Source(held=0.0) for name in limits}
        self._heard: dict[str, float] = {}  # time of the last streamed command
        self._interrupted: set[str] = set()  # joints whose stream must not simply go on
        self._limiters = {
            name: MotionLimiter(motion, limits[name]) for name, motion in self.motion.items()
        }
        for limiter in self._limiters.values():
            limiter.reset(0.0)

    def keep(self, duration: float) -> None:
        """Keep the references of this time [s] before the present for `sample`."""
        for limiter in self._limiters.values():
            limiter.keep = self.horizon + duration

    def limit(self, name: str, motion: MotionLimits) -> None:
        """Use other limits of motion for a joint from the next reference on."""
        self.motion[name] = motion
        self._limiters[name].limits = motion

    def hold(self, positions: Mapping[str, float]) -> None:
        """Rest at these positions [rad], limited to the range, whatever the references were."""
        for name, position in positions.items():
            lower, upper = self.limits[name]
            held = max(lower, min(upper, position))
            self._sources[name] = _Source(held=held)
            self._interrupted.add(name)
            if name in self._limiters:
                self._limiters[name].reset(held)

    def speed(self, name: str) -> float:
        """The speed of a joint's newest reference [rad/s]; 0 for a joint without limits."""
        limiter = self._limiters.get(name)
        return 0.0 if limiter is None else abs(limiter.state.velocity)

    def lead(self, name: str, position: float) -> None:
        """Hold a joint at a position [rad] that its law moves from cycle to cycle."""
        lower, upper = self.limits[name]
        self._sources[name] = _Source(held=max(lower, min(upper, position)))
        self._interrupted.add(name)

    def stop(self, names: Sequence[str], now: float) -> None:
        """Brake with the joint's limit of acceleration and hold; without limits at once.

        Parameters
        ----------
        names : sequence of str
            Joints; empty for all.
        now : float
            Present time [s].
        """
        for name in names or self._sources:
            lower, upper = self.limits[name]
            limiter = self._limiters.get(name)
            if limiter is None:
                held = self.sample(name, now).position
            else:
                held = limiter.limits.rest(limiter.state)
            self._sources[name] = _Source(held=max(lower, min(upper, held)))
            self._interrupted.add(name)

    def follow(
        self,
        names: Sequence[str],
        points: Sequence[TrajectoryPoint],
        *,
        start: float | None,
        now: float,
    ) -> str:
        """Follow a trajectory instead of the present reference; without points, stop and hold.

        Parameters
        ----------
        names : sequence of str
            Some or all joints of the rig.
        points : sequence of TrajectoryPoint
            As in the message.
        start : float or None
            Time at which time_from_start is zero [s]; None for the present time.
        now : float
            Present time [s].

        Returns
        -------
        str
            How much slower than asked the trajectory is played, and why; empty if it is not.

        Raises
        ------
        CommandError
            When the trajectory is rejected; the present reference is kept.
        """
        planned = self.plan(names, points, start=start, now=now)
        if planned is None:
            self.stop([name for name in names if name in self._sources], now)
            return ""
        references = self.references_at_join(planned, now)
        splines, note = self.join(planned, references, now)
        self.take(splines)
        return note

    # The four steps of `follow`. The first and the third may take long and change nothing, so that
    # they need no lock; the second and the fourth are short.

    def plan(
        self,
        names: Sequence[str],
        points: Sequence[TrajectoryPoint],
        *,
        start: float | None,
        now: float,
        measured: Mapping[str, float] | None = None,
    ) -> PlannedTrajectory | None:
        """Check a trajectory and scale it to the limits; None if it has no points.

        `measured` says where the joints are [rad], as far as that is known.
        """
        if not points:
            return None
        check_trajectory(
            names,
            points,
            self.limits,
            max_velocities=self.max_velocities,
            allow_nonzero_end_velocity=self.allow_nonzero_end_velocity,
            measured=measured,
            start_margin=self._start_margin,
        )
        begin = now if start is None else start
        if begin - now > LATEST_START:
            raise CommandError(
                f"trajectory rejected: its stamp is {begin - now:.3g} s in the future, expected "
                f"{LATEST_START:g} s at most; compare the clocks of its sender and this computer"
            )
        return plan(names, points, start=begin, now=now, limits=self.motion, bounds=self.limits)

    def references_at_join(
        self, planned: PlannedTrajectory, now: float
    ) -> dict[str, JointReference]:
        """The references at the time from which a trajectory can act."""
        return {name: self.sample(name, now + self.horizon) for name in planned.waypoints}

    def join(
        self, planned: PlannedTrajectory, references: Mapping[str, JointReference], now: float
    ) -> tuple[dict[str, JointSpline], str]:
        """Splines from these references through a planned trajectory, and a note for the caller."""
        at = now + self.horizon
        return joined(planned, now=now, at=at, references=references, limits=self.motion)

    def take(self, splines: Mapping[str, JointSpline]) -> None:
        """Follow these splines from now on."""
        for name, spline in splines.items():
            lower, upper = self.limits[name]
            planned = within(spline.lowest, lower, upper) and within(spline.highest, lower, upper)
            self._sources[name] = _Source(spline.end_position, spline, planned=planned)

    def stream(
        self,
        names: Sequence[str],
        positions: Sequence[float],
        velocities: Sequence[float] = (),
        *,
        now: float,
        measured: Mapping[str, float] | None = None,
    ) -> None:
        """Take streamed references for some or all joints.

        Parameters
        ----------
        names : sequence of str
            Names of the joints.
        positions, velocities : sequence of float
            [rad], [rad/s]; velocities may be empty.
        now : float
            Present time [s].
        measured : mapping of str to float, optional
            Where the joints are [rad], as far as that is known.

        Raises
        ------
        CommandError
            When the message is rejected: an unknown joint, a wrong size, a number that is not
            finite or a position outside the limits.
        """
        check_streamed_command(
            names,
            positions,
            velocities,
            self.limits,
            self.max_velocities,
            measured or {},
            self._start_margin,
        )
        positions = [
            limited(position, *self.limits[name])
            for name, position in zip(names, positions, strict=True)
        ]
        self._check_continued(names, positions, now)
        for index, name in enumerate(names):
            source = self._sources[name]
            velocity = velocities[index] if len(velocities) else 0.0
            if source.stream is None:
                start = now + self.horizon
                state = self.sample(name, start)
                source = _Source(
                    held=state.position,
                    stream=_Stream(positions[index], velocity, now, state, start),
                )
                self._sources[name] = source
            else:
                stream = source.stream
                stream.target, stream.velocity, stream.received = positions[index], velocity, now

    def refused_stream(self, names: Sequence[str], now: float) -> None:
        """Note a streamed command at `now` [s] that was refused because nothing may move.

        The stream may not move a joint later, just because it continues; see `_check_continued`.
        """
        for name in names:
            if name in self._sources:
                self._heard[name] = now
                self._interrupted.add(name)

    def _check_continued(
        self, names: Sequence[str], positions: Sequence[float], now: float
    ) -> None:
        """Refuse a stream that was interrupted and continues as if nothing had happened.

        After a stop, a vent or a refusal a joint moves only on a new request. A stream is a new one
        after a pause of the stream time-out; or it has to come to where the joint is.
        """
        far = [
            name
            for name, position in zip(names, positions, strict=True)
            if name in self._interrupted
            and now - self._heard.get(name, -math.inf) <= self.stream_timeout
            and abs(position - self.sample(name, now).position) > RESUMED_WITHIN
        ]
        for name in names:
            self._heard[name] = now
        if far:
            raise CommandError(
                f"streamed command rejected: the stream began before {', '.join(far)} stopped; "
                f"pause it for {self.stream_timeout:g} s, or send a position within "
                f"{RESUMED_WITHIN:g} rad of the present one"
            )
        self._interrupted.difference_update(names)

    def advance(self, now: float) -> list[str]:
        """Advance to `now` [s] and the horizon; return the joints whose stream timed out."""
        expired = []
        until = now + self.horizon
        for name, source in self._sources.items():
            stream = source.stream
            if stream is not None and now - stream.received > self.stream_timeout:
                expired.append(name)
                self.stop([name], now)
            elif stream is not None:
                while stream.advanced < until:
                    step = min(until - stream.advanced, LONGEST_FILTER_STEP)
                    self._filter(name, stream, step)
                    stream.advanced += step
        for name, limiter in self._limiters.items():
            limiter.advance(until, partial(self._source, name), self._sources[name].planned)
        return expired

    def _filter(self, name: str, stream: _Stream, step: float) -> None:
        bandwidth = min(self.stream_bandwidth, 0.5 / step)
        target = stream.target + stream.velocity * (stream.advanced - stream.received)
        q, qd = stream.state.position, stream.state.velocity
        motion = self.motion.get(name)
        gap = target - q
        closing = 0.5 * bandwidth * abs(gap)
        if motion is not None:  # a large gap is closed no faster than the reference can brake
            closing = min(closing, math.sqrt(motion.own_push * abs(gap)))
        wanted = stream.velocity + math.copysign(closing, gap)
        qdd = 2.0 * bandwidth * (wanted - qd)
        stream.limited = False
        if motion is not None:
            most = motion.own_push
            highest = min(most, (motion.velocity - qd) / step)
            lowest = max(-most, (-motion.velocity - qd) / step)
            allowed = limited(qdd, min(lowest, most), max(highest, -most))
            stream.limited, qdd = allowed != qdd, allowed
        qd += qdd * step
        stream.state = JointReference(q + qd * step, qd, qdd)

    def sample(self, name: str, time: float) -> JointReference:
        """The reference of a joint at `time` [s], which may be slightly before or after now."""
        limiter = self._limiters.get(name)
        return self._source(name, time) if limiter is None else limiter.sample(time)

    def _source(self, name: str, time: float) -> JointReference:
        """The reference before its limits of speed and acceleration."""
        source = self._sources[name]
        lower, upper = self.limits[name]
        if source.spline is not None:
            reference = source.spline.sample(time)
        elif source.stream is not None:
            state, ahead = source.stream.state, time - source.stream.advanced
            reference = JointReference(
                state.position + ahead * (state.velocity + 0.5 * ahead * state.acceleration),
                state.velocity + ahead * state.acceleration,
                state.acceleration,
            )
        else:
            reference = JointReference(source.held)
        if reference.position < lower:
            return JointReference(lower)
        if reference.position > upper:
            return JointReference(upper)
        return reference

    def limited(self, name: str) -> bool:
        """Whether the reference differs from what was asked for because of the limits of motion."""
        stream = self._sources[name].stream
        limiter = self._limiters.get(name)
        return (stream is not None and stream.limited) or (limiter is not None and limiter.limited)

    def held_back(self, name: str) -> bool:
        """Whether the limits of motion keep the reference away from what was asked for.

        The steps of a stream are always rounded; that alone, and the lag of its filter, are none.
        """
        if not self.limited(name):
            return False
        source, limiter = self._sources[name], self._limiters.get(name)
        stream = source.stream
        if stream is None:
            return limiter is not None and limiter.gap > RESUMED_WITHIN
        state = stream.state if limiter is None else limiter.state
        asked = stream.target + stream.velocity * (stream.advanced - stream.received)
        lag = 2.0 * abs(state.velocity) / self.stream_bandwidth
        return abs(limited(asked, *self.limits[name]) - state.position) > RESUMED_WITHIN + lag

    def following(self, name: str) -> str:
        """The joint's present source: "trajectory", "stream" or "hold"."""
        source = self._sources[name]
        if source.spline is not None:
            return "trajectory"
        return "stream" if source.stream is not None else "hold"

    def spline(self, name: str) -> JointSpline | None:
        """The joint's trajectory; None if it follows none."""
        return self._sources[name].spline

    def follows(self, name: str, spline: JointSpline) -> bool:
        """Whether this spline is still the joint's source."""
        return self._sources[name].spline is spline
