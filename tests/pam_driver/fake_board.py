"""A valve board that keeps the rules of docs/can_protocol.md, driven step by step by a test."""

from __future__ import annotations

import math

from pam_driver.boards.pam_board.codec import (
    PROTOCOL_VERSION,
    BoardCode,
    BoardCodec,
    BoardCommand,
    BoardFault,
    BoardState,
    FrameError,
    Heartbeat,
    Measurement,
    Status,
    ValveCommand,
)
from pam_driver.boards.pam_board.messages import SafetyInput
from pam_driver.can_bus.bus import CanPort


class FakeBoard:
    """Answers on a port; a test sets its attributes to make it misbehave."""

    def __init__(self, port: CanPort, codec: BoardCodec, board: int = 0) -> None:
        self.port = port
        self.codec = codec
        self.board = board
        self.pressures = [0.0, 0.0]
        self.position = 0.0
        self.state = BoardState.VENTED
        self.faults = BoardFault(0)
        self.uptime = 0.0
        self.protocol_version = PROTOCOL_VERSION
        self.inputs: dict[str, SafetyInput] = {}
        self.silent: set[type] = set()
        self.counter_frozen = False
        self.deaf = False
        self.keeps_host_fault = True
        self.watchdog_timeout = codec.watchdog_timeout
        self.commands: list[ValveCommand] = []
        self.board_commands: list[BoardCommand] = []
        self.rejected = 0
        self.counter = 0
        self.armed = False
        self._heard: int | None = None
        self.heard_at = -math.inf
        self._sent: dict[type, float] = {}
        self._told = self.state

    @property
    def air(self) -> tuple[float, float]:
        """What the valves do: the fractions, 0 where vented."""
        if self.state is not BoardState.ACTIVE or not self.commands:
            return (0.0, 0.0)
        last = self.commands[-1]
        return (
            last.valves[0] if last.enable[0] else 0.0,
            last.valves[1] if last.enable[1] else 0.0,
        )

    def step(self, now: float) -> None:
        """Hear what waits, then send what is due."""
        for frame in self.port.receive_all(now):
            if self.deaf:
                continue
            try:
                board, message = self.codec.decode(frame.frame_id, frame.data)
            except FrameError:
                self.rejected += 1
                continue
            if board == self.board:
                self._hear(message, now)
        late = now - self.heard_at > self.watchdog_timeout
        if self.state is BoardState.ACTIVE and late:
            self.state = BoardState.FAULT
            self.faults |= BoardFault.WATCHDOG
        self.uptime += 0.002
        if not self.counter_frozen:
            self.counter = (self.counter + 1) & 0xFF
        pressures = (self.pressures[0], self.pressures[1])
        self._send(Measurement(pressures, self.position, self.counter), 0.0, now)
        heard = self._heard or 0
        if self.state is not self._told:
            self._told = self.state
            self._sent.pop(Status, None)
        status = Status(self.state, self.faults, heard, 701_320.0, self.rejected, **self.inputs)
        self._send(status, 0.02, now)
        self._send(Heartbeat(self.uptime, self.protocol_version, 1), 0.1, now)

    def _send(self, message: Measurement | Status | Heartbeat, period: float, now: float) -> None:
        kind = type(message)
        if kind in self.silent or now - self._sent.get(kind, -math.inf) < period - 1e-6:
            return
        self._sent[kind] = now
        self.port.send(*self.codec.encode(self.board, message), now)

    def _hear(self, message: object, now: float) -> None:
        if isinstance(message, BoardCommand):
            self.board_commands.append(message)
            if message.code is BoardCode.VENT and self.state is BoardState.ACTIVE:
                self.state = BoardState.VENTED
            if message.code is BoardCode.CLEAR_FAULTS and self.state is BoardState.FAULT:
                self.state = BoardState.VENTED
                self.faults = BoardFault(0)
            if message.code is BoardCode.LATCH_FAULT and self.keeps_host_fault:
                self.state = BoardState.FAULT
                self.faults |= BoardFault.HOST
            self.armed = False
        elif isinstance(message, ValveCommand) and message.counter != self._heard:
            self._heard = message.counter
            self.heard_at = now
            self.commands.append(message)
            if not any(message.enable):
                self.armed = True
                if self.state is BoardState.ACTIVE:
                    self.state = BoardState.VENTED
            elif self.state is BoardState.VENTED and self.armed:
                self.state = BoardState.ACTIVE
