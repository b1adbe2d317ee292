"""Base of all control laws: references, ages, bumpless start, PID, pressure loops, limits.

A control law adds the method that plans the pressures of a joint's two muscles. `step` takes a
measurement and returns valve commands. There is no ROS, no clock and no thread here.

The caller gives the time in seconds. The feedback compares a measurement with the reference at the
time of that measurement. The feedforward is computed for the time at which the valve will act,
which is later by a known delay. Therefore a delay reduces the phase margin of the loop but causes
no tracking error.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence

from pam_control.adaptation.torque_adaptation import LONGEST_DELAY
from pam_control.control_step import (
    ControlOutput,
    Measurement,
    PlanRequest,
    PressurePlan,
    missing_measurement,
)
from pam_control.drivable_limits import DrivableLimits
from pam_control.feedback.kept_designs import KeptDesigns
from pam_control.feedback.pid import PidGains
from pam_control.feedback.pressure_loop import PressureDemand, PressureLoopSettings
from pam_control.joint_channel import JointChannel, Pair, acting_delays
from pam_control.limited import limited
from pam_control.loop_design import LoopDesign, Loops, PreparedSettings
from pam_control.loop_guard import LoopGuard, Verdict
from pam_control.lowering import Lowering, LoweringPhase
from pam_control.references.reference_generator import ReferenceGenerator
from pam_control.references.trajectory import CommandError
from pam_control.settings import ControlSettings
from pam_model.joints.sensor_correction import SensorCorrection
from pam_model.rig import Rig

SATURATED = frozenset({"torque", "pressure_rate", "valve"})  # what limits the torque
LONGEST_STEP = 0.02  # s; a longer time between two steps is counted as this
GAP_PERIODS = 3.0  # plus the unknown delay; a step that is later follows a pause of the loop


class Controller(LoopDesign):
    """A control law for all joints of a rig.

    Parameters
    ----------
    rig : Rig
        What is controlled.
    settings : ControlSettings
        Gains that are missing in it are designed here.
    designs : KeptDesigns, optional
        Store of designed gains for equal joints and later starts; by default in memory only.

    Raises
    ------
    ControlDesignError
        When a loop would be unstable or have less than 30 degrees of phase margin.
    """

    def __init__(
        self, rig: Rig, settings: ControlSettings, designs: KeptDesigns | None = None
    ) -> None:
        super().__init__(rig, settings, designs)
        self._limits = DrivableLimits(self.robot)
        self.reduced_speed = rig.people.full_speed_topic
        self._slow = self.reduced_speed  # what the references keep
        self.references = ReferenceGenerator(
            {joint.name: joint.position_limits for joint in rig.joints},
            {
                channel.joint.name: self._limits.at(
                    channel, channel.scale.complete(settings).default_stiffness, reduced=self._slow
                )
                for channel in self.channels
            },
            max_velocities={joint.name: joint.max_velocity for joint in rig.joints},
            start_margin=rig.plausibility.position_margin,
        )
        self.correction = SensorCorrection(self.robot)
        self.stiffness_commands = self._default_stiffness(settings)
        self.active = False
        self._time = math.nan
        self._late: list[Pair] = []
        self.guard = LoopGuard(self.channels)
        self.lowering = Lowering(self.channels)
        self.use(self.prepared)

    # --- settings ---------------------------------------------------------------------------------

    def prepare(self, settings: ControlSettings) -> PreparedSettings:
        """Design and check other settings, which may take minutes; nothing changes yet.

        Raises
        ------
        ControlDesignError
            When a loop would not be safe.
        """
        self.foresee_stiffness(self._default_stiffness(settings))
        return super().prepare(settings)

    def change(self, settings: ControlSettings) -> None:
        """Use other settings from the next step on; missing gains are designed again.

        Raises
        ------
        ControlDesignError
            When a loop would not be safe; the present settings are kept.
        """
        self.use(self.prepare(settings))

    def use(self, prepared: PreparedSettings) -> None:
        """Use prepared settings from the next step on, without a jump of the desired pressures."""
        before = self._default_stiffness(self.prepared.asked)
        self.prepared = prepared
        after = self._default_stiffness(prepared.asked)
        if after != before and self.stiffness_commands == before:  # none was commanded
            self.stiffness_commands = after
            self._drive()
        self._apply((self.guard.softened and prepared.soft) or prepared.normal)

    @property
    def adapts(self) -> bool:
        """Whether the joints and the valves are learnt."""
        return self.settings.adaptation and self.has_adaptation

    @property
    def can_soften(self) -> bool:
        """Whether there are soft gains for these settings."""
        return self.prepared.soft is not None

    def _apply(self, loops: Loops) -> None:
        """Use these loops from the next step on, without a jump of the desired pressures."""
        for channel, found in zip(self.channels, loops.margins, strict=True):
            channel.margins = found
        self.settings = settings = loops.settings
        if not settings.adaptation:
            self.forget_adaptation()
        session = None if loops.soft else self.prepared.learning
        for channel in self.channels:
            channel.learner = session.learners[channel.joint.name] if session else None
            channel.acting_delays = acting_delays(channel, settings)
        self.references.stream_timeout = settings.stream_timeout
        self.references.stream_bandwidth = settings.stream_bandwidth
        self.references.allow_nonzero_end_velocity = settings.allow_nonzero_end_velocity
        # the reference is needed until the slowest valve acts, and back to the oldest measurement
        self._told_horizon = max(
            (max(channel.acting_delays) for channel in self.channels), default=0.0
        )
        self.references.horizon = max(self.references.horizon, self._told_horizon)
        self.references.keep(
            settings.stale_after
            + settings.measurement_delay
            + 2.0 * LONGEST_DELAY  # of the sensors, and of the commands in the horizon
            + max((channel.position_delay for channel in self.channels), default=0.0)
            + max((channel.pressure_lag for channel in self.channels), default=0.0)
        )
        if self.active:
            for index, channel in enumerate(self.channels):
                self._continue(index, channel)

    # --- commands -------------------------------------------------------------------------------

    @property
    def measured(self) -> dict[str, float]:
        """Where the joints are [rad], by name; NaN where that is not known."""
        return {channel.joint.name: channel.position for channel in self.channels}

    def set_stiffness(self, values: Sequence[float]) -> None:
        """Set the commanded stiffness of every joint [N m/rad].

        Raises
        ------
        CommandError
            For a wrong size, or a value that is not finite or not above 0; nothing is changed.
        """
        if len(values) != len(self.channels):
            raise CommandError(
                f"stiffness command rejected: {len(values)} values for {len(self.channels)} joints"
            )
        for channel, value in zip(self.channels, values, strict=True):
            if not (math.isfinite(value) and value > 0.0):
                raise CommandError(
                    f"stiffness command rejected: {channel.joint.name} at {value} N m/rad"
                )
        self.stiffness_commands = [float(value) for value in values]
        self._drive()

    def set_torques(self, values: Sequence[float], now: float) -> None:
        """Set the torque of every joint [N m]; only the law `torque` takes them.

        Parameters
        ----------
        values : sequence of float
            In the rig's order.
        now : float
            Present time [s].

        Raises
        ------
        CommandError
            When this law takes no torques, or for values that cannot be used.
        """
        raise CommandError("torque command rejected: only law torque takes torques")

    def foresees(self, values: Sequence[float]) -> bool:
        """Whether the limits for these stiffnesses [N m/rad] are known already."""
        return all(
            not math.isfinite(value) or self._limits.knows(channel, value)
            for channel, value in zip(self.channels, values, strict=False)
        )

    def foresee_stiffness(self, values: Sequence[float]) -> None:
        """Compute limits for stiffnesses [N m/rad] that will be commanded; needs no lock."""
        for channel, value in zip(self.channels, values, strict=False):
            if math.isfinite(value):
                self._limits.at(channel, value)

    def _drive(self) -> None:
        """Limit the references to what the valves can drive at the commanded stiffnesses."""
        for channel, stiffness in zip(self.channels, self.stiffness_commands, strict=True):
            limits = self._limits.at(channel, stiffness, reduced=self._slow)
            self.references.limit(channel.joint.name, limits)

    def stiffness_range(self, index: int) -> Pair:
        """Least and greatest stiffness [N m/rad] of joint `index` at its present reference."""
        channel = self.channels[index]
        reference = channel.telemetry.reference
        if math.isnan(reference.position):
            return math.nan, math.nan
        torque = channel.dynamics.torque(reference)
        low = channel.model.pressures_for(torque, 0.0, reference.position)
        high = channel.model.pressures_for(torque, 1e9, reference.position)
        return float(low.stiffness), float(high.stiffness)

    # --- running --------------------------------------------------------------------------------

    def drop_commands(self) -> None:
        """Stop, and forget the stiffness that was commanded; references are dropped in any case."""
        self.deactivate()
        if self.guard.softened:
            self._apply(self.prepared.normal)
        self.guard.clear()
        self.stiffness_commands = self._default_stiffness(self.settings)
        self._drive()

    def _default_stiffness(self, settings: ControlSettings) -> list[float]:
        return [each.scale.complete(settings).default_stiffness for each in self.channels]

    def _integral_limit(self, channel: JointChannel) -> float:
        """Limit of the PID's integral, in the unit of its output."""
        return channel.scale.complete(self.settings).integral_limit

    def _gains(self, channel: JointChannel) -> PidGains:
        """The gains of a joint at its present stiffness."""
        return self.settings.gains[channel.joint.name].at(channel.telemetry.stiffness)

    def forget_adaptation(self) -> None:
        """Forget what was learnt of the joints and the valves."""
        for channel in self.channels:
            channel.forget_adaptation()

    def stop(self, now: float) -> None:
        """Brake all joints within their limits and hold them (stop category 2).

        Parameters
        ----------
        now : float
            Present time [s].
        """
        if self.lowering.phase in (LoweringPhase.SINKING, LoweringPhase.DONE):
            self.deactivate()  # holds where the joints have sunk to
        self.lowering.cancel()
        self.references.stop([], now)

    def lower(self, now: float) -> None:
        """Brake all joints, let their air out slowly, then stop (stop category 1).

        Parameters
        ----------
        now : float
            Present time [s].
        """
        self.references.stop([], now)
        self.lowering.start()

    def reduce_speed(self, reduced: bool, now: float) -> None:
        """Keep the joints' `reduced_velocity`, or no longer.

        Either change brakes the joints and holds them (stop category 2), so that no reference
        becomes faster by itself.

        Parameters
        ----------
        reduced : bool
            Whether full speed is not permitted.
        now : float
            Present time [s].
        """
        if reduced != self.reduced_speed:
            self.reduced_speed = reduced
            self.references.stop([], now)

    def _change_speed(self) -> None:
        """Use the other limit of speed as soon as all references have braked below it."""
        limits = [
            self._limits.at(channel, stiffness, reduced=self.reduced_speed)
            for channel, stiffness in zip(self.channels, self.stiffness_commands, strict=True)
        ]
        if all(
            self.references.speed(channel.joint.name) <= limit.velocity
            for channel, limit in zip(self.channels, limits, strict=True)
        ):
            self._slow = self.reduced_speed
            self._drive()

    def reason_against_references(self) -> str:
        """Why no references are taken now; empty if they are."""
        if self._slow != self.reduced_speed:
            return "the joints brake, because another speed is permitted now"
        if self.lowering.phase is not LoweringPhase.OFF:
            return "the joints are being lowered"
        return self.guard.stopped

    def reason_against_motion(self) -> str:
        """Why this law follows no trajectories and no streams; empty if it does."""
        return ""

    def deactivate(self) -> None:
        """Stop; the next step starts without a jump from the state that is measured then."""
        self.active = False
        self.lowering.cancel()

    def step(self, time: float, measurement: Measurement) -> ControlOutput:
        """One control cycle.

        Parameters
        ----------
        time : float
            Present time [s].
        measurement : Measurement
            The latest measurement.

        Returns
        -------
        ControlOutput
            Commands; or none and the reason, if a measurement is missing or older than
            `stale_after`.
        """
        reason = self.guard.stopped or missing_measurement(
            time, measurement, self.rig, self.channels, self.settings.stale_after
        )
        if reason:
            self.active = False
            return ControlOutput(None, reason)
        measurement = Measurement(
            self.correction.positions(measurement.positions),
            self.correction.pressures(measurement.pressures),
            measurement.position_time,
            measurement.pressure_time,
        )
        if not self.active or time < self._time:
            self._take_over(time, measurement)
        normal = self.prepared.normal.settings
        longest = GAP_PERIODS * normal.period + normal.extra_delay
        if self.guard.watch_gaps(time, time - self._time, longest):
            self.deactivate()
            return ControlOutput(None, self.guard.stopped)
        step = min(max(time - self._time, 0.0), LONGEST_STEP) or self.settings.period
        self._time = time
        self._look_ahead(step)
        self.references.advance(time)
        if self._slow != self.reduced_speed:
            self._change_speed()
        self.reservoir.advance(step)
        commands = [math.nan] * len(self.rig.muscles)
        for index in range(len(self.channels)):
            self._joint_step(index, time, step, measurement, commands)
        self.lowering.advance(time, self.settings.lowering_time, measurement.pressures)
        if self.lowering.phase is LoweringPhase.DONE:
            self.guard.stopped = "lowered as asked for"
            self.deactivate()
            return ControlOutput(None, self.guard.stopped)
        if self.lowering.phase is LoweringPhase.SINKING:
            return ControlOutput(tuple(commands))
        match self.guard.judge(time, self.settings.tracking_time, self.can_soften):
            case Verdict.SOFTEN if self.prepared.soft is not None:
                self._apply(self.prepared.soft)
            case Verdict.STOP:
                self.deactivate()
                return ControlOutput(None, self.guard.stopped)
        return ControlOutput(tuple(commands))

    def _look_ahead(self, step: float) -> None:
        """Let the references reach ahead by the delay of the commands, stated and learnt."""
        self._late = [channel.late_commands for channel in self.channels]
        late = max(map(max, self._late), default=0.0)
        # it shrinks more slowly than time goes on, so that no reference is changed again
        shrunk = self.references.horizon - 0.5 * step
        self.references.horizon = max(self._told_horizon + late, shrunk)

    def _take_over(self, time: float, measurement: Measurement) -> None:
        """Start from the measured state: hold the positions and keep the pressures at first."""
        self._time = time - self.settings.period
        self.references.hold(
            {
                channel.joint.name: float(position)
                for channel, position in zip(self.channels, measurement.positions, strict=True)
            }
        )
        self.reservoir.reset()
        for index, channel in enumerate(self.channels):
            channel.reset()
            a, b = (max(float(measurement.pressures[i]), 0.0) for i in channel.indices)
            channel.desired = (a, b)
            self._begin(index, channel, float(measurement.positions[index]), (a, b))
        self.guard.restart()
        self.active = True

    @abstractmethod
    def _begin(self, index: int, channel: JointChannel, position: float, pressures: Pair) -> None:
        """Initialise the law's state so that its first desired pressures are the measured ones."""

    def _continue(self, index: int, channel: JointChannel) -> None:
        """Go on with changed settings from the desired pressures that the joint has now."""
        gains, error = self._gains(channel), channel.telemetry.error
        self._begin(index, channel, channel.position, channel.desired)
        channel.pid.continue_at(channel.pid.integral, error, gains)

    @abstractmethod
    def _plan(self, request: PlanRequest) -> PressurePlan:
        """Plan the pressures of one joint and fill the law's part of its telemetry."""

    @staticmethod
    def _sinking(channel: JointChannel) -> PressurePlan | None:
        """The plan of a joint whose air is let out slowly; None for every other joint."""
        if channel.sinking_from is None:
            return None
        share, still = channel.sinking_share, (0.0, 0.0)
        first, second = channel.sinking_from
        channel.telemetry.clipped = ()
        return PressurePlan((share * first, share * second), still, still, still, 0.0)

    def _joint_step(
        self,
        index: int,
        time: float,
        step: float,
        measurement: Measurement,
        commands: list[float],
    ) -> None:
        settings, channel = self.settings, self.channels[index]
        name = channel.joint.name
        position = measurement.positions[index]
        pressures = [
            loop.inside(measurement.pressures[i], step)
            for loop, i in zip(channel.loops, channel.indices, strict=True)
        ]
        gains = self._gains(channel)
        measured_at = measurement.pressure_time - settings.measurement_delay
        now_at = measured_at - channel.pressure_lag - channel.late_pressures
        seen_at = measurement.position_time - settings.measurement_delay - channel.position_delay
        seen_at -= channel.late_position
        told, late, sample = channel.acting_delays, self._late[index], self.references.sample
        acts = (time + told[0] + late[0], time + told[1] + late[1])
        acts_at = max(acts)
        now = sample(name, now_at)
        seen = now if seen_at == now_at else sample(name, seen_at)
        then = sample(name, acts_at)
        thens = [then if at == acts_at else sample(name, at) for at in acts]
        if channel.learner is not None:
            channel.learner.follow(self.references.spline(name))
        fresh = channel.measure(position, measurement.position_time, settings.derivative_filter)
        error = seen.position - position
        output = channel.pid.output(error, fresh, gains)
        plan = self._sinking(channel) or self._plan(
            PlanRequest(
                index,
                channel,
                output,
                now,
                then,
                measured_at,
                acts_at,
                now_at,
                acts,
                (thens[0].velocity, thens[1].velocity),
                step,
                seen,
                seen_at,
                fresh,
                (pressures[0], pressures[1]),
            )
        )
        clipped = list(channel.telemetry.clipped)
        reach = settings.pressure_rate * step
        (first, second), (wanted, other) = channel.desired, plan.reference
        channel.desired = (
            limited(wanted, first - reach, first + reach),
            limited(other, second - reach, second + reach),
        )
        if channel.desired != (wanted, other):
            clipped.append("pressure_rate")
        loop_settings = PressureLoopSettings(
            settings.pressure_gain or 0.0,
            settings.lead_ratio,
            settings.spool_limit,
            self.adapts,
            time + max(told) - measured_at + channel.pressure_lag,
        )
        channel.valve_clipped = False
        for side in (0, 1):
            arm = channel.joint.arms[side]
            ahead = thens[side].position - seen.position
            demand = PressureDemand(
                channel.desired[side],
                plan.rate[side],
                plan.ahead[side],
                channel.model.lengths(position + ahead)[side],
                -arm.length * plan.velocities[side],
            )
            command, cut = channel.loops[side].command(demand, pressures[side], loop_settings, step)
            commands[channel.indices[side]] = command
            channel.valve_clipped = channel.valve_clipped or cut
        if channel.valve_clipped:
            clipped.append("valve")
        channel.pid.integrate(
            error,
            step,
            gains,
            missed=plan.missed,
            limit=self._integral_limit(channel),
            # a stiffness out of reach costs no torque, so that the integrator may go on
            frozen=channel.sinking_from is not None
            or (plan.missed == 0.0 and bool(clipped) and not SATURATED.isdisjoint(clipped)),
        )
        telemetry = channel.telemetry
        telemetry.reference, telemetry.error = seen, error
        telemetry.pressures = channel.desired
        telemetry.clipped = tuple(clipped)
