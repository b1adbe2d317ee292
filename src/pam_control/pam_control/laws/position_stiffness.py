"""The model-based law: simultaneous control of position and stiffness of antagonistic joints.

The torque is the inverse dynamics of the reference plus the PID output. The joint's exact inverse
turns torque and stiffness into two pressures. It is evaluated at the REFERENCE position, so the
passive stiffness of the muscles pulls the joint to the reference without delay, and the PID
corrects only the remaining error. The part of the torque that the pressures cannot reach is fed
back to the integrator (anti-windup).

If the feedforward is off, the torque is the PID output alone and the inverse is evaluated at the
measured position, so that the muscles act as ideal torque sources. The gains are then designed for
that loop in the same way.
"""

from __future__ import annotations

import math
from typing import Final

from pam_control.adaptation.torque_adaptation import TorqueSample
from pam_control.control_step import PlanRequest, PressurePlan
from pam_control.controller import Controller
from pam_control.feedback.disturbance_observer import ObserverSettings
from pam_control.feedback.linear_joint import LoopStructure
from pam_control.feedback.margins import LoopCase
from pam_control.feedback.operating_points import operating_grid
from pam_control.joint_channel import PRESSURE_SHARE, JointChannel, Pair, Plan
from pam_control.limited import limited
from pam_control.settings import ControlSettings

CORRECTED_EVERY: Final = 0.2  # s
CORRECTED_SHARE: Final = 0.2  # of what lacks, each time
RATE_SPAN: Final = 0.01  # s, over which the rate of the muscles' torque is taken


class PositionStiffnessController(Controller):
    """The model-based law; see the module's docstring."""

    has_observer = True
    has_adaptation = True
    is_scheduled = True
    has_lead = True

    def cases(self, channel: JointChannel, settings: ControlSettings) -> list[LoopCase]:
        """The loops over the joint's range and the stiffness grid."""
        gain = settings.pressure_gain or 0.0
        grid = channel.scale.complete(settings).stiffness_grid
        points = operating_grid(channel.joint, channel.model, grid)
        return [
            LoopCase(
                point,
                LoopStructure(gain, point.per_torque)
                if settings.feedforward
                else LoopStructure(gain, point.per_torque, point.per_position, True),
                stiffness,
            )
            for stiffness, point in points
        ]

    def _begin(self, index: int, channel: JointChannel, position: float, pressures: Pair) -> None:
        position = channel.inside(position)
        settings = channel.scale.complete(self.settings)
        stiffness = channel.model.stiffness(*pressures, position)
        torque = channel.model.torque(*pressures, position)
        if settings.feedforward:
            torque -= channel.dynamics.gravity(position)
            if self.adapts:
                torque -= channel.adaptation.at_rest(position, settings.adaptation_limit)
            if self._gains(channel).observer > 0.0:
                torque -= channel.observer.start(torque, settings.observer_limit)
        limit = settings.integral_limit
        channel.pid.reset(max(-limit, min(limit, torque)))
        channel.telemetry.stiffness = stiffness

    def _continue(self, index: int, channel: JointChannel) -> None:
        settings, telemetry = self.settings, channel.telemetry
        gains = self._gains(channel)
        reference = telemetry.reference
        position = channel.position
        planned = 0.0
        if settings.feedforward:
            added = channel.plans[-1].memory_torque if channel.plans else 0.0
            if not self.adapts:  # the next plans lack what was learnt
                added += channel.adapted
            planned = channel.dynamics.torque(reference) - added
            position = reference.position
        channel.plans.clear()
        torque = channel.model.torque(*channel.desired, channel.inside(position))
        lost = channel.observer.lost if settings.feedforward and gains.observer > 0.0 else 0.0
        channel.pid.continue_at(torque - planned - lost, telemetry.error, gains)

    def _lost(self, request: PlanRequest, added: float) -> float:
        """Torque of the muscles that the model does not explain [N m]; 0 without the observer."""
        settings, channel, dynamics = self.settings, request.channel, request.channel.dynamics
        bandwidth = self._gains(channel).observer
        if bandwidth == 0.0:
            channel.telemetry.disturbance = math.nan
            return 0.0
        channel.aligned.add(request.measured_at, request.pressures)
        position, speed = channel.position, channel.velocity
        muscles = channel.model.torque(
            *channel.aligned.at(request.seen_at), channel.inside(position)
        )
        motion = dynamics.static_torque(position, speed)
        limit = channel.scale.complete(settings).observer_limit
        how = ObserverSettings(bandwidth, settings.derivative_filter, limit)
        lost = channel.observer.update(request.fresh, muscles + added, motion, speed, how)
        channel.telemetry.disturbance = -lost
        return lost

    def _learn(self, request: PlanRequest, known: float, used: bool) -> None:
        """Take what the torque of the muscles says about what the model lacks.

        Parameters
        ----------
        request : PlanRequest
            The present cycle.
        known : float
            Known torque of hysteresis, creep and dry friction at the time of the position [N m].
        used : bool
            The plan has what was learnt; a motion that is repeated keeps what it was played with.
        """
        channel = request.channel
        channel.aligned.add(request.measured_at, request.pressures)
        position, speed = channel.lagging(request.fresh)
        inside = channel.inside(position)
        # by the rig file, without the learnt delay
        seen_at = request.seen_at + channel.late_position
        aligned = channel.aligned.at(seen_at)
        muscles, before = channel.model.torques(
            (aligned, channel.aligned.at(seen_at - RATE_SPAN)), inside
        )
        model = channel.dynamics.static_torque(position, speed)
        sample = TorqueSample(
            unexplained=muscles + known - model,
            rate=(muscles - before) / RATE_SPAN,
            position=position,
            speed=speed,
            speed_filter=self.settings.derivative_filter,
        )
        beside = known - model + channel.dynamics.gravity(position)
        channel.stiffness.learn(request.fresh, aligned, inside, beside)
        learnt = channel.adaptation.learn(request.fresh, sample)
        if used:
            channel.pid.hand_over(learnt)

    def _repeated(self, request: PlanRequest, usual: float) -> tuple[float, float]:
        """The torque of the adaptation and the learnt correction for a repeated motion [N m].

        Parameters
        ----------
        request : PlanRequest
            The present cycle.
        usual : float
            What the adaptation adds [N m].
        """
        channel, at = request.channel, request.measured_at
        if channel.learner is None:
            return usual, 0.0
        base, correction = channel.learner.torque(at, usual)
        limit = channel.scale.complete(self.settings).adaptation_limit
        error = request.seen.position - channel.position
        channel.learner.record(at, error, base, request.seen.position)
        return base, limited(correction, -limit, limit)

    def _wanted_stiffness(self, request: PlanRequest) -> float:
        """Stiffness of the model [N m/rad] at which the joint has the commanded one."""
        channel, command = request.channel, self.stiffness_commands[request.index]
        if not (self.adapts and self.settings.stiffness_corrected):
            channel.stiffness_goal = channel.stiffness_factor = 1.0
            return command
        if request.acts_at - channel.corrected_at > CORRECTED_EVERY:
            channel.corrected_at = request.acts_at
            # at one place, so that the correction does not change along a motion
            middle = 0.5 * sum(channel.joint.position_limits)
            there = channel.model.pressures_for(channel.dynamics.gravity(middle), command, middle)
            channel.stiffness_goal = channel.stiffness.factor(
                (there.agonist, there.antagonist), middle, channel.stiffness_goal
            )
            lacking = channel.stiffness_goal - channel.stiffness_factor
            channel.stiffness_factor += CORRECTED_SHARE * lacking
        return command / channel.stiffness_factor

    @staticmethod
    def _tell(channel: JointChannel) -> None:
        """Count what was learnt as a disturbance, so that a payload stays visible."""
        telemetry = channel.telemetry
        if channel.adaptation.knows:
            observed = 0.0 if math.isnan(telemetry.disturbance) else telemetry.disturbance
            telemetry.disturbance = observed - channel.adapted

    def _plan(self, request: PlanRequest) -> PressurePlan:
        channel = request.channel
        settings, telemetry = channel.scale.complete(self.settings), channel.telemetry
        rate_limit = min(settings.stiffness_rate, channel.joint.max_stiffness_rate)
        reach = rate_limit * request.step
        change = self._wanted_stiffness(request) - telemetry.stiffness
        stiffness = telemetry.stiffness + limited(change, -reach, reach)
        rate = ahead = shift = (0.0, 0.0)
        if settings.feedforward:
            now, then = request.now, request.then
            before = channel.plans[-1].pressures if channel.plans else channel.desired
            channel.shown = channel.shown if channel.plans else before
            added = channel.history.advance(request.acts_at, then, before)
            memory, limit = added, settings.adaptation_limit
            usual = channel.adaptation.torque(request.acts_at, then, limit) if self.adapts else 0.0
            channel.adapted, correction = self._repeated(request, usual)
            added -= channel.adapted
            planned = channel.model.pressures_for(
                channel.dynamics.torque(then) - added, stiffness, then.position
            )
            goal = (planned.agonist, planned.antagonist)
            channel.remember(Plan(request.acts_at, goal, stiffness, added, memory), request.now_at)
            rate = channel.planned_rates(request.side_acts_at)
            past = channel.plan_at(request.now_at)
            coming = channel.pressures_at(request.side_acts_at)
            shown = channel.shown_plan(request.now_at, request.step)
            shift = (shown[0] - past.pressures[0], shown[1] - past.pressures[1])
            ahead = (coming[0] - shown[0], coming[1] - shown[1])
            wanted_stiffness, added = past.stiffness, past.memory_torque
            torque = channel.dynamics.torque(now) - added + request.output + correction
            friction = channel.dynamics.dry_friction
            torque += friction.change(request.seen.velocity, channel.velocity)
            torque += self._lost(request, added)
            if self.adapts:
                used = channel.adapted == usual
                self._learn(request, channel.plan_at(request.seen_at).known, used)
                self._tell(channel)
            channel.pid.integral -= channel.stuck.update(
                request.seen,
                channel.position,
                channel.pid.integral,
                channel.adaptation.friction + friction.level(0.0),
            )
            position = now.position
            velocities = request.side_velocities
        else:
            torque, wanted_stiffness = request.output, stiffness
            position = channel.position
            velocities = (channel.velocity, channel.velocity)
        reached = channel.model.pressures_for(torque, wanted_stiffness, position)
        told = (("torque", reached.torque_limited), ("stiffness", reached.stiffness_limited))
        telemetry.torque, telemetry.stiffness = torque, stiffness
        telemetry.torque_reached = reached.torque
        telemetry.stiffness_reached = reached.stiffness
        telemetry.clipped = tuple(name for name, is_limited in told if is_limited)
        missed = reached.torque - torque if reached.torque_limited else 0.0
        pressures = _shifted((reached.agonist, reached.antagonist), shift, channel)
        return PressurePlan(pressures, rate, ahead, velocities, missed)


def _shifted(pressures: Pair, shift: Pair, channel: JointChannel) -> Pair:
    """Pressures and what a lagging sensor adds to them, within what may be asked for [Pa]."""
    if shift == (0.0, 0.0):
        return pressures
    one, other = (PRESSURE_SHARE * muscle.max_pressure for muscle in channel.muscles)
    return limited(pressures[0] + shift[0], 0.0, one), limited(pressures[1] + shift[1], 0.0, other)
