"""One cycle of the driver: measurements in, safety, set points out. No ROS, no clock of its own.

Only the I/O thread calls `cycle`; everything else may be called from another thread. The table in
`safety.states` decides whether air may move; this module finds out which events have happened.
"""

from __future__ import annotations

import math
import threading
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

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

_COMMANDABLE: Final = frozenset({SafetyState.READY, SafetyState.ACTIVE})


class ActivationError(PamError):
    """Activation refused; the message says why and what to do."""


class Snapshot(NamedTuple):
    """The result of one cycle, in the rig's order.

    Attributes
    ----------
    state : SafetyState
        State after the cycle.
    pressures : tuple of float
        By muscle [Pa gauge], NaN if not fresh.
    pressure_stamp : float
        Wall-clock time of the oldest of them [s], 0 if none is fresh.
    positions, velocities : tuple of float
        By joint [rad], [rad/s], NaN if not fresh.
    joint_stamp : float
        Wall-clock time of the oldest of them [s], 0 if none is fresh.
    sent : tuple of float
        Command by muscle as fraction of full scale, including the command to vent; empty if the
        bus did not accept it.
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
        Compares measurements with physics; without it, they are only compared with limits.
    wiring : RigWiring, optional
        Wiring of this rig; by default it is made with the default options of its kinds of board.

    Attributes
    ----------
    state : SafetyState
        Decides whether air may move.
    faults : tuple of Condition
        Why the state became `FAULT`; kept until cleared.
    conditions : tuple of Condition
        What is wrong now.
    intake : CommandIntake
        Checks commands and counts those that it refuses and accepts.

    Raises
    ------
    PamError
        If the rig does not say where a muscle or joint is wired, or names a bus that does not
        exist.
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
        self._ready_since = math.inf
        self._cleared_at = NEVER
        self._event(SafetyEvent.CONFIGURE, 0.0)

    @property
    def boards(self) -> Mapping[Address, Board]:
        """The boards, by the addresses that the rig file uses."""
        return self._boards.boards

    @property
    def boards_keep_fault(self) -> bool:
        """Whether every board reports that it keeps a fault of this driver."""
        return all(board.host_fault for board in self.boards.values())

    @property
    def suspicions(self) -> tuple[Condition, ...]:
        """Possible faults: deviations above the warning share of a plausibility limit."""
        return self._judge.suspicions

    @property
    def frame_errors(self) -> Counter[str]:
        """The number of frames that were not valid messages, by kind of error."""
        return self._boards.frame_errors

    @property
    def last_frame_error(self) -> dict[str, str]:
        """The last error of each kind."""
        return self._boards.last_frame_error

    @property
    def errors_by_bus(self) -> Mapping[str, tuple[Counter[str], dict[str, str]]]:
        """The same two for each bus, by its name."""
        return self._boards.errors_by_bus

    def set_commands(self, command: NamedCommand, now: float) -> None:
        """Use a valve command from the next cycle on.

        Raises
        ------
        CommandError
            If it is refused; the previous command stays in use until it is too old.
        """
        with self._lock:
            if self.state is SafetyState.FAULT:
                self.intake.refuse("not_active", "a fault is latched; clear it, then activate")
            if self.state not in _COMMANDABLE:
                reason = f"the driver is {self.state.value}; activate it first"
                self.intake.refuse("not_active", reason)
            if self.state is SafetyState.READY and now - command.age < self._ready_since:
                self.intake.refuse("not_active", "computed before the driver was activated")
            self._fractions = self.intake.take(command, now)
            self._command_time = now - command.age
            self._event(SafetyEvent.COMMAND, now)

    def missing_boards(self, now: float) -> list[str]:
        """Names of boards that do not send all frames that they should."""
        timeout = self._settings.board_timeout
        return [board.name for board in self.boards.values() if board.silent(now, timeout)]

    def activation_problem(self, now: float) -> str:
        """Why activation would be refused, as one line; empty if it would succeed."""
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
            If a board is missing or anything is wrong; then nothing has changed.
        """
        with self._lock:
            problem = self._activation_problem(now)
            if problem:
                raise ActivationError(problem)
            self._boards.acknowledge()
            self.intake.last_rejection = ""
            self._ready_since = now
            self._event(SafetyEvent.ACTIVATE, now)

    def deactivate(self, now: float) -> None:
        """Vent without raising a fault."""
        with self._lock:
            self._event(SafetyEvent.DEACTIVATE, now)

    def vent(self, now: float) -> None:
        """Vent at once; the frames are sent to the boards before this returns."""
        with self._lock:
            self._event(SafetyEvent.VENT, now)
            self._boards.vent(now)
            self._send_valve_commands(now)

    def clear_faults(self, now: float) -> None:
        """Clear the faults of the driver and the boards; moving still requires activation."""
        with self._lock:
            self._event(SafetyEvent.CLEAR_FAULTS, now)
            if self.state is SafetyState.VENTED:
                self._boards.clear_faults(now)
                self._cleared_at = now
                self.faults = ()
                self._boards.acknowledge()

    def close(self, now: float) -> None:
        """Vent and end; the port may be closed afterwards."""
        self.vent(now)
        with self._lock:
            self._event(SafetyEvent.CLEANUP, now)

    def cycle(self, now: float, wall_now: float) -> Snapshot:
        """Receive the frames that have arrived, judge them, and command every board.

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
            if found and self.state in _COMMANDABLE:
                self.faults = found
                self._event(SafetyEvent.FAULT, now)
            self._hear_latched_faults(now)
            if OUTPUTS[self.state].latch:
                self._boards.latch_fault(now)
            sent = self._send_valve_commands(now) if OUTPUTS[self.state].send else ()
            return snapshot._replace(state=self.state, sent=sent)

    def _event(self, event: SafetyEvent, now: float) -> None:
        """Change the state as the table says; the command is discarded when `ACTIVE` ends."""
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

    def _hear_latched_faults(self, now: float) -> None:
        """A fault that a board keeps, from an earlier run of this host, is a fault of this run."""
        held = self._boards.host_faults()
        # a board that was just told to clear its faults needs a moment to report it
        if held and now - self._cleared_at > self._settings.board_timeout:
            before = self.state
            self._event(SafetyEvent.LATCHED_FAULT, now)
            if self.state is not before:
                self.faults = held

    def _setpoints(self) -> tuple[float, ...] | None:
        """The set points of the valves; None while they vent."""
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
        """Command every board; returns what was sent, empty if one board could not be reached."""
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
