"""The rows of joints under the model-based law, and what Python adds to its compiled plan.

Python computes the fits of what is learnt, which are due from time to time; the statics of muscles
that are not in closed form; and the correction of a motion that is repeated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pam_control.adaptation.stiffness_estimate import StiffnessEstimate
from pam_control.adaptation.torque_adaptation import TorqueAdaptation
from pam_control.adaptation.varied_joint import JointOfRig
from pam_control.compensation.history_torque import begin_history
from pam_control.feedback.disturbance_observer import begin_observer
from pam_control.feedback.stuck_integral import begin_sticking
from pam_control.joint_models import PRESSURE_SHARE, JointModels
from pam_control.laws.position_plan import (
    AHEAD,
    AIM,
    NOW,
    OBSERVE,
    REACHED,
    RESUME,
    compares,
    plan_parts,
)
from pam_control.learning.motion_learner import MotionLearner
from pam_control.limited import limited
from pam_control.plan_memory import KEPT_BEFORE_MEASUREMENT, Rings
from pam_control.rows.plan_rows import (
    J_HAS_HISTORY,
    J_IN_CLOSED_FORM,
    J_KEPT,
    J_LAG,
    J_POSITION_HIGH,
    J_POSITION_LOW,
    J_PRESLIDING,
    N_CYCLE,
    N_JOINT,
    N_LEARNING,
    N_MUSCLE,
    N_PLAN,
    N_SETTINGS,
    P_MEASURED,
    P_PRESSURES,
    S_ADAPTATION_LIMIT,
    S_ADAPTS,
    S_FEEDFORWARD,
    S_OBSERVER_LIMIT,
    S_SPEED_FILTER,
    S_STIFFNESS_RATE,
    W_AT_SEEN,
    W_BEFORE,
    W_HIGH,
    W_LAGGING,
    W_LINE,
    W_LOW,
    W_MOST,
    W_REACHED,
    X_ASKED_POSITION,
    X_ASKED_STIFFNESS,
    X_ASKED_TORQUE,
    X_BASE,
    X_BESIDE,
    X_CORRECTION,
    X_ESTIMATE_DUE,
    X_EXPLAINED,
    X_GRIP,
    X_INSIDE,
    X_IS_DUE,
    X_LAGGING_INSIDE,
    X_MEASURED_AT,
    X_OBSERVER,
    X_POSITION,
    X_REACHED_STIFFNESS,
    X_REACHED_TORQUE,
    X_SEEN,
    X_STIFFNESS_LIMITED,
    X_TORQUE_BEFORE,
    X_TORQUE_LAGGING,
    X_TORQUE_LIMITED,
    X_TORQUE_SEEN,
    X_USUAL,
    Y_ADAPTED,
    Y_GRIP,
    Y_HANDED,
    Y_LAGGING,
    Y_LAGGING_SPEED,
    Y_SINCE_ESTIMATE,
    Y_STIFFNESS,
)
from pam_control.settings import ControlSettings
from pam_model.effects.slots import PullState
from pam_model.joints.muscle_inverse import L_RATIO
from pam_model.plant.compiled import for_kernel, listed_column, prepare
from pam_model.plant.layout import N_MUSCLE_STATES
from pam_model.views.joint_numbers import is_closed_form, joint_numbers


@dataclass(frozen=True, slots=True)
class Estimates:
    """What is learnt of one joint; each part is changed in place."""

    adaptation: TorqueAdaptation  # of the torque along a motion
    stiffness: StiffnessEstimate  # of the numbers of the rig file

    @classmethod
    def of(cls, models: JointModels, y: Any, a: Any) -> Estimates:
        """Nothing is known of the joint but its models; `y` and `a` are its rows."""
        robot, joint, dynamics = models.robot, models.joint, models.dynamics
        inertia, damping = dynamics.moving_torque(0.0, 1.0), dynamics.moving_torque(1.0, 0.0)
        return cls(
            TorqueAdaptation(y, a, inertia, damping, models.scale.torque, models.turn),
            StiffnessEstimate(
                JointOfRig(robot.rig, robot.rig.joints[joint.place]),
                models.model,
                dynamics,
                models.scale.torque,
                models.turn + 0.5 / len(robot.joints),
            ),
        )

    def forget(self) -> None:
        """What was learnt is forgotten."""
        self.adaptation.forget()
        self.stiffness.forget()


class PositionRows:
    """Joints under the model-based law.

    Attributes
    ----------
    c, j, s, w, x, y, a, memory
        Rows of all joints, see `plan_parts`.
    plans, samples : Rings
        What was planned and what was measured.
    estimates : list of Estimates
        What is learnt of each joint.
    """

    def __init__(self, joints: Sequence[JointModels]) -> None:
        count, self._joints = len(joints), joints
        numbers = joint_numbers(joints[0].robot)
        self.c = for_kernel(numbers[[models.joint.place for models in joints]])
        self.j = for_kernel(np.array([_numbers(m, c) for m, c in zip(joints, self.c, strict=True)]))
        self._open = [k for k, row in enumerate(self.j) if row[J_IN_CLOSED_FORM] == 0.0]
        self.s = for_kernel(np.zeros((count, N_SETTINGS)))
        self.w = for_kernel(np.array([_muscles(models) for models in joints]))
        self.x = for_kernel(np.zeros((count, N_CYCLE)))
        self.y = for_kernel(np.zeros((count, N_PLAN)))
        self.a = for_kernel(np.zeros((count, N_LEARNING)))
        muscles = len(self.w[0])
        self.memory = for_kernel(np.zeros((count, muscles * N_MUSCLE_STATES)))
        self.plans = Rings(count, P_PRESSURES + muscles)
        self.samples = Rings(count, P_MEASURED + muscles)
        self.estimates = [
            Estimates.of(models, y, a) for models, y, a in zip(joints, self.y, self.a, strict=True)
        ]
        self._turn = 0  # the joint that has built something last
        for place in range(count):
            self.y[place][Y_STIFFNESS] = math.nan
            self.rest(place)
        prepare(plan_parts, OBSERVE, NOW, *self._rows(0, count, 0.0))

    def _rows(self, begin: int, end: int, step: float) -> tuple[Any, ...]:
        """The arguments of `plan_parts` after the parts."""
        return (
            begin, end, step, self.c, self.j, self.s, self.w, self.x, self.y, self.a, self.memory,
            self.plans.rows, self.plans.ends, self.samples.rows, self.samples.ends,
        )  # fmt: skip

    def rest(self, place: int) -> None:
        """A joint is taken over; what was learnt of it stays."""
        y, estimates = self.y[place], self.estimates[place]
        self.x[place][X_EXPLAINED] = math.nan
        begin_observer(y, 0.0, 0.0)
        begin_sticking(y)
        begin_history(y, self.memory[place])
        y[Y_ADAPTED], y[Y_LAGGING], y[Y_LAGGING_SPEED] = 0.0, math.nan, math.nan
        y[Y_HANDED] = 0.0
        self.plans.clear(place)
        self.samples.clear(place)
        estimates.adaptation.restart()
        estimates.stiffness.restart()
        y[Y_SINCE_ESTIMATE] = estimates.stiffness.since

    def use(self, place: int, settings: ControlSettings, adapts: bool) -> None:
        """Use these settings of a joint, and what was learnt or not, from the next cycle on."""
        s, joint = self.s[place], self._joints[place].joint
        s[S_FEEDFORWARD], s[S_ADAPTS] = float(settings.feedforward), float(adapts)
        s[S_STIFFNESS_RATE] = min(settings.stiffness_rate, joint.max_stiffness_rate)
        s[S_ADAPTATION_LIMIT] = settings.adaptation_limit
        s[S_OBSERVER_LIMIT], s[S_SPEED_FILTER] = settings.observer_limit, settings.derivative_filter

    def plan(
        self, begin: int, end: int, step: float, learners: Mapping[int, MotionLearner]
    ) -> None:
        """Plan one cycle of the joints from `begin` to before `end`, after a step [s].

        Parameters
        ----------
        begin, end : int
            The joints, whose `X_OUTPUT` and its like are written.
        step : float
            Time since the last cycle [s].
        learners : mapping of int to MotionLearner
            Of the joints whose motion is learnt.
        """
        self.plans.make_room()
        self.samples.make_room()
        rows = self._rows(begin, end, step)
        others = [k for k in self._open if begin <= k < end]
        in_parts = bool(others or learners)
        if in_parts:
            plan_parts(OBSERVE, OBSERVE, *rows)
            for place in others:
                self._measured_torques(place)
            for place, learner in learners.items():
                self._repeat(place, learner)
            plan_parts(AHEAD, AHEAD, *rows)
            for place in others:
                if self.s[place][S_FEEDFORWARD] > 0.0:
                    self._reach(place)
                    models, position = self._joints[place], float(self.x[place][X_ASKED_POSITION])
                    self.y[place][Y_GRIP] = models.model.grip(
                        self.column(place, W_REACHED), models.inside(position)
                    )
            is_due = plan_parts(NOW, NOW, *rows)
        else:
            is_due = plan_parts(OBSERVE, REACHED, *rows)
        for place in range(begin, end):
            self.estimates[place].stiffness.go_on()
        self._rebuild(step)
        if is_due:
            self._learn(begin, end)
        if others:
            plan_parts(AIM, AIM, *rows)
            for place in others:
                self._reach(place)
            plan_parts(REACHED, REACHED, *rows)
        elif in_parts:
            plan_parts(AIM, REACHED, *rows)
        elif is_due:
            plan_parts(RESUME, REACHED, *rows)

    def _rebuild(self, step: float) -> None:
        """Let one joint do a part of what takes long, in turns."""
        count = len(self.estimates)
        for _ in range(count):
            self._turn = (self._turn + 1) % count
            stiffness = self.estimates[self._turn].stiffness
            if stiffness.rebuilds:
                stiffness.rebuild(step)
                return

    def _learn(self, begin: int, end: int) -> None:
        """Update the fits that are due of the joints from `begin` to before `end`."""
        fits, estimates = listed_column(self.x, X_IS_DUE), listed_column(self.x, X_ESTIMATE_DUE)
        for place in range(begin, end):
            if estimates[place] > 0.0:
                x, y, stiffness = self.x[place], self.y[place], self.estimates[place].stiffness
                stiffness.since = float(y[Y_SINCE_ESTIMATE])
                aligned = self.column(place, W_LAGGING)
                stiffness.learn(0.0, aligned, float(x[X_LAGGING_INSIDE]), float(x[X_BESIDE]))
                y[Y_SINCE_ESTIMATE] = stiffness.since
            if fits[place] > 0.0:
                self.estimates[place].adaptation.update()

    def column(self, place: int, column: int) -> tuple[float, ...]:
        """A column of the rows of a joint's muscles, such as `W_PRESSURE`."""
        return tuple(float(muscle[column]) for muscle in self.w[place])

    def _measured_torques(self, place: int) -> None:
        x, s, model = self.x[place], self.s[place], self._joints[place].model
        if s[S_FEEDFORWARD] == 0.0:
            return
        if x[X_OBSERVER] > 0.0:
            x[X_TORQUE_SEEN] = model.torque(self.column(place, W_AT_SEEN), float(x[X_INSIDE]))
        if compares(s, x):
            both = self.column(place, W_LAGGING), self.column(place, W_BEFORE)
            x[X_TORQUE_LAGGING], x[X_TORQUE_BEFORE] = model.torques(
                both, float(x[X_LAGGING_INSIDE])
            )
            x[X_GRIP] = model.grip(both[0], float(x[X_LAGGING_INSIDE]))

    def _reach(self, place: int) -> None:
        w, x = self.w[place], self.x[place]
        found = self._joints[place].model.pressures_for(
            float(x[X_ASKED_TORQUE]), float(x[X_ASKED_STIFFNESS]), float(x[X_ASKED_POSITION])
        )
        for muscle, pressure in zip(w, found.pressures, strict=True):
            muscle[W_REACHED] = pressure
        x[X_REACHED_TORQUE], x[X_REACHED_STIFFNESS] = found.torque, found.stiffness
        x[X_TORQUE_LIMITED] = float(found.torque_limited)
        x[X_STIFFNESS_LIMITED] = float(found.stiffness_limited)

    def _repeat(self, place: int, learner: MotionLearner) -> None:
        """The torque of the adaptation and the learnt correction for a repeated motion [N m]."""
        x, at = self.x[place], float(self.x[place][X_MEASURED_AT])
        if self.s[place][S_FEEDFORWARD] == 0.0:
            return
        base, correction = learner.torque(at, float(x[X_USUAL]))
        seen, limit = float(x[X_SEEN + 1]), float(self.s[place][S_ADAPTATION_LIMIT])
        learner.record(at, seen - float(x[X_POSITION]), base, seen)
        x[X_BASE], x[X_CORRECTION] = base, limited(correction, -limit, limit)


def _numbers(models: JointModels, c: Any) -> list[float]:
    """The row `J_POSITION_LOW` and its like of a joint."""
    row = [0.0] * N_JOINT
    model = models.model
    row[J_POSITION_LOW], row[J_POSITION_HIGH] = model.position_range
    row[J_LAG], row[J_PRESLIDING] = models.pressure_lag, models.dry_friction.presliding
    row[J_KEPT] = models.position_delay + KEPT_BEFORE_MEASUREMENT
    row[J_IN_CLOSED_FORM] = float(is_closed_form(c))
    remembers = any(muscle.laws(PullState) for muscle in models.muscles)
    row[J_HAS_HISTORY] = float(remembers or bool(models.dry_friction.laws))
    return row


def _muscles(models: JointModels) -> list[list[float]]:
    """The rows `W_LOW` and its like of the muscles of a joint."""
    rows, statics = [], models.model
    for muscle, one, ratio in zip(models.muscles, statics.muscles, statics.ratios, strict=True):
        row = [0.0] * N_MUSCLE
        row[W_LOW], row[W_HIGH] = one.low_pressure, one.high_pressure
        row[W_LINE + L_RATIO] = ratio
        row[W_MOST] = PRESSURE_SHARE * muscle.max_pressure
        rows.append(row)
    return rows
