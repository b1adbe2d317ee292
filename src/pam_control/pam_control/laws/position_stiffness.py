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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Final, NamedTuple

from pam_control.adaptation.rig_numbers import RigNumbers
from pam_control.control_step import JointTelemetry, LawTelemetry, PlanRequest, PressurePlan
from pam_control.feedback.disturbance_observer import begin_observer
from pam_control.feedback.linear_joint import LoopStructure
from pam_control.feedback.margins import LoopCase
from pam_control.feedback.operating_points import operating_grid
from pam_control.feedback.stuck_integral import go_on_sticking
from pam_control.joint_models import JointModels
from pam_control.laws.law import Law, Start
from pam_control.laws.position_plan import last_to_act
from pam_control.laws.position_rows import Estimates, PositionRows
from pam_control.learning.motion_learner import MotionLearner
from pam_control.plan_memory import newest
from pam_control.rows.plan_rows import (
    A_DELAY,
    P_MEMORY,
    W_ACTS,
    W_AHEAD,
    W_PRESSURE,
    W_RATE,
    W_REFERENCE,
    W_SPEED,
    X_DISTURBANCE,
    X_FACTOR,
    X_MISSED,
    X_NEW_INTEGRAL,
    X_NOW,
    X_OBSERVER,
    X_OUTPUT,
    X_REACHED_STIFFNESS,
    X_REACHED_TORQUE,
    X_STIFFNESS,
    X_STIFFNESS_LIMITED,
    X_TORQUE,
    X_TORQUE_LIMITED,
    X_TRUE_STIFFNESS,
    X_WANTED,
    Y_ADAPTED,
    Y_GRIP,
    Y_HANDED,
    Y_LOST,
    Y_STIFFNESS,
    Y_ZERO,
)
from pam_control.settings import ControlSettings
from pam_model.views.joint_rows import gravity_rate

CORRECTED_EVERY: Final = 0.2  # s
CORRECTED_SHARE: Final = 0.2  # of what lacks, each time


class StiffnessCorrection(NamedTuple):
    """The correction of the commanded stiffness by what was learnt."""

    # goal, factor: true stiffness over that of the model [-]: as estimated, and as used, which
    # follows slowly
    goal: float = 1.0
    factor: float = 1.0
    at: float = -math.inf  # when it was computed last [s]


NONE: Final = StiffnessCorrection()


class PositionStiffnessState(NamedTuple):
    """State of one joint."""

    # the numbers of the cycle and what is learnt; they are changed in place, by this law alone
    rows: PositionRows
    place: int = 0  # of the joint in the rows
    correction: StiffnessCorrection = NONE  # of the stiffness

    @property
    def x(self) -> Any:
        """The row of the cycle."""
        return self.rows.x[self.place]

    @property
    def y(self) -> Any:
        """The row of the plan's state."""
        return self.rows.y[self.place]

    @property
    def estimates(self) -> Estimates:
        """What is learnt of the joint."""
        return self.rows.estimates[self.place]


@dataclass(frozen=True)
class PositionStiffness(Law[PositionStiffnessState]):
    """The law of the module's docstring; its parameters are those of all laws."""

    name: ClassVar[str] = "model_based"
    is_scheduled: ClassVar[bool] = True
    has_lead: ClassVar[bool] = True
    has_observer: ClassVar[bool] = True
    has_adaptation: ClassVar[bool] = True
    together: ClassVar[bool] = True

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
        return PositionStiffnessState(PositionRows([models]))

    def init_together(self, joints: Sequence[JointModels]) -> list[PositionStiffnessState]:
        """The same for all joints, in common rows."""
        rows = PositionRows(joints)
        return [PositionStiffnessState(rows, place) for place in range(len(joints))]

    def rest(self, models: JointModels, state: PositionStiffnessState) -> PositionStiffnessState:
        """The joint is taken over; what was learnt of it stays."""
        state.rows.rest(state.place)
        return state._replace(correction=state.correction._replace(at=-math.inf))

    def forget(self, models: JointModels, state: PositionStiffnessState) -> PositionStiffnessState:
        """What was learnt of the joint is forgotten."""
        state.estimates.forget()
        return state._replace(correction=NONE)

    def begin(
        self, models: JointModels, state: PositionStiffnessState, start: Start
    ) -> tuple[float, PositionStiffnessState]:
        """Begin with the stiffness and the torque that the joint has."""
        position, settings = models.inside(start.position), start.settings
        state.y[Y_STIFFNESS] = models.model.stiffness(start.pressures, position)
        torque = models.model.torque(start.pressures, position)
        if settings.feedforward:
            torque -= models.dynamics.gravity(position)
            if start.adapts:
                slope = gravity_rate(state.rows.c[state.place], position)
                state.y[Y_ZERO] = state.y[Y_STIFFNESS] + slope
                state.y[Y_GRIP] = models.model.grip(start.pressures, position)
                torque -= state.estimates.adaptation.at_rest(position, settings.adaptation_limit)
            if start.gains.observer > 0.0:
                torque -= begin_observer(state.y, torque, settings.observer_limit)
        limit = settings.integral_limit
        return max(-limit, min(limit, torque)), state

    def resume(
        self, models: JointModels, state: PositionStiffnessState, start: Start
    ) -> tuple[float, PositionStiffnessState]:
        """Go on with the torque that the joint is desired to have."""
        position, planned, lost = start.position, 0.0, 0.0
        plans, place = state.rows.plans, state.place
        if start.settings.feedforward:
            added = 0.0
            if plans.ends[place][1] > 0:
                ring, ends = plans.rows[place], plans.ends[place]
                added = float(ring[newest(ring, ends)][P_MEMORY]) - float(state.y[Y_HANDED])
            if not start.adapts:  # the next plans lack what was learnt
                added += float(state.y[Y_ADAPTED])
            planned = models.torque(start.reference) - added
            position = start.reference.position
            lost = float(state.y[Y_LOST]) if start.gains.observer > 0.0 else 0.0
        state.y[Y_HANDED] = 0.0
        go_on_sticking(state.y)
        torque = models.model.torque(start.pressures, models.inside(position))
        plans.clear(place)
        return torque - planned - lost, state

    def plan(
        self, models: JointModels, state: PositionStiffnessState, request: PlanRequest
    ) -> tuple[PressurePlan, PositionStiffnessState]:
        """Plan the pressures for torque and stiffness."""
        rows, place, x = state.rows, state.place, state.x
        rows.use(place, request.settings, request.adapts)
        motion = request.motion
        x[X_OUTPUT : X_NOW + 4] = [
            request.output, request.integral, math.nan, 1.0, motion.position, motion.velocity,
            request.fresh, request.measured_at, *request.seen.row, *request.now.row,
        ]  # fmt: skip
        muscles = zip(request.pressures, request.desired, request.acts, strict=True)
        for row, (pressure, desired, acts) in zip(rows.w[place], muscles, strict=True):
            row[W_PRESSURE : W_ACTS + 4] = [pressure, desired, *acts.row]
        x[X_OBSERVER] = request.gains.observer
        state = self.ask(models, state, request.stiffness, request.settings, request.adapts)
        learners = {} if request.learner is None else {place: request.learner}
        rows.plan(place, place + 1, request.step, learners)
        x = [float(number) for number in x]
        told = (("torque", x[X_TORQUE_LIMITED]), ("stiffness", x[X_STIFFNESS_LIMITED]))
        telemetry = LawTelemetry(
            x[X_TORQUE],
            x[X_STIFFNESS],
            x[X_REACHED_TORQUE],
            x[X_REACHED_STIFFNESS],
            x[X_TRUE_STIFFNESS],
            x[X_DISTURBANCE],
            tuple(name for name, is_limited in told if is_limited),
        )
        plan = PressurePlan(
            rows.column(place, W_REFERENCE),
            rows.column(place, W_RATE),
            rows.column(place, W_AHEAD),
            rows.column(place, W_SPEED),
            x[X_MISSED],
            x[X_NEW_INTEGRAL],
            telemetry,
        )
        return plan, state

    def use(
        self,
        models: JointModels,
        state: PositionStiffnessState,
        settings: ControlSettings,
        adapts: bool,
    ) -> None:
        """Use these settings of a joint, and what was learnt or not, from the next cycle on."""
        state.rows.use(state.place, settings, adapts)

    def ask(
        self,
        models: JointModels,
        state: PositionStiffnessState,
        stiffness: float,
        settings: ControlSettings,
        adapts: bool,
    ) -> PositionStiffnessState:
        """Write the stiffness of the model [N m/rad] at which the joint has the commanded one."""
        x, correction = state.x, NONE
        if adapts and settings.stiffness_corrected:
            correction = _corrected(models, state, stiffness)
        x[X_WANTED], x[X_FACTOR] = stiffness / correction.factor, correction.factor
        return state if correction is state.correction else state._replace(correction=correction)

    def asks_again(self, settings: ControlSettings, adapts: bool) -> bool:
        """Only a correction that follows what is learnt changes what is asked for."""
        return adapts and settings.stiffness_corrected

    def scheduling(self, states: Sequence[PositionStiffnessState]) -> tuple[Any, int, Any, int]:
        """See `stiffness` and `delay`."""
        rows = states[0].rows
        return rows.y, Y_STIFFNESS, rows.a, A_DELAY

    def plan_together(
        self,
        states: Sequence[PositionStiffnessState],
        step: float,
        learners: Mapping[int, MotionLearner],
    ) -> None:
        """Plan one cycle of all joints, in their common rows."""
        states[0].rows.plan(0, len(states), step, learners)

    def led(self, state: PositionStiffnessState, stiffness: float) -> PositionStiffnessState:
        """The state of a joint that another law leads with this stiffness [N m/rad]."""
        state.y[Y_STIFFNESS] = stiffness
        state.rows.plans.clear(state.place)
        return state

    def stiffness(self, state: PositionStiffnessState) -> float:
        """The reference of the stiffness [N m/rad]."""
        return float(state.y[Y_STIFFNESS])

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


def _corrected(
    models: JointModels, state: PositionStiffnessState, stiffness: float
) -> StiffnessCorrection:
    """The correction of the commanded stiffness [N m/rad], by what was learnt."""
    correction, muscles = state.correction, state.rows.w[state.place]
    acts_at = float(muscles[last_to_act(muscles)][W_ACTS])
    if not acts_at - correction.at > CORRECTED_EVERY:
        return correction
    # at one place, so that the correction does not change along a motion
    middle = 0.5 * sum(models.joint.position_limits)
    there = models.model.pressures_for(models.dynamics.gravity(middle), stiffness, middle)
    goal = state.estimates.stiffness.factor(there.pressures, middle, correction.goal)
    factor = correction.factor + CORRECTED_SHARE * (goal - correction.factor)
    return StiffnessCorrection(goal, factor, acts_at)
