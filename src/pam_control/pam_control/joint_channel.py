"""One joint under control: what holds for it, the state between its cycles, and one cycle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from pam_control.control_step import (
    JointTelemetry,
    Measurement,
    Moment,
    Motion,
    PlanRequest,
    PressurePlan,
)
from pam_control.feedback.loop_rows import D_AHEAD, D_POSITION, D_RATE, D_REFERENCE, D_SPEED
from pam_control.feedback.pid import Pid, PidGains
from pam_control.feedback.pressure_loop import MuscleLoop
from pam_control.joint_models import JointModels, Pair
from pam_control.joint_setup import JointSetup
from pam_control.laws.law import Guidance, GuideRequest, Start
from pam_control.limited import limited
from pam_control.references.reference_generator import ReferenceGenerator
from pam_control.references.spline import JointReference

SATURATED = frozenset({"torque", "pressure_rate", "valve"})  # what limits the torque


class Cycle(NamedTuple):
    """What a cycle is for all joints.

    Attributes
    ----------
    time, step : float
        Present time, and time since the last cycle [s].
    measurement : Measurement
        Corrected by what the rig file says about the sensors.
    references : ReferenceGenerator
        Gives the references of all joints.
    sinking : float or None
        Share of the pressures that is left while the air is let out slowly [-]; None otherwise.
    """

    time: float
    step: float
    measurement: Measurement
    references: ReferenceGenerator
    sinking: float | None


class _Planned(NamedTuple):
    """What the first part of a cycle leaves for the second one."""

    plan: PressurePlan
    reference: JointReference
    error: float
    clipped: list[str]


class JointChannel:
    """One joint under control.

    Nobody else changes its state.

    Parameters
    ----------
    models : JointModels
        What holds for the joint.
    loops : (MuscleLoop, MuscleLoop)
        Of agonist and antagonist.
    setup : JointSetup
        What is in force at the start.

    Attributes
    ----------
    models : JointModels
        What holds for the joint.
    loops : tuple of MuscleLoop
        Of agonist and antagonist, with what was learnt of their valves.
    """

    def __init__(
        self, models: JointModels, loops: tuple[MuscleLoop, MuscleLoop], setup: JointSetup
    ) -> None:
        self.models, self.loops = models, loops
        self._setup = setup
        self._pid = Pid()
        self._motion = Motion()
        self._desired: Pair = (math.nan, math.nan)
        self._sinking_from: Pair | None = None  # desired pressures when the lowering began [Pa]
        self._state = setup.law.init(models)
        self._telemetry = JointTelemetry()

    # --- what others may read ------------------------------------------------------------------

    @property
    def setup(self) -> JointSetup:
        """What is in force."""
        return self._setup

    @property
    def telemetry(self) -> JointTelemetry:
        """Of the last cycle."""
        return self._telemetry

    @property
    def motion(self) -> Motion:
        """The latest measured motion."""
        return self._motion

    @property
    def law_state(self) -> Any:
        """State of the control law, which alone knows what it contains."""
        return self._state

    @property
    def gains(self) -> PidGains:
        """Of the feedback at the present stiffness."""
        return self._setup.gains.at(self._setup.law.stiffness(self._state))

    @property
    def integral(self) -> float:
        """Of the feedback, in the unit of its output."""
        return self._pid.integral

    @property
    def late_position(self) -> float:
        """Learnt delay of the positions, in addition to the stated one [s]."""
        return max(self._setup.law.delay(self._state), 0.0)

    @property
    def late_pressures(self) -> float:
        """Learnt delay of the pressures, in addition to the stated one [s]."""
        return max(-self._setup.law.delay(self._state), 0.0)

    @property
    def late_commands(self) -> Pair:
        """Learnt delay of each valve's command, in addition to the stated one [s].

        A late sensor of the pressure makes the valve seem late.
        """
        pressures = self.late_pressures
        first, second = self.loops
        return max(first.late - pressures, 0.0), max(second.late - pressures, 0.0)

    # --- changes -------------------------------------------------------------------------------

    def use(self, setup: JointSetup) -> None:
        """Use another setup from the next cycle on."""
        self._setup = setup

    def forget_adaptation(self) -> None:
        """Forget what was learnt of the joint and its valves."""
        self._state = self._setup.law.forget(self.models, self._state)
        for loop in self.loops:
            loop.forget_adaptation()

    def take_over(self, position: float, pressures: Pair) -> None:
        """Begin at a measured position [rad], and keep the pressures [Pa] at first."""
        if self._setup.learner is not None:
            self._setup.learner.interrupt()
        self._motion, self._sinking_from = Motion(), None
        for loop in self.loops:
            loop.reset()
        self._state = self._setup.law.rest(self.models, self._state)
        self._desired = pressures
        self._begin(position)

    def begin_again(self) -> None:
        """Let the law begin anew from the pressures that the joint is desired to have."""
        self._begin(self._motion.position)

    def _begin(self, position: float) -> None:
        start = self._start(position)
        output, self._state = self._setup.law.begin(self.models, self._state, start)
        self._pid.reset(output)

    def resume(self) -> None:
        """Go on with a changed setup from the pressures that the joint is desired to have."""
        gains = self.gains
        found = self._setup.law.resume(self.models, self._state, self._start(self._motion.position))
        if found is None:
            self.begin_again()
            output = self._pid.integral
        else:
            output, self._state = found
        self._pid.continue_at(output, self._telemetry.error, gains)

    def _start(self, position: float) -> Start:
        setup = self._setup
        return Start(
            position,
            self._desired,
            setup.settings,
            self.gains,
            setup.adapts,
            self._telemetry.reference,
        )

    def guide(self, step: float, active: bool, held: bool, torque: float | None) -> Guidance:
        """What the law asks of the reference before a cycle; see `GuideRequest`."""
        request = GuideRequest(step, active, held, torque, self._motion, self._setup.settings)
        guidance, self._state = self._setup.law.guide(self.models, self._state, request)
        return guidance

    # --- one cycle -----------------------------------------------------------------------------

    def plan(
        self,
        cycle: Cycle,
        stiffness: float,
        torque: float | None,
        pressures: Pair,
        demands: Sequence[Any],
    ) -> None:
        """First part of a cycle: write what the pressure loops have to do.

        Parameters
        ----------
        cycle : Cycle
            The present one.
        stiffness : float
            Commanded [N m/rad].
        torque : float or None
            Commanded [N m]; None if no torque is commanded.
        pressures : (float, float)
            In the muscles [Pa].
        demands : two rows
            Of agonist and antagonist, see `loop_rows`.
        """
        setup, models = self._setup, self.models
        settings, gains, name = setup.settings, self.gains, models.name
        self._gains = gains
        measurement, references = cycle.measurement, cycle.references
        position = measurement.positions[models.joint.place]
        measured_at = measurement.pressure_time - settings.measurement_delay
        seen_at = measurement.position_time - settings.measurement_delay
        seen, now, acts = self._moments(cycle, measured_at, seen_at)
        if setup.learner is not None:
            setup.learner.follow(references.spline(name))
        before = self._motion
        self._motion = before.measured(
            position, measurement.position_time, settings.derivative_filter
        )
        fresh = self._motion.time - before.time if self._motion.time > before.time else 0.0
        error = seen.reference.position - position
        output = self._pid.output(error, fresh, gains)
        plan = self._sinking(cycle.sinking)
        if plan is None:
            request = PlanRequest(
                cycle.step,
                settings,
                gains,
                output,
                self._pid.integral,
                stiffness,
                torque,
                self._motion,
                fresh,
                pressures,
                self._desired,
                measured_at,
                seen,
                now,
                acts,
                references.motion[name],
                setup.adapts,
                setup.learner,
            )
            plan, self._state = setup.law.plan(models, self._state, request)
            self._pid.integral = plan.integral
        clipped = list(plan.telemetry.clipped)
        reach = settings.pressure_rate * cycle.step
        wanted, desired = plan.reference, self._desired
        self._desired = (
            limited(wanted[0], desired[0] - reach, desired[0] + reach),
            limited(wanted[1], desired[1] - reach, desired[1] + reach),
        )
        if self._desired != wanted:
            clipped.append("pressure_rate")
        for side, demand in enumerate(demands):
            ahead = acts[side].reference.position - seen.reference.position
            demand[D_REFERENCE], demand[D_RATE] = self._desired[side], plan.rate[side]
            demand[D_AHEAD], demand[D_POSITION] = plan.ahead[side], position + ahead
            demand[D_SPEED] = plan.velocities[side]
        self._planned = _Planned(plan, seen.reference, error, clipped)

    def finish(self, cycle: Cycle, is_cut: bool) -> None:
        """Second part of a cycle, when the valves are commanded; whether one was limited."""
        (plan, reference, error, clipped), setup = self._planned, self._setup
        if is_cut:
            clipped.append("valve")
        self._pid.integrate(
            error,
            cycle.step,
            self._gains,
            missed=plan.missed,
            limit=setup.integral_limit,
            # a stiffness out of reach costs no torque, so that the integrator may go on
            frozen=cycle.sinking is not None
            or (plan.missed == 0.0 and bool(clipped) and not SATURATED.isdisjoint(clipped)),
        )
        self._telemetry = JointTelemetry(
            reference,
            self._motion,
            error,
            self._desired,
            tuple(clipped),
            self.loops[0].behind_tube + self.loops[1].behind_tube,
            plan.telemetry,
        )

    def _moments(
        self, cycle: Cycle, measured_at: float, seen_at: float
    ) -> tuple[Moment, Moment, tuple[Moment, Moment]]:
        """When the position was seen, when the pressures were true, and when the valves act."""
        models, sample, name = self.models, cycle.references.sample, self.models.name
        delay = self._setup.law.delay(self._state)
        now_at = measured_at - models.pressure_lag - max(-delay, 0.0)
        seen_at -= models.position_delay
        seen_at -= max(delay, 0.0)
        delays, late = self._setup.acting_delays, self.late_commands
        acts = (cycle.time + delays[0] + late[0], cycle.time + delays[1] + late[1])
        now = Moment(now_at, sample(name, now_at))
        seen = now if seen_at == now_at else Moment(seen_at, sample(name, seen_at))
        first = Moment(acts[0], sample(name, acts[0]))
        second = first if acts[1] == acts[0] else Moment(acts[1], sample(name, acts[1]))
        return seen, now, (first, second)

    def _sinking(self, share: float | None) -> PressurePlan | None:
        """The plan of a joint whose air is let out slowly; None for every other joint."""
        if share is None:
            self._sinking_from = None
            return None
        if self._sinking_from is None:
            self._sinking_from = self._desired
        (first, second), still = self._sinking_from, (0.0, 0.0)
        telemetry = self._telemetry.law._replace(clipped=())
        pressures = (share * first, share * second)
        return PressurePlan(pressures, still, still, still, 0.0, self._pid.integral, telemetry)
