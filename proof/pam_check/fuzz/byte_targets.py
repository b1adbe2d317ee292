"""Fuzz targets that take bytes, for a coverage-guided fuzzer and for replaying its corpus.

`tools/fuzz.sh` runs them under atheris; the tests replay tests/data/fuzz_corpus. The bytes are
decoded one after another as a sequence of actions, so that a fuzzer can reach many states.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Final

from pam_check.fuzz.random_targets import ViolationError
from pam_driver.boards.pam_board.codec import (
    PROTOCOL_VERSION,
    BoardCode,
    BoardCodec,
    BoardCommand,
    BoardFault,
    BoardMessage,
    BoardState,
    FrameError,
    Heartbeat,
    Measurement,
    Status,
    ValveCommand,
)
from pam_driver.can_bus.bus import BusState, ReceivedFrame, SendOutcome
from pam_driver.driver import ActivationError, Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.pressure_plausibility import PressurePlausibility
from pam_driver.safety.states import OUTPUTS, SafetyState
from pam_driver.safety.valve_command_intake import (
    CommandRefusedError,
    NamedCommand,
    ValveCommandIntake,
)
from pam_model.rig import Rig, load_rig
from pam_model.robot import compose

ELBOW: Final = Path(__file__).parents[3] / "config/elbow.yaml"
PERIOD: Final = 0.002
_SETTLED: Final = 11  # cycles, longer than readings have to agree before a muscle counts as empty
_STEPS: Final = (0.0, PERIOD, PERIOD, 0.01, 0.05, 0.11, 0.6, 2.0)
_AGES: Final = (0.0, 0.0, 0.05, 0.099, 0.11, -0.005, -1.0, math.nan)
_NAMES: Final = ("elbow_flexor", "elbow_extensor", "elbow", "")


class Reader:
    """Reads values from the front of the bytes; gives zeros when they are used up."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    @property
    def empty(self) -> bool:
        """Whether nothing is left."""
        return self._at >= len(self._data)

    def bytes(self, count: int) -> bytes:
        """The next `count` bytes."""
        part = self._data[self._at : self._at + count]
        self._at += count
        return part.ljust(count, b"\0")

    def byte(self) -> int:
        """A number from 0 to 255."""
        return self.bytes(1)[0]

    def share(self) -> float:
        """A number from -1 to 1."""
        return (self.byte() - 128) / 128.0

    def number(self) -> float:
        """Any float, or one that is likely to reveal a mistake."""
        kind = self.byte()
        if kind < 128:
            return (kind - 64) / 60.0
        return float(struct.unpack("<d", self.bytes(8))[0])


@cache
def _codec() -> BoardCodec:
    return BoardCodec.from_dbc()


@cache
def _rig() -> Rig:
    return load_rig(ELBOW)


def frames(data: bytes) -> None:
    """The decoder gives a message or a FrameError, and a message can be encoded again."""
    reader, codec = Reader(data), _codec()
    while not reader.empty:
        identifier = int.from_bytes(reader.bytes(2), "little")
        payload = reader.bytes(identifier >> 11 if identifier >> 11 <= 8 else 8)
        identifier &= 0x7FF
        try:
            board, message = codec.decode(identifier, payload)
        except FrameError:
            continue
        again, encoded = codec.encode(board, message)
        # as text, since NaN is not equal to itself
        same = repr(codec.decode(again, encoded)[1]) == repr(message)
        if again != identifier or not same:
            raise ViolationError(f"{identifier:X} {payload.hex()} decodes to {message}")


def commands(data: bytes) -> None:
    """Valve commands are refused, or give fractions within full scale."""
    reader, rig = Reader(data), _rig()
    intake, now = ValveCommandIntake(rig, 0.1), 10.0
    while not reader.empty:
        now += PERIOD * reader.byte()
        command = _command(reader)
        try:
            fractions = intake.take(command, now)
        except CommandRefusedError as error:
            if intake.rejected[error.kind] < 1:
                raise ViolationError(f"{error} is not counted") from error
            continue
        if not all(-1.0 <= fraction <= 1.0 for fraction in fractions):
            raise ViolationError(f"{command} gives {fractions}")


def _command(reader: Reader) -> NamedCommand:
    shape = reader.byte()
    if shape < 160:
        return NamedCommand(_NAMES[:2], (reader.number(), reader.number()), (), (), 0.0)
    names = [_NAMES[reader.byte() % len(_NAMES)] for _ in range(shape % 4)]
    position, velocity, effort = (
        [reader.number() for _ in range(reader.byte() % 4)] for _ in range(3)
    )
    return NamedCommand(names, position, velocity, effort, _AGES[reader.byte() % len(_AGES)])


class _Watched:
    """A bus that the fuzzer writes; air may flow only while `allowed` is true."""

    def __init__(self) -> None:
        self.state = BusState.ERROR_ACTIVE
        self.outcome = SendOutcome.SENT
        self.waiting: list[ReceivedFrame] = []
        self.allowed: Callable[[], bool] = lambda: False
        self.lowering: Callable[[], bool] = lambda: False

    def receive_all(self, now: float) -> list[ReceivedFrame]:
        waiting, self.waiting = self.waiting, []
        return waiting

    def send(self, frame_id: int, data: bytes, now: float) -> SendOutcome:
        _, message = _codec().decode(frame_id, data)
        if isinstance(message, ValveCommand) and any(message.enable) and not self.allowed():
            fills = any(value > 0.0 for value in message.valves)
            if fills or not self.lowering():  # a stop of category 1 opens exhausts alone
                raise ViolationError("a valve command without a fresh command, or after a fault")
        return self.outcome


class _DriverRun:
    """One driver from its start, with the conditions that it must always fulfil."""

    def __init__(self, reader: Reader) -> None:
        self.reader = reader
        self.port = _Watched()
        self.port.allowed = self._may_move
        self.settings = DriverSettings()
        plausibility = PressurePlausibility(compose(_rig()), PERIOD)
        self.driver = Driver(_rig(), self.port, self.settings, plausibility)
        self.now = 100.0
        self.port.lowering = lambda: OUTPUTS[self.driver.state].lower
        self.armed = False  # activated since the last fault, vent or deactivation
        self.commanded = -math.inf
        self.counter = 0

    def _may_move(self) -> bool:
        fresh = self.now - self.commanded <= self.settings.command_timeout + 1e-9
        return self.armed and fresh and self.driver.state is SafetyState.ACTIVE

    def hear(self, message: BoardMessage) -> None:
        frame_id, data = _codec().encode(0, message)
        self.port.waiting.append(ReceivedFrame(frame_id, data, self.now))

    def cycle(self) -> None:
        self.now += _STEPS[self.reader.byte() % len(_STEPS)]
        self.driver.cycle(self.now, self.now)
        if self.driver.state in {SafetyState.FAULT, SafetyState.VENTED}:
            self.armed = False

    def healthy(self) -> None:
        """A board that follows the commands until its readings count, and a few cycles longer."""
        for _ in range(_SETTLED + self.reader.byte() % 8):
            self.now += PERIOD
            self.counter = (self.counter + 1) & 0xFF
            state = BoardState.ACTIVE if self._may_move() else BoardState.VENTED
            self.hear(Measurement((0.0, 0.0), 0.0, self.counter))
            self.hear(Status(state, BoardFault(0), self.counter, 701_320.0, 0))
            self.hear(Heartbeat(self.now, PROTOCOL_VERSION, 1))
            self.driver.cycle(self.now, self.now)
            if self.driver.state is SafetyState.FAULT:
                self.armed = False

    def any_message(self) -> None:
        """A well-formed frame with values from the fuzzer."""
        read, kind = self.reader, self.reader.byte() % 5
        self.counter = (self.counter + 1) & 0xFF
        if kind == 0:
            pressures = (5.5e5 + 6.4e5 * read.share(), 5.5e5 + 6.4e5 * read.share())
            self.hear(Measurement(pressures, 1.2 * read.share(), self.counter))
        elif kind == 1:
            state = BoardState(read.byte() % 4)
            faults = BoardFault((read.byte() + 256 * read.byte()) % (2 * max(BoardFault)))
            self.hear(Status(state, faults, read.byte(), 4e5 + 4e5 * read.share(), 0))
        elif kind == 2:
            self.hear(Heartbeat(100.0 * read.byte(), read.byte() % 3, 1))
        elif kind == 3:
            self.hear(BoardCommand(next(iter(BoardCode))))
        else:
            self.hear(ValveCommand((0.0, 0.0), (False, False), self.counter))

    def any_frame(self) -> None:
        """Put bytes on the bus."""
        identifier = int.from_bytes(self.reader.bytes(2), "little") & 0x7FF
        data = self.reader.bytes(self.reader.byte() % 9)
        stamp = self.now + (0.0, -1.0, 5.0)[self.reader.byte() % 3]
        self.port.waiting.append(ReceivedFrame(identifier, data, stamp))

    def activate(self) -> None:
        was = self.driver.state
        try:
            self.driver.activate(self.now)
        except ActivationError:
            return
        if was is SafetyState.FAULT:
            raise ViolationError("activated without clear_faults")
        self.armed = True

    def command(self) -> None:
        command = _command(self.reader)
        try:
            self.driver.set_commands(command, self.now)
        except CommandRefusedError:
            return
        self.commanded = max(self.commanded, self.now - command.age)

    def leave(self) -> None:
        kind = self.reader.byte() % 3
        if kind == 0:
            self.driver.clear_faults(self.now)
            return
        (self.driver.vent if kind == 1 else self.driver.deactivate)(self.now)
        self.armed = False

    def spoil_bus(self) -> None:
        self.port.state = BusState(self.reader.byte() % 5)
        self.port.outcome = SendOutcome(self.reader.byte() % 3)


def driver(data: bytes) -> None:
    """Driver, operator and bus act in any order: air flows only when it is allowed."""
    reader = Reader(data)
    run = _DriverRun(reader)
    acts = (
        run.healthy,
        run.healthy,
        run.cycle,
        run.any_message,
        run.any_frame,
        run.activate,
        run.command,
        run.leave,
        run.spoil_bus,
    )
    while not reader.empty:
        acts[reader.byte() % len(acts)]()


TARGETS: Final[Mapping[str, Callable[[bytes], None]]] = {
    "frames": frames,
    "commands": commands,
    "driver": driver,
}
