"""One cycle of the driver: frames in, safety, frames out. No ROS, no clock of its own.

`cycle` belongs to the I/O thread; everything else may be called from another one. What may move
air is decided by the table of `safety_state`; this module finds out what has happened.
"""

from __future__ import annotations

import math
import threading
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple, Protocol

from pam_driver.boards.pam_board.codec import (
    CHANNELS,
    BoardCode,
    BoardCodec,
    BoardCommand,
    BoardState,
    FrameError,
    Heartbeat,
    Measurement,
    Status,
    ValveCommand,
)
from pam_driver.boards.pam_board.monitor import NEVER, BoardMonitor, Condition
from pam_driver.boards.wiring import RigWiring
from pam_driver.bus import BusState, ReceivedFrame, SendOutcome
from pam_driver.driver_settings import DriverSettings
from pam_driver.joint_velocity import JointVelocity
from pam_driver.safety.command_intake import CommandIntake, NamedCommand
from pam_driver.safety.pressure_plausibility import Deviation
from pam_driver.safety.sensor_checks import SensorChecks
from pam_driver.safety.states import OUTPUTS, SafetyEvent, SafetyState, next_state
from pam_model.errors import PamError
from pam_model.rig import Rig

# Another driver's command heard so long ago does not matter any more [s].
_FOREIGN_MEMORY: Final = 1.0
# Physics cannot be judged across a longer pause [s].
_STALL: Final = 0.02


class ActivationError(PamError):
    """Activation refused; the message says why and what to do."""


class Plausibility(Protocol):
    """Judges measurements by physics, see `pam_driver.safety.pressure_plausibility`."""

    period: float

    def update(
        self,
        commands: Sequence[float],
        pressures: Sequence[float],
        positions: Sequence[float],
        velocities: Sequence[float],
        supply_pressures: Sequence[float],
    ) -> None:
        """Go on by one cycle."""

    def deviations(self) -> Iterator[Deviation]:
        """What is off."""


class Port(Protocol):
    """What the driver needs of a bus, see `bus.CanPort`."""

    @property
    def state(self) -> BusState:
        """State of the bus."""

    def receive_all(self, now: float) -> list[ReceivedFrame]:
        """Frames that wait."""

    def send(self, frame_id: int, data: bytes, now: float) -> SendOutcome:
        """Send or drop."""


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
    """The driver of one rig on one bus.

    Parameters
    ----------
    rig : Rig
        Every muscle needs board and channel, every joint an encoder.
    codec : BoardCodec
        What bytes mean.
    port : Port
        An open bus.
    settings : DriverSettings
        Limits and time-outs.
    plausibility : Plausibility, optional
        Judges what is measured; without it, numbers are only held against limits.

    Attributes
    ----------
    state : SafetyState
        What may move.
    faults : tuple of Condition
        Why it went to `FAULT`; kept until cleared.
    conditions : tuple of Condition
        What is wrong now.
    suspicions : tuple of Condition
        What may be: more than the warning share of a plausibility limit.
    frame_errors : Counter
        Frames that were no message, by kind; `last_frame_error` has the last of each.
    intake : CommandIntake
        Refused and accepted commands.
    boards : dict of int to BoardMonitor
        By number.

    Raises
    ------
    PamError
        If the rig does not say where a muscle or joint is wired.
    """

    def __init__(
        self,
        rig: Rig,
        codec: BoardCodec,
        port: Port,
        settings: DriverSettings,
        plausibility: Plausibility | None = None,
    ) -> None:
        self.rig = rig
        self.wiring = RigWiring(rig, codec.board_count)
        self.state = SafetyState.UNCONFIGURED
        self.faults: tuple[Condition, ...] = ()
        self.conditions: tuple[Condition, ...] = ()
        self.suspicions: tuple[Condition, ...] = ()
        self.frame_errors: Counter[str] = Counter()
        self.last_frame_error: dict[str, str] = {}
        self.intake = CommandIntake(rig, settings.command_timeout)
        self.boards = {board: BoardMonitor(board) for board in self.wiring.boards}
        self._codec = codec
        self._port = port
        self._settings = settings
        self._lock = threading.Lock()
        self._fractions: tuple[float, ...] | None = None
        self._command_time = NEVER
        self._counter = 0
        self._drained_at = NEVER
        self._active_since = math.inf
        self._foreign_at = NEVER
        self._sent_at = dict.fromkeys(self.boards, NEVER)
        self._velocity = tuple(
            JointVelocity(settings.velocity_bandwidth, settings.sensor_timeout) for _ in rig.joints
        )
        self._plausibility = plausibility
        self._implausible: tuple[Condition, ...] = ()
        self._judged_at = NEVER
        self._checks = None if plausibility is None else SensorChecks(rig)
        self._vents = self.intake.vented
        self._limits = tuple(
            muscle.max_pressure + settings.over_pressure_margin for muscle in rig.muscles
        )
        self._event(SafetyEvent.CONFIGURE, 0.0)

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
        """Names of boards that do not send measurement, status and heartbeat."""
        timeout = self._settings.board_timeout
        return [board.name for board in self.boards.values() if not board.present(now, timeout)]

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
            for board in self.boards.values():
                board.acknowledge()
            self._event(SafetyEvent.ACTIVATE, now)

    def deactivate(self, now: float) -> None:
        """Vent, without a fault."""
        with self._lock:
            self._event(SafetyEvent.DEACTIVATE, now)

    def vent(self, now: float) -> None:
        """Vent at once; boards are told before this returns."""
        with self._lock:
            self._event(SafetyEvent.VENT, now)
            self._send_to_all(BoardCode.VENT, now)
            self._send_valve_commands(now)

    def clear_faults(self, now: float) -> None:
        """Forget faults, here and on the boards; activation is still needed to move."""
        with self._lock:
            self._event(SafetyEvent.CLEAR_FAULTS, now)
            if self.state is SafetyState.VENTED:
                self._send_to_all(BoardCode.CLEAR_FAULTS, now)
                self.faults = ()
                for board in self.boards.values():
                    board.acknowledge()

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
            self._receive(now, wall_now)
            snapshot = self._snapshot(now)
            if self._plausibility is not None:
                self._judge(self._plausibility, snapshot, now)
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
            self._send_to_all(BoardCode.VENT, now)

    def _receive(self, now: float, wall_now: float) -> None:
        # A frame drained now arrived after the last drain: this bounds its age when the wall
        # clock steps, and gives frames that waited during a stall their true age.
        longest = now - self._drained_at
        for frame in self._port.receive_all(now):
            age = min(max(wall_now - frame.stamp, 0.0), longest)
            self._hear(frame, now - age)
        self._drained_at = now

    def _hear(self, frame: ReceivedFrame, time: float) -> None:
        try:
            number, message = self._codec.decode(frame.frame_id, frame.data)
        except FrameError as error:
            self._count(error.kind, str(error))
            return
        board = self.boards.get(number)
        if board is None:
            self._count("unknown_board", f"frame 0x{frame.frame_id:03X}: board {number}")
        elif isinstance(message, Measurement):
            board.hear_measurement(message, time, frame.stamp)
            self._differentiate(board)
        elif isinstance(message, Status):
            board.hear_status(message, time)
        elif isinstance(message, Heartbeat):
            board.hear_heartbeat(message, time)
        else:
            self._count("foreign_command", f"frame 0x{frame.frame_id:03X} for board {number}")
            self._foreign_at = time

    def _count(self, kind: str, text: str) -> None:
        self.frame_errors[kind] += 1
        self.last_frame_error[kind] = text

    def _differentiate(self, board: BoardMonitor) -> None:
        joint = self.wiring.joint_of_board.get(board.board)
        if joint is not None:
            self._velocity[joint].update(board.position.value, board.position.time)

    def _judge(self, plausibility: Plausibility, snapshot: Snapshot, now: float) -> None:
        """Let the sensor checks and the physics see what was measured."""
        fractions = self._fractions if OUTPUTS[self.state].enable else None
        commands, supplies = [], []
        for index, (board, _) in enumerate(self.wiring.muscles):
            status = self.boards[board].status
            follows = status is not None and status.state is BoardState.ACTIVE
            commands.append(
                fractions[index] if fractions is not None and follows else self._vents[index]
            )
            supplies.append(math.nan if status is None else status.supply_pressure)
        # After a stall of this host or of the bus the physics would be late by it, and see a
        # fault that is none: it begins anew from what is measured.
        oldest = min(self.boards[board].pressures[c].time for board, c in self.wiring.muscles)
        stalled = now - min(oldest, self._judged_at) > max(_STALL, 10.0 * plausibility.period)
        self._judged_at = now
        unknown = (math.nan,) * len(snapshot.pressures)
        plausibility.update(
            commands,
            unknown if stalled else snapshot.pressures,
            snapshot.positions,
            snapshot.velocities,
            supplies,
        )
        found = list(plausibility.deviations())
        if self._checks is not None:
            pressures = [
                self.boards[board].pressures[channel] for board, channel in self.wiring.muscles
            ]
            positions = [self.boards[board].position for board in self.wiring.joints]
            found += self._checks.update(pressures, positions, supplies, now)
        self.suspicions = tuple(
            Condition(kind, subject, text) for kind, subject, size, text in found if size < 1.0
        )
        self._implausible = tuple(
            Condition(kind, subject, text) for kind, subject, size, text in found if size >= 1.0
        )

    def _conditions(self, now: float) -> Iterator[Condition]:
        """All that is wrong now; while air may move, any of it is a fault."""
        settings = self._settings
        state = self._port.state
        if state is BusState.DOWN:
            yield Condition("bus_down", "", "the CAN interface is down")
        elif state is BusState.BUS_OFF:
            yield Condition(
                "bus_off", "", "the CAN controller is bus-off: check wiring and bitrate"
            )
        if now - self._foreign_at < _FOREIGN_MEMORY:
            yield Condition("foreign_command", "", "another driver commands boards on this bus")
        moving = now - self._active_since > settings.board_timeout
        for board in self.boards.values():
            yield from board.conditions(
                now, settings.board_timeout, settings.sensor_timeout, moving
            )
        yield from self._sensor_conditions(now)
        yield from self._implausible
        if self.state is not SafetyState.ACTIVE:
            return
        age = now - self._command_time
        if age > settings.command_timeout:
            text = f"no valid command for {settings.command_timeout:g} s"
            if self.intake.last_rejection:
                text += f"; last refused: {self.intake.last_rejection}"
            yield Condition("command_timeout", "valve_commands", text)
        for number, sent_at in self._sent_at.items():
            if now - max(sent_at, self._active_since) > settings.command_timeout:
                text = f"nothing could be sent for {settings.command_timeout:g} s"
                yield Condition("send_blocked", self.boards[number].name, text)

    def _sensor_conditions(self, now: float) -> Iterator[Condition]:
        timeout = self._settings.sensor_timeout
        for index, (board, channel) in enumerate(self.wiring.muscles):
            sample = self.boards[board].pressures[channel]
            name = self.rig.muscles[index].name
            if now - sample.time > timeout:
                yield Condition("stale_sensor", name, f"no pressure for {timeout:g} s")
            elif sample.value > self._limits[index]:
                limit = self.rig.muscles[index].max_pressure
                text = f"{sample.value:.0f} Pa, max_pressure is {limit:.0f} Pa"
                yield Condition("over_pressure", name, text)
        for index, board in enumerate(self.wiring.joints):
            joint, sample = self.rig.joints[index], self.boards[board].position
            low, high = joint.position_limits
            margin = self.rig.plausibility.position_margin
            if now - sample.time > timeout:
                yield Condition("stale_sensor", joint.name, f"no angle for {timeout:g} s")
            elif not low - margin <= sample.value <= high + margin:
                text = f"at {sample.value:.3f} rad, position_limits are {low:g} to {high:g} rad"
                yield Condition("position_limit", joint.name, text)

    def _send_valve_commands(self, now: float) -> tuple[float, ...]:
        """Command every board; what they were told, empty if one of them was not."""
        fractions = self._fractions if OUTPUTS[self.state].enable else None
        self._counter = (self._counter + 1) & 0xFF
        told = self._vents if fractions is None else fractions
        for board, muscles in self.wiring.boards.items():
            values = [0.0] * CHANNELS
            enable = [False] * CHANNELS
            if fractions is not None:
                for channel, muscle in muscles:
                    values[channel] = fractions[muscle]
                    enable[channel] = True
            command = ValveCommand((values[0], values[1]), (enable[0], enable[1]), self._counter)
            frame_id, data = self._codec.encode(board, command)
            if self._port.send(frame_id, data, now) is SendOutcome.SENT:
                self._sent_at[board] = now
            else:
                told = ()
        return told

    def _send_to_all(self, code: BoardCode, now: float) -> None:
        for board in self.boards:
            self._port.send(*self._codec.encode(board, BoardCommand(code)), now)

    def _snapshot(self, now: float) -> Snapshot:
        oldest = now - self._settings.sensor_timeout
        pressures, pressure_stamps = [], []
        for board, channel in self.wiring.muscles:
            sample = self.boards[board].pressures[channel]
            fresh = sample.time >= oldest
            pressures.append(sample.value if fresh else math.nan)
            if fresh:
                pressure_stamps.append(sample.stamp)
        positions, velocities, joint_stamps = [], [], []
        for velocity, board in zip(self._velocity, self.wiring.joints, strict=True):
            sample = self.boards[board].position
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
