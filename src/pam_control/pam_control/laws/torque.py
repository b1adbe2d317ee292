"""Torque and stiffness of each joint, for whole-body control.

The joint's inverse at the measured angle turns the torque and the stiffness into two pressures, so
that the muscles are sources of torque. A planner gives everything: gravity, inertia, friction.
Torques come as a stream. Until the first one, and `stream.timeout` after the last one, the joint is
held by the position law, from rest or by braking.

The pressures follow the torque and the joint's motion ahead by the known delays. An unknown
delay or lag T is not compensated: the muscles then seem to have the damping K T.

Limits that hold whatever a planner asks for: the torque is limited to accelerations from which
the valves can bring the joint to rest before the end of its range, and below 60 % of
`max_velocity`, by the rig file. Torques that the muscles cannot give are limited to what they can.
The telemetry contains both.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Final

from pam_control.control_step import ControlOutput, Measurement, PlanRequest, PressurePlan
from pam_control.feedback.gain_schedule import GainSchedule
from pam_control.feedback.kept_designs import KeptDesigns
from pam_control.feedback.linear_joint import LoopStructure, OperatingPoint
from pam_control.feedback.margins import ControlDesignError, LoopCase, Margins
from pam_control.feedback.operating_points import operating_grid
from pam_control.feedback.pid import PidGains
from pam_control.laws.position_stiffness import PositionStiffnessController
from pam_control.references.spline import JointReference
from pam_control.references.trajectory import CommandError
from pam_control.settings import ControlSettings
from pam_model.rig import Rig

END_ZONE: Final = 0.1  # rad; so far from the end of the range the limit begins to act
REACTION: Final = 0.03  # s, until a changed torque acts
SMOOTHING: Final = 0.01  # s
SLOW_SWING: Final = 0.5  # Hz


class TorqueController(PositionStiffnessController):
    """The law of the module's docstring."""

    has_observer = False
    has_adaptation = False

    def __init__(
        self, rig: Rig, settings: ControlSettings, designs: KeptDesigns | None = None
    ) -> None:
        self._torques: list[float] = []
        self._heard = -math.inf
        self._before = [(math.nan, 0.0)] * len(rig.joints)
        super().__init__(rig, settings, designs)

    def check(self, settings: ControlSettings) -> list[list[Margins]]:
        """The margins of the position law; the muscles alone must be stable, too.

        A horizontal or inverted joint drifts or falls under a constant torque whatever its muscles
        do; whoever sends the torques must prevent that. So its weight counts at least as much
        as a spring on which the joint swings slowly.

        Raises
        ------
        ControlDesignError
            When a loop is not safe.
        """
        found = super().check(settings)
        for channel in self.channels:
            none = GainSchedule.constant(PidGains(0.0, 0.0, 0.0, settings.derivative_filter))
            gain = settings.pressure_gain or 0.0
            grid = channel.scale.complete(settings).stiffness_grid
            cases = [
                LoopCase(
                    _on_a_spring(point, channel.dynamics.gravity_stiffness(point.position)),
                    LoopStructure(gain, point.per_torque, point.per_position, True),
                )
                for _, point in operating_grid(channel.joint, channel.model, grid)
            ]
            if not all(self.designs.stable(cases, self.timing(channel, settings), none)):
                raise ControlDesignError(
                    f"{channel.joint.name}: as a source of torque, its muscles are unstable with "
                    f"pressure loops of {gain:g} 1/s; a lower pressure_loop.gain may be stable"
                )
        return found

    def set_torques(self, values: Sequence[float], now: float) -> None:
        """Take the torque of every joint [N m].

        Raises
        ------
        CommandError
            For a wrong size or a value that is not finite; nothing is changed.
        """
        if len(values) != len(self.channels):
            raise CommandError(
                f"torque command rejected: {len(values)} values for {len(self.channels)} joints"
            )
        for channel, value in zip(self.channels, values, strict=True):
            if not math.isfinite(value):
                raise CommandError(f"torque command rejected: {channel.joint.name} at {value} N m")
        self._torques, self._heard = [float(value) for value in values], now

    def stop(self, now: float) -> None:
        """Brake all joints and hold them; the next torque moves them again."""
        self._heard = -math.inf
        super().stop(now)

    def lower(self, now: float) -> None:
        """Brake all joints, let their air out slowly, then stop."""
        self._heard = -math.inf
        super().lower(now)

    def deactivate(self) -> None:
        """Stop; torques from before do not move the joint later."""
        self._heard = -math.inf
        super().deactivate()

    def step(self, time: float, measurement: Measurement) -> ControlOutput:
        """One control cycle."""
        by_torque = time - self._heard <= self.settings.stream_timeout
        for index, channel in enumerate(self.channels):
            if by_torque and self.active and not math.isnan(channel.position):
                self.references.lead(channel.joint.name, channel.inside(channel.position))
            elif channel.yields:  # the stream has ended
                self.references.stop([channel.joint.name], time)
                self._begin(index, channel, channel.position, channel.desired)
            channel.yields = channel.driven = by_torque
            if not by_torque:
                self._before[index] = (math.nan, 0.0)
        return super().step(time, measurement)

    def _plan(self, request: PlanRequest) -> PressurePlan:
        channel = request.channel
        if not channel.yields:
            return super()._plan(request)
        settings, telemetry = channel.scale.complete(self.settings), channel.telemetry
        reach = min(settings.stiffness_rate, channel.joint.max_stiffness_rate) * request.step
        change = self.stiffness_commands[request.index] - telemetry.stiffness
        stiffness = telemetry.stiffness + max(-reach, min(reach, change))
        asked = self._torques[request.index]
        torque = self._limited(request, asked)
        ahead = request.acts_at - request.measured_at
        slope = self._slope(request.index, torque, request.step)
        position = channel.inside(channel.position)
        later = channel.inside(position + ahead * channel.velocity)
        reached = channel.model.pressures_for(torque, stiffness, position)
        then = channel.model.pressures_for(torque + ahead * slope, stiffness, later)
        channel.pid.reset(0.0)
        channel.plans.clear()
        telemetry.torque, telemetry.stiffness = torque, stiffness
        telemetry.torque_reached = reached.torque
        telemetry.stiffness_reached = reached.stiffness
        told = (
            ("torque", reached.torque_limited or torque != asked),
            ("stiffness", reached.stiffness_limited),
        )
        telemetry.clipped = tuple(name for name, limited in told if limited)
        first, second = then.agonist - reached.agonist, then.antagonist - reached.antagonist
        measured = (channel.velocity, channel.velocity)
        return PressurePlan(
            (reached.agonist, reached.antagonist),
            (first / ahead, second / ahead),
            (first, second),
            measured,
            0.0,
        )

    def _slope(self, index: int, torque: float, step: float) -> float:
        """Rate of a joint's torque [N m/s], smoothed because torques come in steps."""
        before, slope = self._before[index]
        if not math.isnan(before):
            weight = step / (SMOOTHING + step)
            slope += weight * ((torque - before) / step - slope)
        self._before[index] = (torque, slope)
        return slope

    def _limited(self, request: PlanRequest, torque: float) -> float:
        """The torque [N m] that keeps the joint below its speed and inside its range."""
        channel, dynamics = request.channel, request.channel.dynamics
        limits = self.references.motion[channel.joint.name]
        position, speed = channel.position, channel.velocity
        needed = dynamics.static_torque(position, speed)
        needed += dynamics.viscous_friction * speed + dynamics.dry_friction.torque(speed)
        muscles = channel.model.torque(*request.pressures, channel.inside(position))
        push = (muscles - needed) / dynamics.inertia
        soon = speed + push * REACTION
        rest = limits.rest(JointReference(position + speed * REACTION, soon, push))
        stiffness = limits.own_push / END_ZONE
        lower, upper = channel.joint.position_limits
        high = min(_fading(limits.velocity - soon, limits.own_jerk), stiffness * (upper - rest))
        low = max(-_fading(limits.velocity + soon, limits.own_jerk), stiffness * (lower - rest))
        high, low = max(high, -limits.own_push), min(low, limits.own_push)
        wanted = (torque - needed) / dynamics.inertia
        if low <= wanted <= high:
            return torque
        return needed + dynamics.inertia * max(low, min(high, wanted))


def _fading(room: float, jerk: float) -> float:
    """Acceleration [rad/s^2] with which a speed grows by `room` [rad/s] while it fades."""
    return math.copysign(math.sqrt(2.0 * jerk * abs(room)), room)


def _on_a_spring(point: OperatingPoint, weight: float) -> OperatingPoint:
    """The operating point with at least a weak spring in place of the weight's [N m/rad]."""
    least = point.inertia * (2.0 * math.pi * SLOW_SWING) ** 2
    return dataclasses.replace(point, spring=point.spring + max(least - weight, 0.0))
