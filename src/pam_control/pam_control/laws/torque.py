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
from dataclasses import dataclass
from typing import ClassVar, Final, NamedTuple

from pam_control.control_step import LawTelemetry, PlanRequest, PressurePlan
from pam_control.feedback.linear_joint import LoopStructure
from pam_control.feedback.margins import LoopCase
from pam_control.feedback.operating_points import operating_grid
from pam_control.joint_models import JointModels
from pam_control.laws.law import Guidance, GuideRequest, Law, Start
from pam_control.laws.position_stiffness import PositionStiffness, PositionStiffnessState
from pam_control.limited import limited
from pam_control.references.spline import JointReference
from pam_control.settings import ControlSettings
from pam_model.views.linearised_joint import OperatingPoint

END_ZONE: Final = 0.1  # rad; so far from the end of the range the limit begins to act
REACTION: Final = 0.03  # s, until a changed torque acts
SMOOTHING: Final = 0.01  # s
SLOW_SWING: Final = 0.5  # Hz
HOLD: Final = PositionStiffness()
"""Holds and moves a joint for which no torque is commanded."""


class TorqueState(NamedTuple):
    """State of one joint."""

    hold: PositionStiffnessState  # of the position law
    driven: bool = False  # whether torques are commanded
    # asked, slope: the torque of the last cycle [N m], NaN if none was commanded, and its smoothed
    # rate [N m/s]: torques come in steps
    asked: float = math.nan
    slope: float = 0.0


@dataclass(frozen=True)
class Torque(Law[TorqueState]):
    """The law of the module's docstring."""

    name: ClassVar[str] = "torque"
    is_scheduled: ClassVar[bool] = True
    has_lead: ClassVar[bool] = True
    takes_torques: ClassVar[bool] = True
    guides: ClassVar[bool] = True
    bare: ClassVar[str] = "as a source of torque, its muscles are"

    def cases(self, models: JointModels, settings: ControlSettings) -> list[LoopCase]:
        """The loops of the position law."""
        return HOLD.cases(models, settings)

    def bare_cases(self, models: JointModels, settings: ControlSettings) -> list[LoopCase]:
        """The muscles alone must be stable, too.

        A horizontal or inverted joint drifts or falls under a constant torque whatever its muscles
        do; whoever sends the torques must prevent that. So its weight counts at least as much
        as a spring on which the joint swings slowly.
        """
        gain = settings.pressure_gain or 0.0
        grid = models.scale.complete(settings).stiffness_grid
        return [
            LoopCase(
                _on_a_spring(point, models.dynamics.gravity_stiffness(point.position)),
                LoopStructure(gain, point.per_torque, point.per_position, True),
            )
            for _, point in operating_grid(models.joint, models.model, grid)
        ]

    def init(self, models: JointModels) -> TorqueState:
        """A joint that was not controlled."""
        return TorqueState(HOLD.init(models))

    def rest(self, models: JointModels, state: TorqueState) -> TorqueState:
        """The joint is taken over."""
        return state._replace(hold=HOLD.rest(models, state.hold))

    def begin(
        self, models: JointModels, state: TorqueState, start: Start
    ) -> tuple[float, TorqueState]:
        """Begin with the stiffness and the torque that the joint has."""
        torque, hold = HOLD.begin(models, state.hold, start)
        return torque, state._replace(hold=hold)

    def resume(
        self, models: JointModels, state: TorqueState, start: Start
    ) -> tuple[float, TorqueState]:
        """Go on with the torque that the joint is desired to have."""
        torque, hold = HOLD.resume(models, state.hold, start)
        return torque, state._replace(hold=hold)

    def guide(
        self, models: JointModels, state: TorqueState, request: GuideRequest
    ) -> tuple[Guidance, TorqueState]:
        """Let the reference follow a joint that torques move, and hold it when they cease."""
        position, driven = request.motion.position, request.torque is not None
        guidance = Guidance()
        if driven and request.active and not math.isnan(position):
            guidance = Guidance(lead=models.inside(position))
        elif state.driven:  # the stream has ended
            guidance = Guidance(restart=True)
        if driven:
            return guidance, state._replace(driven=True)
        return guidance, TorqueState(state.hold)

    def stiffness(self, state: TorqueState) -> float:
        """The reference of the stiffness [N m/rad]."""
        return HOLD.stiffness(state.hold)

    def plan(
        self, models: JointModels, state: TorqueState, request: PlanRequest
    ) -> tuple[PressurePlan, TorqueState]:
        """Plan the pressures for the commanded torque, or of the position law without one."""
        asked = request.torque
        if asked is None:
            plan, hold = HOLD.plan(models, state.hold, request)
            return plan, state._replace(hold=hold)
        settings, motion = request.settings, request.motion
        reach = min(settings.stiffness_rate, models.joint.max_stiffness_rate) * request.step
        before = self.stiffness(state)
        change = request.stiffness - before
        stiffness = before + max(-reach, min(reach, change))
        torque = _limited(models, request, asked)
        ahead = request.then.time - request.measured_at
        slope = _smoothed_rate(state, torque, request.step)
        position = models.inside(motion.position)
        later = models.inside(position + ahead * motion.velocity)
        reached = models.model.pressures_for(torque, stiffness, position)
        then = models.model.pressures_for(torque + ahead * slope, stiffness, later)
        told = (
            ("torque", reached.torque_limited or torque != asked),
            ("stiffness", reached.stiffness_limited),
        )
        telemetry = LawTelemetry(
            torque,
            stiffness,
            reached.torque,
            reached.stiffness,
            reached.stiffness,
            clipped=tuple(name for name, is_limited in told if is_limited),
            yields=True,
            driven=True,
        )
        changes = tuple(
            later - now for later, now in zip(then.pressures, reached.pressures, strict=True)
        )
        plan = PressurePlan(
            reached.pressures,
            tuple(each / ahead for each in changes),
            changes,
            (motion.velocity,) * len(changes),
            0.0,
            0.0,
            telemetry,
        )
        hold = HOLD.led(state.hold, stiffness)
        return plan, TorqueState(hold, True, torque, slope)


def _smoothed_rate(state: TorqueState, torque: float, step: float) -> float:
    """Rate of a joint's torque [N m/s], smoothed because torques come in steps."""
    if math.isnan(state.asked):
        return state.slope
    weight = step / (SMOOTHING + step)
    return state.slope + weight * ((torque - state.asked) / step - state.slope)


def _limited(models: JointModels, request: PlanRequest, torque: float) -> float:
    """The torque [N m] that keeps the joint below its speed and inside its range."""
    dynamics, limits = models.dynamics, request.limits
    position, speed, _ = request.motion
    needed = dynamics.static_torque(position, speed)
    needed += dynamics.moving_torque(speed, 0.0) + models.dry_friction.torque(speed)
    muscles = models.model.torque(request.pressures, models.inside(position))
    push = dynamics.acceleration(muscles - needed)
    soon = speed + push * REACTION
    rest = limits.rest(JointReference(position + speed * REACTION, soon, push))
    stiffness = limits.own_push / END_ZONE
    lower, upper = models.joint.position_limits
    high = min(_fading(limits.velocity - soon, limits.own_jerk), stiffness * (upper - rest))
    low = max(-_fading(limits.velocity + soon, limits.own_jerk), stiffness * (lower - rest))
    high, low = max(high, -limits.own_push), min(low, limits.own_push)
    wanted = dynamics.acceleration(torque - needed)
    if low <= wanted <= high:
        return torque
    return needed + dynamics.moving_torque(0.0, limited(wanted, low, high))


def _fading(room: float, jerk: float) -> float:
    """Acceleration [rad/s^2] with which a speed grows by `room` [rad/s] while it fades."""
    return math.copysign(math.sqrt(2.0 * jerk * abs(room)), room)


def _on_a_spring(point: OperatingPoint, weight: float) -> OperatingPoint:
    """The operating point with at least a weak spring in place of the weight's [N m/rad]."""
    least = point.swinging_spring(SLOW_SWING)
    return dataclasses.replace(point, spring=point.spring + max(least - weight, 0.0))
