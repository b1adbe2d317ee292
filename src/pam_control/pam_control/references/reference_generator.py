"""The reference of each joint at and near the present time: trajectory, stream or hold.

For each joint, the latest command replaces the one before. If a stream stops, the joint brakes and
holds after a time-out. Streamed positions pass a critically damped second-order filter, because the
feedforward needs a velocity and an acceleration. If velocities are streamed as well, they
compensate the filter's lag.

Every reference keeps the joint's limits of speed and acceleration: a trajectory is scaled in time
when it arrives, and whatever remains (a streamed step, a stop) passes a limiter, which
runs ahead by `horizon`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from pam_control.limited import limited
from pam_control.references.joined_trajectory import joined
from pam_control.references.limited_references import (
    HOLD,
    R_ADVANCED,
    R_CLIPPED,
    R_HELD,
    R_KIND,
    R_PLANNED,
    R_POSITION,
    R_RECEIVED,
    R_SPEED,
    R_TARGET,
    R_VELOCITY,
    STREAM,
    TRAJECTORY,
    LimitedReferences,
    held_or_streamed,
    in_range,
)
from pam_control.references.motion_limiter import NO_LIMITS, MotionLimits
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

RESUMED_WITHIN = 0.05  # rad


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
        self._places = {name: place for place, name in enumerate(limits)}
        self._splines: dict[str, JointSpline] = {}  # of the joints that follow one
        self._heard: dict[str, float] = {}  # time of the last streamed command
        self._interrupted: set[str] = set()  # joints whose stream must not simply go on
        self.limited_references = LimitedReferences(
            [self.motion.get(name, NO_LIMITS) for name in limits], list(self.limits.values())
        )

    def keep(self, duration: float) -> None:
        """Keep the references of this time [s] before the present for `sample`."""
        self.limited_references.keep = self.horizon + duration

    def limit(self, name: str, motion: MotionLimits) -> None:
        """Use other limits of motion for a joint from the next reference on."""
        self.motion[name] = motion
        self.limited_references.use(self._places[name], motion)

    def hold(self, positions: Mapping[str, float]) -> None:
        """Rest at these positions [rad], limited to the range, whatever the references were."""
        for name, position in positions.items():
            held = limited(position, *self.limits[name])
            self._hold(name, held)
            self.limited_references.reset(self._places[name], held)
        if len(positions) == len(self.limits):
            self.limited_references.restart()

    def _hold(self, name: str, position: float) -> None:
        """Let a joint's source be a position [rad], at which a stream must not simply go on."""
        self._splines.pop(name, None)
        source = self._source_of(name)
        source[R_KIND], source[R_HELD], source[R_PLANNED] = HOLD, position, 0.0
        source[R_CLIPPED] = 0.0
        self._interrupted.add(name)

    def _source_of(self, name: str) -> Any:
        return self.limited_references.sources[self._places[name]]

    def speed(self, name: str) -> float:
        """The speed of a joint's newest reference [rad/s]; 0 for a joint without limits."""
        if name not in self.motion:
            return 0.0
        return abs(self.limited_references.state(self._places[name]).velocity)

    def lead(self, name: str, position: float) -> None:
        """Hold a joint at a position [rad] that its law moves from cycle to cycle."""
        self._hold(name, limited(position, *self.limits[name]))

    def stop(self, names: Sequence[str], now: float) -> None:
        """Brake with the joint's limit of acceleration and hold; without limits at once.

        Parameters
        ----------
        names : sequence of str
            Joints; empty for all.
        now : float
            Present time [s].
        """
        for name in names or self.limits:
            if name in self.motion:
                state = self.limited_references.state(self._places[name])
                held = self.motion[name].rest(state)
            else:
                held = self.sample(name, now).position
            self._hold(name, limited(held, *self.limits[name]))

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
            self.stop([name for name in names if name in self.limits], now)
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
            source = self._source_of(name)
            source[R_KIND], source[R_HELD] = TRAJECTORY, spline.end_position
            source[R_PLANNED], source[R_CLIPPED] = float(planned), 0.0
            self._splines[name] = spline

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
            source = self._source_of(name)
            if source[R_KIND] != STREAM:
                start = now + self.horizon
                state = self.sample(name, start)
                self._splines.pop(name, None)
                source[R_POSITION : R_ADVANCED + 1] = [
                    state.position, state.velocity, state.acceleration, start,
                ]  # fmt: skip
                source[R_KIND], source[R_PLANNED], source[R_CLIPPED] = STREAM, 0.0, 0.0
                source[R_HELD] = state.position
            source[R_TARGET], source[R_RECEIVED] = positions[index], now
            source[R_SPEED] = velocities[index] if len(velocities) else 0.0

    def refused_stream(self, names: Sequence[str], now: float) -> None:
        """Note a streamed command at `now` [s] that was refused because nothing may move.

        The stream may not move a joint later, just because it continues; see `_check_continued`.
        """
        for name in names:
            if name in self.limits:
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
        if self._advance(now):
            return []
        expired = [
            name
            for name, source in zip(self.limits, self.limited_references.sources, strict=True)
            if source[R_KIND] == STREAM and now - source[R_RECEIVED] > self.stream_timeout
        ]
        self.stop(expired, now)
        self._advance(now)
        return expired

    def _advance(self, now: float) -> bool:
        """Advance to `now` [s] and the horizon, unless a stream has timed out."""
        return self.limited_references.advance(
            now,
            now + self.horizon,
            self.stream_timeout,
            self.stream_bandwidth,
            [(self._places[name], spline.sample) for name, spline in self._splines.items()],
        )

    def sample(self, name: str, time: float) -> JointReference:
        """The reference of a joint at `time` [s], which may be slightly before or after now."""
        place = self._places[name]
        if name in self.motion:
            return self.limited_references.sample(place, time)
        spline = self._splines.get(name)
        if spline is None:
            state = held_or_streamed(self._source_of(name), time)
        else:
            reference = spline.sample(time)
            state = reference.position, reference.velocity, reference.acceleration
        return JointReference(*in_range(self.limited_references.rows[place], state))

    def limited(self, name: str) -> bool:
        """Whether the reference differs from what was asked for because of the limits of motion."""
        if self._source_of(name)[R_CLIPPED] > 0.0:
            return True
        return name in self.motion and self.limited_references.is_limited(self._places[name])

    def held_back(self, name: str) -> bool:
        """Whether the limits of motion keep the reference away from what was asked for.

        The steps of a stream are always rounded; that alone, and the lag of its filter, are none.
        """
        if not self.limited(name):
            return False
        source, place = self._source_of(name), self._places[name]
        if source[R_KIND] != STREAM:
            return name in self.motion and self.limited_references.gap(place) > RESUMED_WITHIN
        position, velocity = float(source[R_POSITION]), float(source[R_VELOCITY])
        if name in self.motion:
            state = self.limited_references.state(place)
            position, velocity = state.position, state.velocity
        asked = source[R_TARGET] + source[R_SPEED] * (source[R_ADVANCED] - source[R_RECEIVED])
        lag = 2.0 * abs(velocity) / self.stream_bandwidth
        away = abs(limited(float(asked), *self.limits[name]) - position)
        return away > RESUMED_WITHIN + lag

    def following(self, name: str) -> str:
        """The joint's present source: "trajectory", "stream" or "hold"."""
        if name in self._splines:
            return "trajectory"
        return "stream" if self._source_of(name)[R_KIND] == STREAM else "hold"

    def spline(self, name: str) -> JointSpline | None:
        """The joint's trajectory; None if it follows none."""
        return self._splines.get(name)

    def follows(self, name: str, spline: JointSpline) -> bool:
        """Whether this spline is still the joint's source."""
        return self._splines.get(name) is spline
