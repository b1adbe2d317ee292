"""A fault of the driver is latched on the boards: it outlives the driver that found it."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import pytest

from pam_driver.boards.pam_board.codec import (
    BoardCode,
    BoardCodec,
    BoardCommand,
    BoardState,
    FrameError,
)
from pam_driver.bus import BusState, ReceivedFrame, SendOutcome
from pam_driver.driver import ActivationError, Driver
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.command_intake import NamedCommand
from pam_driver.safety.states import SafetyState
from pam_model.rig import load_rig
from pam_sim.simulated_rig import SimulatedRig
from support.rigs import CONFIG

CODEC = BoardCodec.from_dbc()
CYCLE = 0.002
Loses = Callable[[int, bytes], bool]


def is_code(frame_id: int, data: bytes, code: BoardCode) -> bool:
    """Whether a frame is this board command."""
    try:
        _, message = CODEC.decode(frame_id, data)
    except FrameError:
        return False
    return isinstance(message, BoardCommand) and message.code is code


class Robot:
    """Two boards, and one driver after another on their bus."""

    state = BusState.ERROR_ACTIVE

    def __init__(self) -> None:
        self.rig = load_rig(CONFIG / "two_joints.yaml")
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


@pytest.fixture
def robot() -> Robot:
    robot = Robot()
    robot.move()
    return robot


def states(robot: Robot) -> set[object]:
    return {board.state for board in robot.sim.boards.values()}  # type: ignore[attr-defined]


def test_a_driver_that_starts_after_a_fault_is_in_fault_until_it_is_cleared(robot: Robot) -> None:
    """Kill -9 and a new start must not replace the operator's clear_faults."""
    robot.run(0.3)  # no commands
    assert robot.driver.state is SafetyState.FAULT
    assert states(robot) == {BoardState.FAULT}
    robot.start_driver()
    assert robot.driver.state is SafetyState.VENTING
    robot.run(0.3)
    assert robot.driver.state is SafetyState.FAULT
    assert [str(fault) for fault in robot.driver.faults] == [
        f"board {n}: keeps a fault that the driver latched earlier" for n in (0, 1)
    ]
    with pytest.raises(ActivationError, match="clear_faults"):
        robot.driver.activate(robot.now)
    robot.driver.clear_faults(robot.now)
    assert robot.driver.state in {SafetyState.VENTING, SafetyState.VENTED}
    robot.run(1.0)
    assert robot.driver.state in {SafetyState.VENTING, SafetyState.VENTED}
    robot.move()


def test_a_fault_that_was_no_fault_of_the_driver_is_not_latched_by_it(robot: Robot) -> None:
    robot.driver.vent(robot.now)
    robot.run(0.3)
    assert robot.told(BoardCode.LATCH_FAULT) == []
    robot.start_driver()
    robot.move()


def test_the_latch_is_repeated_until_each_board_reports_it(robot: Robot) -> None:
    robot.loses = lambda frame_id, data: is_code(frame_id, data, BoardCode.LATCH_FAULT)
    robot.run(0.5)
    lost = robot.told(BoardCode.LATCH_FAULT)
    assert len(lost) >= 5
    steps = [b - a for a, b in itertools.pairwise(lost)]
    assert steps == pytest.approx([0.05] * len(steps), abs=CYCLE)
    robot.loses = lambda frame_id, data: False
    robot.run(0.2)
    assert states(robot) == {BoardState.FAULT}
    count = len(robot.told(BoardCode.LATCH_FAULT))
    robot.run(0.5)
    assert len(robot.told(BoardCode.LATCH_FAULT)) == count


def test_a_board_that_restarts_is_told_the_fault_again(robot: Robot) -> None:
    robot.run(0.3)
    for address in list(robot.sim.boards):
        robot.sim.restart_board(address, robot.now)
    robot.run(0.3)
    assert states(robot) == {BoardState.FAULT}
    assert robot.driver.boards_keep_fault


def test_a_lost_clear_frame_leads_back_to_fault(robot: Robot) -> None:
    robot.run(0.3)
    robot.loses = lambda frame_id, data: is_code(frame_id, data, BoardCode.CLEAR_FAULTS)
    robot.driver.clear_faults(robot.now)
    robot.run(0.6)
    assert robot.driver.state is SafetyState.FAULT
    robot.loses = lambda frame_id, data: False
    robot.driver.clear_faults(robot.now)
    robot.move()


def test_a_board_with_a_latched_fault_of_the_host_ends_ready(robot: Robot) -> None:
    """Whoever latched it: another driver on the bus, or a tool."""
    robot.driver.vent(robot.now)
    robot.run(0.1)
    robot.sim.on_frame(*CODEC.encode(1, BoardCommand(BoardCode.LATCH_FAULT)), robot.now)
    robot.run(0.05)
    assert robot.driver.state is SafetyState.FAULT
    assert states(robot) == {BoardState.FAULT}
