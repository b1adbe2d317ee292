"""One cycle of the driver: measurements in, safety, set points out. No ROS, no clock of its own.

`cycle` belongs to the I/O thread; everything else may be called from another one. What may move
air is decided by the table of `safety_state`; this module finds out what has happened.
"""

from __future__ import annotations

import math
import threading
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from pam_driver.board_set import BoardSet, Port
from pam_driver.boards.protocol import NEVER, Address, Board, Condition
from pam_driver.boards.wiring import RigWiring
from pam_driver.driver_settings import DriverSettings
from pam_driver.fault_judge import FaultJudge, Motion, Plausibility, Readings
from pam_driver.joint_velocity import JointVelocity
from pam_driver.safety.command_intake import CommandIntake, NamedCommand
from pam_driver.safety.states import OUTPUTS, SafetyEvent, SafetyState, next_state
from pam_model.errors import PamError
from pam_model.rig import Rig


class ActivationError(PamError):
    """Activation refused; the message says why and what to do."""


class Snapshot(NamedTuple):
    """What one cycle found, in the rig's order.

    Attributes
    ----------
    state : SafetyState
        After the cycle.
    pressures : tuple of float
        By muscle [Pa gauge], NaN if not fresh.
    pressure_stamp : float
        Wall-clock time of the oldest of them [s], 0 if none is fresh.
    positions, velocities : tuple of float
        By joint [rad], [rad/s], NaN if not fresh.
    joint_stamp : float
        Wall-clock time of the oldest of them [s], 0 if none is fresh.
    sent : tuple of float
        Command by muscle as fraction of full scale, those that vent included; empty if the bus
        did not take it.
    """

    state: SafetyState
    pressures: tuple[float, ...]
    pressure_stamp: float
    positions: tuple[float, ...]
    velocities: tuple[float, ...]
    joint_stamp: float
    sent: tuple[float, ...] = ()


class Driver:
    """The driver of one rig on its buses.

    Parameters
    ----------
    rig : Rig
        Every muscle needs board and channel, every joint an encoder.
    ports : Port, or mapping of str to Port
        The open bus; by name where the rig file names several.
    settings : DriverSettings
        Limits and time-outs.
    plausibility : Plausibility, optional
        Judges what is measured; without it, numbers are only held against limits.
    wiring : RigWiring, optional
        Of this rig; default with the kinds' own options.

    Attributes
    ----------
    state : SafetyState
        What may move.
    faults : tuple of Condition
        Why it went to `FAULT`; kept until cleared.
    conditions : tuple of Condition
        What is wrong now.
    intake : CommandIntake
        Refused and accepted commands.

    Raises
    ------
    PamError
        If the rig does not say where a muscle or joint is wired, or names a bus that is not there.
    """

    def __init__(
        self,
        rig: Rig,
        ports: Port | Mapping[str, Port],
        settings: DriverSettings,
        plausibility: Plausibility | None = None,
        wiring: RigWiring | None = None,
    ) -> None:
        self.rig = rig
        self.state = SafetyState.UNCONFIGURED
        self.faults: tuple[Condition, ...] = ()
        self.conditions: tuple[Condition, ...] = ()
        self.intake = CommandIntake(rig, settings.command_timeout)
        self._settings = settings
        self._velocity = tuple(
            JointVelocity(settings.velocity_bandwidth, settings.sensor_timeout) for _ in rig.joints
        )
        named = ports if isinstance(ports, Mapping) else {"": ports}
        self._boards = BoardSet(wiring or RigWiring(rig), named, self._velocity)
        self._vents = self.intake.vented
        self._judge = FaultJudge(rig, self._boards, settings, self._vents, plausibility)
        self._lock = threading.Lock()
        self._fractions: tuple[float, ...] | None = None
        self._command_time = NEVER
        self._active_since = math.inf
        self._event(SafetyEvent.CONFIGURE, 0.0)

    @property
    def boards(self) -> Mapping[Address, Board]:
        """The boards, as the rig file names them."""
        return self._boards.boards

    @property
    def suspicions(self) -> tuple[Condition, ...]:
        """What may be wrong: more than the warning share of a plausibility limit."""
        return self._judge.suspicions

    @property
    def frame_errors(self) -> Counter[str]:
        """Frames that were no message, by kind."""
        return self._boards.frame_errors

    @property
    def last_frame_error(self) -> dict[str, str]:
        """By the same kinds, the last of each."""
        return self._boards.last_frame_error

    def set_commands(self, command: NamedCommand, now: float) -> None:
        """Use a valve command from the next cycle on.

        Raises
        ------
        CommandError
            If it is refused; the command before stays until it is too old.
        """
        with self._lock:
            fractions = self.intake.take(command, now)
            if self.state in {SafetyState.READY, SafetyState.ACTIVE}:
                self._fractions = fractions
                self._command_time = now - command.age
                self._event(SafetyEvent.COMMAND, now)

    def missing_boards(self, now: float) -> list[str]:
        """Names of boards that do not send all that they should."""
        timeout = self._settings.board_timeout
        return [board.name for board in self.boards.values() if board.silent(now, timeout)]

    def activation_problem(self, now: float) -> str:
        """Why air must not move, as one line; empty if it may."""
        with self._lock:
            return self._activation_problem(now)

    def _activation_problem(self, now: float) -> str:
        if self.state is SafetyState.FAULT:
            reasons = "; ".join(str(fault) for fault in self.faults)
            return f"faults are latched, call ~/clear_faults: {reasons}"
        missing = self.missing_boards(now)
        if missing:
            return f"no answer from {', '.join(missing)}: check power, wiring and board numbers"
        return "; ".join(
            str(condition)
            for condition in self._conditions(now)
            if condition.kind != "board_restarted"
        )

    def activate(self, now: float) -> None:
        """Let air move from the next fresh command on.

        Raises
        ------
        ActivationError
            If a board is missing or anything is wrong; nothing has changed then.
        """
        with self._lock:
            problem = self._activation_problem(now)
            if problem:
                raise ActivationError(problem)
            self._boards.acknowledge()
            self._event(SafetyEvent.ACTIVATE, now)

    def deactivate(self, now: float) -> None:
        """Vent, without a fault."""
        with self._lock:
            self._event(SafetyEvent.DEACTIVATE, now)

    def vent(self, now: float) -> None:
        """Vent at once; boards are told before this returns."""
        with self._lock:
            self._event(SafetyEvent.VENT, now)
            self._boards.vent(now)
            self._send_valve_commands(now)

    def clear_faults(self, now: float) -> None:
        """Forget faults, here and on the boards; activation is still needed to move."""
        with self._lock:
            self._event(SafetyEvent.CLEAR_FAULTS, now)
            if self.state is SafetyState.VENTED:
                self._boards.clear_faults(now)
                self.faults = ()
                self._boards.acknowledge()

    def close(self, now: float) -> None:
        """Vent for good; the port may be closed after it."""
        self.vent(now)
        with self._lock:
            self._event(SafetyEvent.CLEANUP, now)

    def cycle(self, now: float, wall_now: float) -> Snapshot:
        """Take in what the bus brought, judge it, and command every board.

        Parameters
        ----------
        now : float
            Monotonic time [s].
        wall_now : float
            The same moment on the clock that stamps frames [s].
        """
        with self._lock:
            self._boards.receive(now, wall_now)
            snapshot = self._snapshot(now)
            readings = Readings(snapshot.pressures, snapshot.positions, snapshot.velocities)
            self._judge.judge(self._setpoints(), readings, now)
            found = tuple(self._conditions(now))
            self.conditions = found
            if found and self.state in {SafetyState.READY, SafetyState.ACTIVE}:
                self.faults = found
                self._event(SafetyEvent.FAULT, now)
            sent = self._send_valve_commands(now) if OUTPUTS[self.state].send else ()
            return snapshot._replace(state=self.state, sent=sent)

    def _event(self, event: SafetyEvent, now: float) -> None:
        """Follow the table; leaving `ACTIVE` forgets the command."""
        before = self.state
        self.state = next_state(before, event)
        if self.state is before:
            return
        if self.state is SafetyState.ACTIVE:
            self._active_since = now
        else:
            self._fractions = None
            self._active_since = math.inf
        if OUTPUTS[self.state].vent_on_entry and before is not SafetyState.UNCONFIGURED:
            self._boards.vent(now)

    def _setpoints(self) -> tuple[float, ...] | None:
        """What valves are to do; None while they vent."""
        return self._fractions if OUTPUTS[self.state].enable else None

    def _conditions(self, now: float) -> Iterator[Condition]:
        motion = Motion(
            self.state is SafetyState.ACTIVE,
            self._active_since,
            self._command_time,
            self.intake.last_rejection,
        )
        return self._judge.conditions(motion, now)

    def _send_valve_commands(self, now: float) -> tuple[float, ...]:
        """Command every board; what they were told, empty if one of them was not."""
        setpoints = self._setpoints()
        if not self._boards.command(setpoints, now):
            return ()
        return self._vents if setpoints is None else setpoints

    def _snapshot(self, now: float) -> Snapshot:
        oldest = now - self._settings.sensor_timeout
        pressures, pressure_stamps = [], []
        for samples, channel in self._boards.pressures:
            sample = samples[channel]
            fresh = sample.time >= oldest
            pressures.append(sample.value if fresh else math.nan)
            if fresh:
                pressure_stamps.append(sample.stamp)
        positions, velocities, joint_stamps = [], [], []
        for velocity, (samples, channel) in zip(self._velocity, self._boards.angles, strict=True):
            sample = samples[channel]
            fresh = sample.time >= oldest
            positions.append(sample.value if fresh else math.nan)
            velocities.append(velocity.value if fresh else math.nan)
            if fresh:
                joint_stamps.append(sample.stamp)
        return Snapshot(
            self.state,
            tuple(pressures),
            min(pressure_stamps, default=0.0),
            tuple(positions),
            tuple(velocities),
            min(joint_stamps, default=0.0),
        )
