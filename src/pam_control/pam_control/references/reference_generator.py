"""The reference of each joint at and near the present time: trajectory, stream or hold.

For each joint, the latest command replaces the one before. If a stream stops, the joint holds its
last reference after a time-out. Streamed positions pass a critically damped second-order filter,
because the feedforward needs a velocity and an acceleration. If velocities are streamed as well,
they compensate the filter's lag.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pam_control.references.trajectory import (
    LARGEST,
    CommandError,
    JointReference,
    JointSpline,
    TrajectoryPoint,
    check_trajectory,
    splines_from_points,
)

LONGEST_FILTER_STEP = 0.02


@dataclass(slots=True)
class _Stream:
    """A filtered stream: the last commanded target, and the state of the filter."""

    target: float
    velocity: float
    received: float
    state: JointReference
    advanced: float


@dataclass(slots=True)
class _Source:
    """The present source of one joint; if stream and spline are None, the joint holds."""

    held: float
    spline: JointSpline | None = None
    stream: _Stream | None = field(default=None)


class ReferenceGenerator:
    """References of all joints.

    Parameters
    ----------
    limits : mapping of str to (float, float)
        Position limits [rad] of every joint, in the rig's order.
    stream_timeout : float
        Age at which a streamed command expires [s].
    stream_bandwidth : float
        Bandwidth of the filter for streamed commands [rad/s].
    """

    def __init__(
        self,
        limits: Mapping[str, tuple[float, float]],
        *,
        stream_timeout: float = 0.2,
        stream_bandwidth: float = 40.0,
    ) -> None:
        self.limits = dict(limits)
        self.stream_timeout = stream_timeout
        self.stream_bandwidth = stream_bandwidth
        self.allow_nonzero_end_velocity = False
        self._sources = {name: _Source(held=0.0) for name in limits}

    def hold(self, positions: Mapping[str, float]) -> None:
        """Stop all present references and hold these positions [rad], limited to the range."""
        for name, position in positions.items():
            lower, upper = self.limits[name]
            self._sources[name] = _Source(held=max(lower, min(upper, position)))

    def follow(
        self,
        names: Sequence[str],
        points: Sequence[TrajectoryPoint],
        *,
        start: float | None,
        now: float,
    ) -> None:
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

        Raises
        ------
        CommandError
            When the trajectory is rejected; the present reference is kept.
        """
        if not points:
            stopped = [name for name in names if name in self._sources] or list(self._sources)
            self.hold({name: self.sample(name, now).position for name in stopped})
            return
        check_trajectory(
            names,
            points,
            self.limits,
            allow_nonzero_end_velocity=self.allow_nonzero_end_velocity,
        )
        references = {name: self.sample(name, now) for name in names}
        splines = splines_from_points(
            names, points, start=now if start is None else start, now=now, references=references
        )
        for name, spline in splines.items():
            self._sources[name] = _Source(held=spline.sample(math.inf).position, spline=spline)

    def stream(
        self,
        names: Sequence[str],
        positions: Sequence[float],
        velocities: Sequence[float] = (),
        *,
        now: float,
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

        Raises
        ------
        CommandError
            When the message is rejected: an unknown joint, a wrong size, a number that is not
            finite or a position outside the limits.
        """
        self._check_stream(names, positions, velocities)
        for index, name in enumerate(names):
            source = self._sources[name]
            velocity = velocities[index] if len(velocities) else 0.0
            if source.stream is None:
                state = self.sample(name, now)
                source = _Source(
                    held=state.position,
                    stream=_Stream(positions[index], velocity, now, state, now),
                )
                self._sources[name] = source
            else:
                stream = source.stream
                stream.target, stream.velocity, stream.received = positions[index], velocity, now

    def _check_stream(
        self, names: Sequence[str], positions: Sequence[float], velocities: Sequence[float]
    ) -> None:
        what = "streamed command rejected"
        if not names or len(positions) != len(names) or len(velocities) not in (0, len(names)):
            raise CommandError(
                f"{what}: {len(names)} names, {len(positions)} positions, "
                f"{len(velocities)} velocities"
            )
        if len(set(names)) != len(names):
            raise CommandError(f"{what}: a joint is named twice")
        for index, name in enumerate(names):
            if name not in self.limits:
                raise CommandError(
                    f"{what}: unknown joint {name!r}; known: {', '.join(self.limits)}"
                )
            lower, upper = self.limits[name]
            position = positions[index]
            velocity = velocities[index] if len(velocities) else 0.0
            if not (math.isfinite(position) and math.isfinite(velocity)):
                raise CommandError(f"{what}: {name} at {position} rad, {velocity} rad/s")
            if abs(velocity) > LARGEST["velocities"]:
                raise CommandError(
                    f"{what}: {name} at {velocity:g} rad/s, expected "
                    f"{LARGEST['velocities']:g} rad/s at most"
                )
            if not lower <= position <= upper:
                raise CommandError(
                    f"{what}: {name} at {position:g} rad is outside its position_limits "
                    f"[{lower:g}, {upper:g}] rad"
                )

    def advance(self, now: float) -> list[str]:
        """Advance the stream filters to `now` [s]; return the joints whose stream timed out."""
        expired = []
        for name, source in self._sources.items():
            stream = source.stream
            if stream is None:
                continue
            if now - stream.received > self.stream_timeout:
                expired.append(name)
                lower, upper = self.limits[name]
                self._sources[name] = _Source(held=max(lower, min(upper, stream.state.position)))
                continue
            while stream.advanced < now:
                step = min(now - stream.advanced, LONGEST_FILTER_STEP)
                self._filter(stream, step)
                stream.advanced += step
        return expired

    def _filter(self, stream: _Stream, step: float) -> None:
        bandwidth = min(self.stream_bandwidth, 0.5 / step)
        target = stream.target + stream.velocity * (stream.advanced - stream.received)
        q, qd = stream.state.position, stream.state.velocity
        qdd = bandwidth * (bandwidth * (target - q) + 2.0 * (stream.velocity - qd))
        qd += qdd * step
        stream.state = JointReference(q + qd * step, qd, qdd)

    def sample(self, name: str, time: float) -> JointReference:
        """The reference of a joint at `time` [s], which may be slightly before or after now."""
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

    def following(self, name: str) -> str:
        """The joint's present source: "trajectory", "stream" or "hold"."""
        source = self._sources[name]
        if source.spline is not None:
            return "trajectory"
        return "stream" if source.stream is not None else "hold"
