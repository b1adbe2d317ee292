"""A driver whose bus is written by hand, on clocks whose every limit can be met exactly."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from types import SimpleNamespace
from typing import Any

from pam_driver.boards.pam_board.codec import (
    PROTOCOL_VERSION,
    BoardCode,
    BoardCodec,
    BoardCommand,
    BoardFault,
    BoardState,
    Heartbeat,
    Measurement,
    Status,
    ValveCommand,
)
from pam_driver.can_bus.bus import BusState, ReceivedFrame, SendOutcome
from pam_driver.driver import Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.pressure_plausibility import Deviation
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_model.rig import Rig
from support.commands import offer

NAMES = ("elbow_flexor", "elbow_extensor")
GOOD = (0.25, -0.5)
# sums of powers of two, so that every limit can be met exactly
TICK = 2.0**-9
SETTINGS = DriverSettings(command_timeout=0.125, sensor_timeout=0.0625, board_timeout=0.5)
SUPPLY = 701_320.0
SETTLED = 16  # ticks, until readings of the pressures count as a change of the state


class RecordingPort:
    """A port that gives what it is filled with and remembers what was asked of it."""

    def __init__(self, codec: BoardCodec) -> None:
        self.codec = codec
        self.state = BusState.ERROR_ACTIVE
        self.outcome = SendOutcome.SENT
        self.waiting: list[ReceivedFrame] = []
        self.sent: list[tuple[int, Any, float]] = []
        self.counters: dict[int, int] = {}  # by board, of the last valve command
        self.received_at: list[float] = []

    def receive_all(self, now: float) -> list[ReceivedFrame]:
        self.received_at.append(now)
        waiting, self.waiting = self.waiting, []
        return waiting

    def send(self, frame_id: int, data: bytes, now: float) -> SendOutcome:
        assert isinstance(now, float)
        board, message = self.codec.decode(frame_id, data)
        self.sent.append((board, message, now))
        if isinstance(message, ValveCommand):
            self.counters[board] = message.counter
        return self.outcome


class Judge:
    """A judge of measurements that remembers them and finds what it is told to find."""

    period = TICK

    def __init__(self) -> None:
        self.seen: list[SimpleNamespace] = []
        self.finds: list[Deviation] = []
        self.restarts = 0

    def restart(self) -> None:
        self.restarts += 1

    def update(
        self,
        commands: Sequence[float],
        pressures: Sequence[float],
        positions: Sequence[float],
        velocities: Sequence[float],
        supply_pressures: Sequence[float],
    ) -> None:
        self.seen.append(
            SimpleNamespace(
                commands=tuple(commands),
                pressures=tuple(pressures),
                positions=tuple(positions),
                velocities=tuple(velocities),
                supplies=tuple(supply_pressures),
            )
        )

    def deviations(self) -> Iterator[Deviation]:
        return iter(self.finds)


class ExactBench:
    """A driver whose bus is written by hand; one step is one tick, the wall clock 1000 s ahead."""

    def __init__(
        self,
        rig: Rig,
        codec: BoardCodec,
        judge: Judge | None = None,
        settings: DriverSettings = SETTINGS,
    ) -> None:
        self.codec = codec
        self.port = RecordingPort(codec)
        self.driver = Driver(rig, self.port, settings, judge)
        self.boards = list(self.driver.boards)
        self.now = 16.0
        self.counter = 0
        self.uptime = 0.0
        self.state = BoardState.VENTED
        self.pressures = (1e5, 2e5)
        self.position = 0.125
        self.follows = True

    @property
    def wall(self) -> float:
        return self.now + 1000.0

    def hear(self, board: int, message: Any, stamp: float | None = None) -> None:
        frame_id, data = self.codec.encode(board, message)
        stamp = self.wall if stamp is None else stamp
        self.port.waiting.append(ReceivedFrame(frame_id, data, stamp))

    def hear_all(self, board: int) -> None:
        self.hear(board, Measurement(self.pressures, self.position, self.counter))
        self.hear(
            board, Status(self.state, BoardFault(0), self.port.counters.get(board, 0), SUPPLY, 0)
        )
        self.hear(board, Heartbeat(self.uptime, PROTOCOL_VERSION, 1))

    def step(self, count: int = 1, command: tuple[float, ...] = (), silent: bool = False) -> Any:
        """`count` ticks; boards say everything in each of them unless silent."""
        for _ in range(count):
            self.now += TICK
            self.uptime += TICK
            self.counter = (self.counter + 1) & 0xFF
            if self.follows:
                active = self.driver.state is SafetyState.ACTIVE
                self.state = BoardState.ACTIVE if active else BoardState.VENTED
            if not silent:
                for board in self.boards:
                    self.hear_all(board)
            if command:
                offer(self.driver, NamedCommand(NAMES, command), self.now)
            snapshot = self.driver.cycle(self.now, self.wall)
        return snapshot

    def activate(self) -> None:
        """Activate with empty muscles, as the driver demands; then the pressures return slowly."""
        pressures, self.pressures = self.pressures, (0.0, 0.0)
        self.step(SETTLED)
        self.driver.activate(self.now)
        for tick in range(1, 17):
            self.pressures = (pressures[0] * tick / 16, pressures[1] * tick / 16)
            self.step()

    def start(self) -> None:
        self.activate()
        self.step(8, GOOD)
        assert self.driver.state is SafetyState.ACTIVE

    def valve_commands(self) -> list[ValveCommand]:
        return [message for _, message, _ in self.port.sent if isinstance(message, ValveCommand)]

    def board_commands(self) -> list[tuple[BoardCode, float]]:
        return [
            (message.code, now)
            for _, message, now in self.port.sent
            if isinstance(message, BoardCommand)
        ]
