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
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Final, NamedTuple

from pam_control.adaptation.rig_numbers import RigNumbers
from pam_control.compensation.history_torque import HistoryTorque
from pam_control.control_step import JointTelemetry, LawTelemetry, PlanRequest, PressurePlan
from pam_control.feedback.linear_joint import LoopStructure
from pam_control.feedback.margins import LoopCase
from pam_control.feedback.operating_points import operating_grid
from pam_control.feedback.pid import handed_over
from pam_control.feedback.stuck_integral import StuckIntegral
from pam_control.joint_models import PRESSURE_SHARE, JointModels, Pair
from pam_control.laws.law import Law, Start
from pam_control.laws.unmodelled_torque import (
    Estimates,
    learn_torque,
    lost_torque,
    repeated_torque,
)
from pam_control.limited import limited
from pam_control.plan_memory import (
    Plan,
    Plans,
    plan_at,
    planned_rates,
    pressures_at,
    remember,
    shown_pressures,
)
from pam_control.settings import ControlSettings

CORRECTED_EVERY: Final = 0.2  # s
CORRECTED_SHARE: Final = 0.2  # of what lacks, each time


class Correction(NamedTuple):
    """The correction of the commanded stiffness by what was learnt.

    Attributes
    ----------
    goal, factor : float
        True stiffness over that of the model [-]: as estimated, and as used, which follows slowly.
    at : float
        When it was computed last [s].
    """

    goal: float = 1.0
    factor: float = 1.0
    at: float = -math.inf


NONE: Final = Correction()


class PositionStiffnessState(NamedTuple):
    """State of one joint.

    Attributes
    ----------
    estimates, stuck, history
        What is learnt or filtered along the motion; each is changed in place, by this law alone.
    stiffness : float
        Its reference [N m/rad].
    plans : tuple of Plan
        Feedforward that was planned.
    shown : (float, float)
        The plan as sensors with a lag show it [Pa].
    adapted : float
        Learnt torque of the newest plan [N m].
    lagging : (float, float)
        Position [rad] and speed [rad/s] with the lag of the pressure sensors.
    correction : Correction
        Of the stiffness.
    """

    estimates: Estimates
    stuck: StuckIntegral
    history: HistoryTorque
    stiffness: float = math.nan
    plans: Plans = ()
    shown: Pair = (0.0, 0.0)
    adapted: float = 0.0
    lagging: Pair = (math.nan, math.nan)
    correction: Correction = NONE


@dataclass(frozen=True)
class PositionStiffness(Law[PositionStiffnessState]):
    """The law of the module's docstring; its parameters are those of all laws."""

    name: ClassVar[str] = "model_based"
    is_scheduled: ClassVar[bool] = True
    has_lead: ClassVar[bool] = True
    has_observer: ClassVar[bool] = True
    has_adaptation: ClassVar[bool] = True

    def cases(self, models: JointModels, settings: ControlSettings) -> list[LoopCase]:
        """The loops over the joint's range and the stiffness grid."""
        gain = settings.pressure_gain or 0.0
        grid = models.scale.complete(settings).stiffness_grid
        points = operating_grid(models.joint, models.model, grid)
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

    def init(self, models: JointModels) -> PositionStiffnessState:
        """Nothing is known of the joint but its models."""
        return PositionStiffnessState(
            Estimates.of(models),
            StuckIntegral(),
            HistoryTorque(models.muscles, models.joint.arms[0].length, models.dry_friction),
        )

    def rest(self, models: JointModels, state: PositionStiffnessState) -> PositionStiffnessState:
        """The joint is taken over; what was learnt of it stays."""
        state.estimates.rest()
        state.stuck.reset()
        state.history.reset()
        return state._replace(
            plans=(),
            adapted=0.0,
            lagging=(math.nan, math.nan),
            correction=state.correction._replace(at=-math.inf),
        )

    def forget(self, models: JointModels, state: PositionStiffnessState) -> PositionStiffnessState:
        """What was learnt of the joint is forgotten."""
        state.estimates.forget()
        return state._replace(correction=NONE)

    def begin(
        self, models: JointModels, state: PositionStiffnessState, start: Start
    ) -> tuple[float, PositionStiffnessState]:
        """Begin with the stiffness and the torque that the joint has."""
        position, settings = models.inside(start.position), start.settings
        stiffness = models.model.stiffness(*start.pressures, position)
        torque = models.model.torque(*start.pressures, position)
        if settings.feedforward:
            torque -= models.dynamics.gravity(position)
            if start.adapts:
                torque -= state.estimates.adaptation.at_rest(position, settings.adaptation_limit)
            if start.gains.observer > 0.0:
                torque -= state.estimates.observer.start(torque, settings.observer_limit)
        limit = settings.integral_limit
        return max(-limit, min(limit, torque)), state._replace(stiffness=stiffness)

    def resume(
        self, models: JointModels, state: PositionStiffnessState, start: Start
    ) -> tuple[float, PositionStiffnessState]:
        """Go on with the torque that the joint is desired to have."""
        position, planned, lost = start.position, 0.0, 0.0
        if start.settings.feedforward:
            added = state.plans[-1].memory_torque if state.plans else 0.0
            if not start.adapts:  # the next plans lack what was learnt
                added += state.adapted
            planned = models.torque(start.reference) - added
            position = start.reference.position
            lost = state.estimates.observer.lost if start.gains.observer > 0.0 else 0.0
        torque = models.model.torque(*start.pressures, models.inside(position))
        return torque - planned - lost, state._replace(plans=())

    def plan(
        self, models: JointModels, state: PositionStiffnessState, request: PlanRequest
    ) -> tuple[PressurePlan, PositionStiffnessState]:
        """Plan the pressures for torque and stiffness."""
        wanted, correction = _wanted_stiffness(models, state, request)
        settings, motion = request.settings, request.motion
        rate_limit = min(settings.stiffness_rate, models.joint.max_stiffness_rate)
        reach = rate_limit * request.step
        stiffness = state.stiffness + limited(wanted - state.stiffness, -reach, reach)
        if settings.feedforward:
            target, state = _ahead(models, state, request, stiffness, correction)
        else:
            state = state._replace(stiffness=stiffness, correction=correction)
            still, velocities = (0.0, 0.0), (motion.velocity, motion.velocity)
            target = _Target(
                request.output, stiffness, motion.position, still, still, still, velocities,
                request.integral, math.nan,
            )  # fmt: skip
        reached = models.model.pressures_for(target.torque, target.stiffness, target.position)
        told = (("torque", reached.torque_limited), ("stiffness", reached.stiffness_limited))
        telemetry = LawTelemetry(
            target.torque,
            stiffness,
            reached.torque,
            reached.stiffness,
            correction.factor * reached.stiffness,
            target.disturbance,
            tuple(name for name, is_limited in told if is_limited),
        )
        plan = PressurePlan(
            _shifted((reached.agonist, reached.antagonist), target.shift, models),
            target.rate,
            target.ahead,
            target.velocities,
            reached.torque - target.torque if reached.torque_limited else 0.0,
            target.integral,
            telemetry,
        )
        return plan, state

    def stiffness(self, state: PositionStiffnessState) -> float:
        """The reference of the stiffness [N m/rad]."""
        return state.stiffness

    def delay(self, state: PositionStiffnessState) -> float:
        """By which the position was found to be later than the pressures [s]."""
        return state.estimates.adaptation.delay

    def report(
        self, models: JointModels, state: PositionStiffnessState, telemetry: JointTelemetry
    ) -> Mapping[str, float]:
        """The stiffness that the joint has, as was learnt."""
        position = models.inside(telemetry.motion.position)
        found = state.estimates.stiffness.at(telemetry.pressures, position)
        return {
            "true stiffness, estimated [N m/rad]": found.value,
            "true stiffness, at least (90 %) [N m/rad]": found.low,
            "true stiffness, at most (90 %) [N m/rad]": found.high,
        }

    def numbers(self, state: PositionStiffnessState) -> RigNumbers:
        """What the torques show about the rig file."""
        return state.estimates.stiffness.numbers()


class _Target(NamedTuple):
    """What the pressures have to give.

    Attributes
    ----------
    torque, stiffness, position : float
        [N m], [N m/rad], at [rad].
    rate, ahead, velocities : (float, float)
        As in `PressurePlan`.
    shift : (float, float)
        What lagging sensors add to the pressures [Pa].
    integral : float
        Of the feedback from now on [N m].
    disturbance : float
        As in `LawTelemetry` [N m].
    """

    torque: float
    stiffness: float
    position: float
    rate: Pair
    ahead: Pair
    shift: Pair
    velocities: Pair
    integral: float
    disturbance: float


def _ahead(
    models: JointModels,
    state: PositionStiffnessState,
    request: PlanRequest,
    stiffness: float,
    corrected: Correction,
) -> tuple[_Target, PositionStiffnessState]:
    """Plan the pressures for the time when the valves act, and correct those of now."""
    settings, motion = request.settings, request.motion
    now, (acts_at, then) = request.now, request.then
    before = state.plans[-1].pressures if state.plans else request.desired
    shown = state.shown if state.plans else before
    known = state.history.advance(acts_at, then, before)
    limit = settings.adaptation_limit
    usual = state.estimates.adaptation.torque(acts_at, then, limit) if request.adapts else 0.0
    adapted, correction = repeated_torque(request, usual)
    added = known - adapted
    planned = models.model.pressures_for(models.torque(then) - added, stiffness, then.position)
    goal = (planned.agonist, planned.antagonist)
    plan = Plan(acts_at, goal, stiffness, added, known)
    plans = remember(state.plans, plan, now.time)
    past, coming = plan_at(plans, now.time), pressures_at(plans, request.side_times)
    shown = shown_pressures(plans, shown, now.time, models.pressure_lag, request.step)

    torque = models.torque(now.reference) - past.memory_torque + request.output + correction
    friction = models.dry_friction
    torque += friction.change(request.seen.reference.velocity, motion.velocity)
    lost = lost_torque(models, state.estimates, request, past.memory_torque)
    torque += lost or 0.0
    disturbance, integral = -lost if lost is not None else math.nan, request.integral
    lagging = state.lagging
    if request.adapts:
        then_known = plan_at(plans, request.seen.time).known
        lagging, learnt = learn_torque(models, state.estimates, lagging, request, then_known)
        # a motion that is repeated keeps what it was played with
        if adapted == usual:
            integral = handed_over(integral, learnt)
        if state.estimates.adaptation.knows:  # so that a payload stays visible
            disturbance = (0.0 if math.isnan(disturbance) else disturbance) - adapted
    integral -= state.stuck.update(
        request.seen.reference,
        motion.position,
        integral,
        state.estimates.adaptation.friction + friction.level(0.0),
    )
    target = _Target(
        torque,
        past.stiffness,
        now.reference.position,
        planned_rates(plans, request.side_times),
        (coming[0] - shown[0], coming[1] - shown[1]),
        (shown[0] - past.pressures[0], shown[1] - past.pressures[1]),
        request.side_velocities,
        integral,
        disturbance,
    )
    return target, PositionStiffnessState(
        state.estimates,
        state.stuck,
        state.history,
        stiffness,
        plans,
        shown,
        adapted,
        lagging,
        corrected,
    )


def _wanted_stiffness(
    models: JointModels, state: PositionStiffnessState, request: PlanRequest
) -> tuple[float, Correction]:
    """Stiffness of the model [N m/rad] at which the joint has the commanded one."""
    if not (request.adapts and request.settings.stiffness_corrected):
        return request.stiffness, NONE
    correction, acts_at = state.correction, request.then.time
    if acts_at - correction.at > CORRECTED_EVERY:
        # at one place, so that the correction does not change along a motion
        middle = 0.5 * sum(models.joint.position_limits)
        there = models.model.pressures_for(
            models.dynamics.gravity(middle), request.stiffness, middle
        )
        goal = state.estimates.stiffness.factor(
            (there.agonist, there.antagonist), middle, correction.goal
        )
        factor = correction.factor + CORRECTED_SHARE * (goal - correction.factor)
        correction = Correction(goal, factor, acts_at)
    return request.stiffness / correction.factor, correction


def _shifted(pressures: Pair, shift: Pair, models: JointModels) -> Pair:
    """Pressures and what a lagging sensor adds to them, within what may be asked for [Pa]."""
    if shift == (0.0, 0.0):
        return pressures
    one, other = (PRESSURE_SHARE * muscle.max_pressure for muscle in models.muscles)
    return limited(pressures[0] + shift[0], 0.0, one), limited(pressures[1] + shift[1], 0.0, other)
