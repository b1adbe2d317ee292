"""The driver with a board that may misbehave, step by step on a bus inside this process."""

from __future__ import annotations

from pam_driver.boards.pam_board.codec import (
    BoardCodec,
    BoardState,
)
from pam_driver.can_bus.bus import CanPort
from pam_driver.driver import Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_driver.snapshot import Snapshot
from pam_model.rig import Rig
from support.commands import offer

from .fake_board import FakeBoard

PERIOD = 0.002


SETTINGS = DriverSettings()


NAMES = ("elbow_flexor", "elbow_extensor")


class Bench:
    """A driver, a board and a clock that only moves in steps."""

    def __init__(self, rig: Rig, codec: BoardCodec, ports: tuple[CanPort, CanPort]) -> None:
        self.port, self.board_port = ports
        self.codec = codec
        self.driver = Driver(rig, self.port, SETTINGS)
        self.board = FakeBoard(self.board_port, codec)
        self.now = 100.0
        self.snapshot: Snapshot | None = None

    def step(
        self,
        seconds: float = PERIOD,
        command: tuple[float, float] | None = None,
        board: bool = True,
    ) -> Snapshot:
        """Run for a while, with a fresh command in each cycle if one is given."""
        for _ in range(max(1, round(seconds / PERIOD))):
            self.now += PERIOD
            if board:
                self.board.step(self.now)
            if command is not None:
                offer(self.driver, NamedCommand(NAMES, command), self.now)
            # the virtual bus stamps with the wall clock, which stands still against this one
            self.snapshot = self.driver.cycle(self.now, 0.0)
        assert self.snapshot is not None
        return self.snapshot

    def start(self) -> None:
        """Bring it to moving air."""
        self.step(0.2)
        self.driver.activate(self.now)
        self.step(0.7, (0.25, -0.5))
        assert self.driver.state is SafetyState.ACTIVE
        assert self.board.state is BoardState.ACTIVE

    def kinds(self) -> set[str]:
        """Kinds of the latched faults."""
        return {fault.kind for fault in self.driver.faults}
