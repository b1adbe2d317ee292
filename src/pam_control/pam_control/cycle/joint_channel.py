"""One joint under control: what holds for it, its law's state, and its part of a cycle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from pam_control.control_step import (
    JointTelemetry,
    MeasuredMotion,
    Moment,
    PlanRequest,
)
from pam_control.cycle.joint_cycle import (
    K_DELAY,
    K_FEEDBACK,
    K_GAINS,
    K_POSITION,
    K_STIFFNESS,
    K_TIME,
    K_VELOCITY,
    CycleRows,
)
from pam_control.cycle.pressure_loops import MuscleLoop
from pam_control.feedback.pid import F_INTEGRAL, PidGains, begin_feedback, continue_feedback
from pam_control.joint_models import JointModels, PerMuscle
from pam_control.joint_setup import JointSetup
from pam_control.laws.law import Guidance, GuideRequest, Start
from pam_control.references.motion_limiter import MotionLimits
from pam_control.rows.plan_rows import (
    W_ACTS,
    W_DESIRED,
    W_PRESSURE,
    W_REFERENCE,
    W_SPEED,
    X_DISTURBANCE,
    X_FRESH,
    X_INTEGRAL,
    X_MEASURED_AT,
    X_MISSED,
    X_NEW_INTEGRAL,
    X_NOW,
    X_OUTPUT,
    X_REACHED_STIFFNESS,
    X_REACHED_TORQUE,
    X_SEEN,
    X_STIFFNESS,
    X_STIFFNESS_LIMITED,
    X_TORQUE,
    X_TORQUE_LIMITED,
    X_TRUE_STIFFNESS,
    X_UNEXPLAINED,
)
from pam_control.rows.telemetry_rows import Z_DRIVEN, Z_ERROR, Z_YIELDS
from pam_model.plant.compiled import listed


class JointChannel:
    """One joint under control.

    Nobody else changes its state.

    Parameters
    ----------
    models : JointModels
        What holds for the joint.
    setup : JointSetup
        What is in force at the start.
    state
        Of its control law.

    Attributes
    ----------
    models : JointModels
        What holds for the joint.
    loops : tuple of MuscleLoop
        Of its muscles, with what was learnt of their valves.
    """

    def __init__(
        self,
        models: JointModels,
        loops: tuple[MuscleLoop, ...],
        setup: JointSetup,
        rows: CycleRows,
        state: Any,
    ) -> None:
        self.models, self.loops = models, loops
        self._setup, self._state = setup, state
        place = models.joint.place
        self._w, self._x, self._k = tuple(rows.w[place]), rows.x[place], rows.k[place]
        self._z = rows.z[place]
        self._sinking_from: PerMuscle | None = (
            None  # desired pressures when the lowering began [Pa]
        )
        self._stand()
        self._desire((math.nan,) * len(loops))

    @property
    def _desired(self) -> PerMuscle:
        """Desired pressures of the muscles [Pa]."""
        return tuple([float(muscle[W_DESIRED]) for muscle in self._w])

    def _desire(self, pressures: Sequence[float]) -> None:
        for muscle, pressure in zip(self._w, pressures, strict=True):
            muscle[W_DESIRED] = pressure

    def _stand(self) -> None:
        """No motion was measured."""
        self._k[K_POSITION] = self._k[K_TIME] = math.nan
        self._k[K_VELOCITY] = 0.0

    # --- what others may read ------------------------------------------------------------------

    @property
    def setup(self) -> JointSetup:
        """What is in force."""
        return self._setup

    @property
    def telemetry(self) -> JointTelemetry:
        """Of the last cycle."""
        return JointTelemetry.of(listed(self._z))

    @property
    def motion(self) -> MeasuredMotion:
        """The latest measured motion."""
        k = self._k
        return MeasuredMotion(float(k[K_POSITION]), float(k[K_VELOCITY]), float(k[K_TIME]))

    @property
    def law_state(self) -> Any:
        """State of the control law, which alone knows what it contains."""
        return self._state

    @property
    def gains(self) -> PidGains:
        """Of the feedback at the present stiffness."""
        return self._setup.gains.at(self._setup.law.stiffness(self._state))

    @property
    def stiffness_range(self) -> tuple[float, float]:
        """Least and greatest stiffness [N m/rad] at the present reference."""
        models, reference = self.models, self.telemetry.reference
        if math.isnan(reference.position):
            return math.nan, math.nan
        torque = models.torque(reference)
        low = models.model.pressures_for(torque, 0.0, reference.position)
        high = models.model.pressures_for(torque, 1e9, reference.position)
        return float(low.stiffness), float(high.stiffness)

    @property
    def integral(self) -> float:
        """Of the feedback, in the unit of its output."""
        return float(self._k[K_FEEDBACK + F_INTEGRAL])

    @property
    def late_position(self) -> float:
        """Learnt delay of the positions, in addition to the stated one [s]."""
        return max(self._setup.law.delay(self._state), 0.0)

    @property
    def late_pressures(self) -> float:
        """Learnt delay of the pressures, in addition to the stated one [s]."""
        return max(-self._setup.law.delay(self._state), 0.0)

    @property
    def late_commands(self) -> PerMuscle:
        """Learnt delay of each valve's command, in addition to the stated one [s].

        A late sensor of the pressure makes the valve seem late.
        """
        pressures = self.late_pressures
        return tuple(max(loop.late - pressures, 0.0) for loop in self.loops)

    # --- changes -------------------------------------------------------------------------------

    def use(self, setup: JointSetup) -> None:
        """Use another setup from the next cycle on."""
        self._setup = setup
        setup.law.use(self.models, self._state, setup.settings, setup.adapts)

    def forget_adaptation(self) -> None:
        """Forget what was learnt of the joint and its valves."""
        self._state = self._setup.law.forget(self.models, self._state)
        for loop in self.loops:
            loop.forget_adaptation()

    def take_over(self, position: float, pressures: PerMuscle) -> None:
        """Begin at a measured position [rad], and keep the pressures [Pa] at first."""
        if self._setup.learner is not None:
            self._setup.learner.interrupt()
        self._stand()
        self._sinking_from = None
        for loop in self.loops:
            loop.reset()
        self._state = self._setup.law.rest(self.models, self._state)
        self._desire(pressures)
        self._begin(position)

    def begin_again(self) -> None:
        """Let the law begin anew from the pressures that the joint is desired to have."""
        self._begin(self.motion.position)

    def _begin(self, position: float) -> None:
        start = self._start(position)
        output, self._state = self._setup.law.begin(self.models, self._state, start)
        begin_feedback(self._k, K_FEEDBACK, output)

    def resume(self) -> None:
        """Go on with a changed setup from the pressures that the joint is desired to have."""
        gains = self.gains
        start = self._start(self.motion.position)
        found = self._setup.law.resume(self.models, self._state, start)
        if found is None:
            self.begin_again()
            output = self.integral
        else:
            output, self._state = found
        for number, gain in enumerate(gains.row):
            self._k[K_GAINS + number] = gain
        continue_feedback(self._k, K_FEEDBACK, K_GAINS, output, float(self._z[Z_ERROR]))

    def _start(self, position: float) -> Start:
        setup = self._setup
        return Start(
            position,
            self._desired,
            setup.settings,
            self.gains,
            setup.adapts,
            self.telemetry.reference,
        )

    def guide(self, step: float, active: bool, held: bool, torque: float | None) -> Guidance:
        """What the law asks of the reference before a cycle; see `GuideRequest`."""
        request = GuideRequest(step, active, held, torque, self.motion, self._setup.settings)
        guidance, self._state = self._setup.law.guide(self.models, self._state, request)
        return guidance

    # --- one cycle -----------------------------------------------------------------------------

    def prepare(self) -> None:
        """Write what the cycle needs of the law's state."""
        law = self._setup.law
        self._k[K_STIFFNESS], self._k[K_DELAY] = law.stiffness(self._state), law.delay(self._state)

    def ask(self, stiffness: float) -> None:
        """Ask a law that plans all joints together for this stiffness [N m/rad]."""
        setup = self._setup
        self._state = setup.law.ask(
            self.models, self._state, stiffness, setup.settings, setup.adapts
        )

    def plan(
        self, step: float, stiffness: float, torque: float | None, limits: MotionLimits
    ) -> None:
        """Let the law plan one cycle.

        Parameters
        ----------
        step : float
            Time since the last cycle [s].
        stiffness : float
            Commanded [N m/rad].
        torque : float or None
            Commanded [N m]; None if no torque is commanded.
        limits : MotionLimits
            Which the reference keeps.
        """
        setup, x = self._setup, [float(number) for number in self._x]
        w = [[float(number) for number in row] for row in self._w]
        request = PlanRequest(
            step,
            setup.settings,
            PidGains(*(float(gain) for gain in self._k[K_GAINS:K_FEEDBACK])),
            x[X_OUTPUT],
            x[X_INTEGRAL],
            stiffness,
            torque,
            self.motion,
            x[X_FRESH],
            tuple(muscle[W_PRESSURE] for muscle in w),
            tuple(muscle[W_DESIRED] for muscle in w),
            x[X_MEASURED_AT],
            Moment.at(x, X_SEEN),
            Moment.at(x, X_NOW),
            tuple(Moment.at(muscle, W_ACTS) for muscle in w),
            limits,
            setup.adapts,
            setup.learner,
        )
        plan, self._state = setup.law.plan(self.models, self._state, request)
        columns = zip(plan.reference, plan.rate, plan.ahead, plan.velocities, strict=True)
        for muscle, planned in zip(self._w, columns, strict=True):
            muscle[W_REFERENCE : W_SPEED + 1] = planned
        self._x[X_MISSED], self._x[X_NEW_INTEGRAL] = plan.missed, plan.integral
        told = plan.telemetry
        self._x[X_TORQUE], self._x[X_STIFFNESS] = told.torque, told.stiffness
        self._x[X_REACHED_TORQUE] = told.torque_reached
        self._x[X_REACHED_STIFFNESS] = told.stiffness_reached
        self._x[X_TRUE_STIFFNESS], self._x[X_DISTURBANCE] = told.true_stiffness, told.disturbance
        self._x[X_TORQUE_LIMITED] = float("torque" in told.clipped)
        self._x[X_STIFFNESS_LIMITED] = float("stiffness" in told.clipped)
        self._x[X_UNEXPLAINED] = math.nan
        self._z[Z_YIELDS], self._z[Z_DRIVEN] = float(told.yields), float(told.driven)

    def sink(self, share: float | None) -> None:
        """Plan a joint whose air is let out slowly: a share of the pressures [-]; None: it is not.

        The feedback would hold it up until its pressures no longer suffice, and then drop it.
        """
        if share is None:
            self._sinking_from = None
            return
        if self._sinking_from is None:
            self._sinking_from = self._desired
        for muscle, pressure in zip(self._w, self._sinking_from, strict=True):
            muscle[W_REFERENCE : W_SPEED + 1] = share * pressure, 0.0, 0.0, 0.0
        self._x[X_MISSED], self._x[X_NEW_INTEGRAL] = 0.0, self.integral
        self._x[X_TORQUE_LIMITED] = 0.0
