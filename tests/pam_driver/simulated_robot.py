"""A simulated robot with two boards, and one driver after another on its bus."""

from __future__ import annotations

from collections.abc import Callable

from pam_driver.boards.pam_board.codec import BoardCode, BoardCodec, BoardCommand
from pam_driver.can_bus.bus import BusState, ReceivedFrame, SendOutcome
from pam_driver.driver import Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_model.rig import Rig, load_rig
from pam_sim.simulated_rig import SimulatedRig
from support.rigs import CONFIG

CODEC = BoardCodec.from_dbc()
CYCLE = 0.002
Loses = Callable[[int, bytes], bool]


class Robot:
    """Two boards, and one driver after another on their bus."""

    state = BusState.ERROR_ACTIVE

    def __init__(self, rig: Rig | None = None) -> None:
        self.rig = rig or load_rig(CONFIG / "two_joints.yaml")
        self.sim = SimulatedRig(self.rig)
        self.now = 0.0
        self.sent: list[tuple[float, int, bytes]] = []
        self.loses: Loses = lambda frame_id, data: False
        self._up: list[ReceivedFrame] = []
        self.start_driver()

    def start_driver(self) -> None:
        """A new driver, as after kill -9 of the last one."""
        self.driver = Driver(self.rig, self, DriverSettings())

    def receive_all(self, now: float) -> list[ReceivedFrame]:
        waiting, self._up = self._up, []
        return waiting

    def send(self, frame_id: int, data: bytes, now: float) -> SendOutcome:
        self.sent.append((now, frame_id, data))
        if not self.loses(frame_id, data):
            self.sim.on_frame(frame_id, data, now)
        return SendOutcome.SENT

    def run(self, seconds: float, command: bool = False) -> None:
        for _ in range(round(seconds / CYCLE)):
            self.now += CYCLE
            self._up += [
                ReceivedFrame(*frame, self.now + 1e3) for frame in self.sim.advance(self.now)
            ]
            if command:
                little = tuple(0.02 for _ in self.rig.muscles)
                position, effort = self.driver.intake.in_units(little)
                named = NamedCommand(self.rig.muscle_names, position, (), effort)
                self.driver.set_commands(named, self.now)
            self.driver.cycle(self.now, self.now + 1e3)

    def received(self, frame_id: int, data: bytes) -> ReceivedFrame:
        """A frame as the bus delivers it now."""
        return ReceivedFrame(frame_id, data, self.now + 1e3)

    def hears(self, frame_id: int, data: bytes) -> None:
        """Deliver a frame of a stranger to the driver, in a cycle of its own."""
        self._up.append(self.received(frame_id, data))
        self.driver.cycle(self.now, self.now + 1e3)

    def move(self) -> None:
        self.run(0.3)
        self.driver.activate(self.now)
        self.run(0.1, command=True)
        assert self.driver.state is SafetyState.ACTIVE, self.driver.faults
        assert all(board.active for board in self.sim.boards.values())

    def told(self, code: BoardCode) -> list[float]:
        """When this board command was sent to board 0."""
        wanted = CODEC.encode(0, BoardCommand(code))
        return [now for now, *frame in self.sent if tuple(frame) == wanted]
