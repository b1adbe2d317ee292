"""The controller of all joints of a robot: settings, commands, stops, and one control cycle.

`step` takes a measurement and returns valve commands and telemetry. There is no ROS, no clock and
no thread here. What the pressures of a joint's muscles are is up to the control law (`laws`); the
cycle of all joints is in `control_cycle`.

The caller gives the time in seconds. The feedback compares a measurement with the reference at the
time of that measurement. The feedforward is computed for the time at which the valve will act,
which is later by a known delay. Therefore a delay reduces the phase margin of the loop but causes
no tracking error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from pam_control.adaptation.torque_adaptation import LONGEST_DELAY
from pam_control.control_step import (
    ControlOutput,
    JointTelemetry,
    Measurement,
    missing_measurement,
)
from pam_control.cycle.control_cycle import ControlCycle
from pam_control.feedback.kept_designs import KeptDesigns
from pam_control.feedback.supply_reservoir import SupplyReservoir
from pam_control.joint_models import JointModels
from pam_control.joint_setup import joint_setups
from pam_control.laws.law import AnyLaw
from pam_control.laws.position_stiffness import PositionStiffness
from pam_control.loop_design import LoopDesign
from pam_control.loop_guard import GuardAction, LoopGuard
from pam_control.prepared_settings import Loops, PreparedSettings
from pam_control.reference_limits import ReferenceLimits
from pam_control.reference_lowering import LoweringPhase, ReferenceLowering
from pam_control.references.reference_generator import ReferenceGenerator
from pam_control.references.trajectory import CommandError
from pam_control.settings import ControlSettings
from pam_control.torque_commands import TorqueCommands
from pam_model.errors import PamError
from pam_model.joints.sensor_correction import SensorCorrection
from pam_model.plant.compiled import listed
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_model.views.pull_over_travel import refuse_slack_muscles

LONGEST_STEP: Final = 0.02  # s; a longer time between two steps is counted as this
GAP_PERIODS: Final = 3.0  # plus the unknown delay; a step that is later follows a pause of the loop
MODEL_BASED: Final = PositionStiffness()


class Controller:
    """Controls all joints of a rig by one control law.

    Parameters
    ----------
    rig : Rig
        What is controlled.
    settings : ControlSettings
        Gains that are missing in it are designed here.
    designs : KeptDesigns, optional
        Store of designed gains for equal joints and later starts; by default in memory only.
    law : Law, optional
        The control law with its own parameters; by default the model-based one.

    Attributes
    ----------
    channels : list of JointChannel
        The joints, with their models and the telemetry of the last cycle.
    settings : ControlSettings
        In force; no gain is missing.
    limits : ReferenceLimits
        The stiffness that is commanded and the speed that is permitted.
    guard : LoopGuard
        Why soft gains are used, and why the controller has stopped.
    active : bool
        Whether the joints are controlled.

    Raises
    ------
    ControlDesignError
        When a loop would be unstable or have less than 30 degrees of phase margin.
    RigError
        If a muscle cannot pull at some angle.
    """

    def __init__(
        self,
        rig: Rig,
        settings: ControlSettings,
        designs: KeptDesigns | None = None,
        law: AnyLaw = MODEL_BASED,
    ) -> None:
        self.rig = rig
        self.designs = designs or KeptDesigns()
        self.robot = compose(rig)
        refuse_slack_muscles(self.robot)
        self._models = [
            JointModels.of(self.robot, joint, settings.min_pressure) for joint in self.robot.joints
        ]
        self.prepared = self._design(law).prepared(settings)
        self.settings = self.prepared.normal.settings
        self.reservoir = SupplyReservoir(self.robot)
        stiffnesses = self._default_stiffness(settings)
        self.limits = ReferenceLimits(rig, self.robot, self._models, stiffnesses)
        setups = joint_setups(self._models, self.prepared, self.prepared.normal)
        self._cycle = ControlCycle(self._models, self.reservoir, law, setups, self.references)
        self.channels = self._cycle.channels
        self.correction = SensorCorrection(self.robot)
        self.active = False
        self._held = False  # a stop was asked for since the joints were taken over
        self._torques = TorqueCommands(rig.joint_names)
        self._time = math.nan
        self._told_horizon = 0.0
        self.guard = LoopGuard(self.robot.joints)
        self.lowering = ReferenceLowering()
        self.use(self.prepared)

    # --- settings ---------------------------------------------------------------------------------

    @property
    def design(self) -> LoopDesign:
        """Designs and checks the gains of the law."""
        return self._design(self.prepared.law)

    def _design(self, law: AnyLaw) -> LoopDesign:
        return LoopDesign(self.rig, self._models, law, self.designs)

    def is_quick(self, settings: ControlSettings, law: AnyLaw | None = None) -> bool:
        """Whether `prepare` only copies: it designs, checks and reads nothing."""
        return self._design(law or self.prepared.law).is_quick(settings, self.prepared)

    def prepare(self, settings: ControlSettings, law: AnyLaw | None = None) -> PreparedSettings:
        """Design and check other settings, which may take minutes; nothing changes yet.

        Parameters
        ----------
        settings : ControlSettings
            The others.
        law : Law, optional
            The present law with other parameters; by default with the same ones.

        Raises
        ------
        ControlDesignError
            When a loop would not be safe.
        PamError
            For another law: a state of one has no meaning for another.
        """
        law = law or self.prepared.law
        if type(law) is not type(self.prepared.law):
            raise PamError(f"law = {law.name!r}: can only be changed by a restart")
        self.limits.foresee(self._default_stiffness(settings))
        return self._design(law).changed(settings, self.prepared)

    def change(self, settings: ControlSettings, law: AnyLaw | None = None) -> None:
        """Use other settings from the next step on; missing gains are designed again.

        Raises
        ------
        ControlDesignError
            When a loop would not be safe; the present settings are kept.
        """
        self.use(self.prepare(settings, law))

    def use(self, prepared: PreparedSettings) -> None:
        """Use prepared settings from the next step on, without a jump of the desired pressures."""
        before = self._default_stiffness(self.prepared.asked)
        self.prepared = prepared
        after = self._default_stiffness(prepared.asked)
        if after != before and self.stiffness_commands == before:  # none was commanded
            self.limits.use(after)
        self._apply(self.prepared.loops(self.guard))

    def _apply(self, loops: Loops) -> None:
        """Use these loops from the next step on, without a jump of the desired pressures."""
        self.settings = settings = loops.settings
        self._means, normal = self.prepared.means, self.prepared.normal.settings
        self._longest_gap = GAP_PERIODS * normal.period + normal.extra_delay
        setups = joint_setups(self._models, self.prepared, loops)
        self._cycle.use(setups)
        if not settings.adaptation:
            self.forget_adaptation()
        references = self.references
        references.stream_timeout = settings.stream_timeout
        references.stream_bandwidth = settings.stream_bandwidth
        references.allow_nonzero_end_velocity = settings.allow_nonzero_end_velocity
        # the reference is needed until the slowest valve acts, and back to the oldest measurement
        self._told_horizon = max(
            (max(channel.setup.acting_delays) for channel in self.channels), default=0.0
        )
        references.horizon = max(references.horizon, self._told_horizon)
        references.keep(
            settings.stale_after
            + settings.measurement_delay
            + 2.0 * LONGEST_DELAY  # of the sensors, and of the commands in the horizon
            + max((models.position_delay for models in self._models), default=0.0)
            + max((models.pressure_lag for models in self._models), default=0.0)
        )
        if self.active:
            for channel in self.channels:
                channel.resume()

    def forget_adaptation(self) -> None:
        """Forget what was learnt of the joints and the valves."""
        for channel in self.channels:
            channel.forget_adaptation()

    # --- commands -------------------------------------------------------------------------------

    @property
    def references(self) -> ReferenceGenerator:
        """Of all joints."""
        return self.limits.references

    @property
    def measured(self) -> dict[str, float]:
        """Where the joints are [rad], by name; NaN where that is not known."""
        return {channel.models.name: channel.motion.position for channel in self.channels}

    @property
    def telemetry(self) -> list[JointTelemetry]:
        """Of every joint, from the last cycle."""
        return list(map(JointTelemetry.of, self.telemetry_rows))

    @property
    def telemetry_rows(self) -> list[list[float]]:
        """The same as rows of numbers (`telemetry_rows`), which takes less time."""
        return listed(self._cycle.telemetry)

    @property
    def stiffness_commands(self) -> list[float]:
        """Commanded stiffness of every joint [N m/rad]."""
        return self.limits.stiffnesses

    def set_stiffness(self, values: Sequence[float]) -> None:
        """Set the commanded stiffness of every joint [N m/rad].

        Raises
        ------
        CommandError
            For a wrong size, or a value that is not finite or not above 0; nothing is changed.
        """
        self.limits.command(values)

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
        if not self.prepared.law.takes_torques:
            raise CommandError("torque command rejected: only law torque takes torques")
        self._torques.command(values, now)

    def _default_stiffness(self, settings: ControlSettings) -> list[float]:
        return [each.scale.complete(settings).default_stiffness for each in self._models]

    # --- stops ----------------------------------------------------------------------------------

    def drop_commands(self) -> None:
        """Stop, and forget the stiffness that was commanded; references are dropped in any case."""
        self.deactivate()
        changed = self.guard.softened or self.guard.lowered
        self.guard.clear()
        if changed:
            self._apply(self.prepared.normal)
        self.limits.use(self._default_stiffness(self.settings))

    def stop(self, now: float) -> None:
        """Brake all joints within their limits and hold them (stop category 2).

        Parameters
        ----------
        now : float
            Present time [s].
        """
        self._torques.drop()
        self._held = True
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
        self._torques.drop()
        self._held = True
        self.references.stop([], now)
        self.lowering.start()

    def deactivate(self) -> None:
        """Stop; the next step starts without a jump from the state that is measured then."""
        self._torques.drop()
        self.active = False
        self.lowering.cancel()

    def reason_against_references(self) -> str:
        """Why no references are taken now; empty if they are."""
        if self.limits.braking:
            return "the joints brake, because another speed is permitted now"
        if self.lowering.phase is not LoweringPhase.OFF:
            return "the joints are being lowered"
        return self.guard.stopped

    def reason_against_motion(self) -> str:
        """Why this law follows no trajectories and no streams; empty if it does."""
        return self.prepared.law.against_motion

    # --- running --------------------------------------------------------------------------------

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
        torques = self._torques.at(time, self.settings.stream_timeout)
        if self.prepared.law.guides:
            self._guide(time, torques)
        reason = self.guard.stopped or missing_measurement(
            time, measurement, self.rig, self._models, self.settings.stale_after
        )
        if reason:
            self.active = False
            return ControlOutput(None, reason)
        if not self.active or time < self._time:
            self._take_over(time, measurement)
        gone = time - self._time
        if gone > self._longest_gap and self.guard.watch_gaps(time, gone, self._longest_gap):
            return self._stopped()
        step = min(max(gone, 0.0), LONGEST_STEP) or self.settings.period
        self._time = time
        self._look_ahead(step, self._cycle.begin())
        self.references.advance(time)
        self.limits.advance()
        self.reservoir.advance(step)
        commands = self._cycle.commands(
            time,
            step,
            measurement,
            self.settings,
            self.stiffness_commands,
            torques,
            self.lowering.share,
        )
        return self._judged(time, commands, measurement)

    def _judged(
        self, time: float, commands: tuple[float, ...], measurement: Measurement
    ) -> ControlOutput:
        """The output of a cycle, unless its telemetry shows that the joints have to stop."""
        telemetry = self._cycle.telemetry
        output = ControlOutput(commands, rows=np.array(telemetry))
        if self.lowering.phase is not LoweringPhase.OFF:
            pressures = self.correction.pressures(measurement.pressures)
            pressures = [pressures[i] for m in self._models for i in m.joint.muscles]
            self.lowering.advance(time, self.settings.lowering_time, self.telemetry, pressures)
            if self.lowering.phase is LoweringPhase.DONE:
                self.guard.stopped = "lowered as asked for"
                return self._stopped()
            if self.lowering.phase is LoweringPhase.SINKING:
                return output
        match self.guard.judge(time, telemetry, self.settings.tracking_time, self._means):
            case GuardAction.LOWER | GuardAction.SOFTEN as action:
                if action is GuardAction.SOFTEN:
                    self.forget_adaptation()  # the oscillation is in it
                self._apply(self.prepared.loops(self.guard))
            case GuardAction.STOP:
                return self._stopped()
        return output

    def _stopped(self) -> ControlOutput:
        self.deactivate()
        return ControlOutput(None, self.guard.stopped)

    def _guide(self, time: float, torques: Sequence[float | None]) -> None:
        """Let the law lead or stop the references of joints that others move."""
        step = min(max(time - self._time, 0.0), LONGEST_STEP)
        for channel, torque in zip(self.channels, torques, strict=True):
            guidance = channel.guide(step, self.active, self._held, torque)
            if guidance.lead is not None:
                self.references.lead(channel.models.name, guidance.lead)
            if guidance.restart:
                self.references.stop([channel.models.name], time)
                channel.begin_again()

    def _look_ahead(self, step: float, late: float) -> None:
        """Let the references reach ahead by the delay of the commands, stated and learnt [s]."""
        # it shrinks more slowly than time goes on, so that no reference is changed again
        shrunk = self.references.horizon - 0.5 * step
        self.references.horizon = max(self._told_horizon + late, shrunk)

    def _take_over(self, time: float, measurement: Measurement) -> None:
        """Start from the measured state: hold the positions and keep the pressures at first."""
        self._time = time - self.settings.period
        positions = self.correction.positions(measurement.positions)
        measured = self.correction.pressures(measurement.pressures)
        self.references.hold(dict(zip(self.rig.joint_names, positions, strict=True)))
        self.reservoir.reset()
        for channel, position in zip(self.channels, positions, strict=True):
            pressures = (max(measured[i], 0.0) for i in channel.models.joint.muscles)
            channel.take_over(position, tuple(pressures))
        self.guard.restart()
        self._held = False
        self.active = True
