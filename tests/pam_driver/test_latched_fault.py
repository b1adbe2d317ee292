"""A fault of the driver is latched on the boards: it outlives the driver that found it."""

from __future__ import annotations

import itertools

import pytest

from pam_driver.boards.pam_board.codec import BoardCode, BoardCommand, BoardState, FrameError
from pam_driver.driver import ActivationError
from pam_driver.safety.states import SafetyState

from .simulated_robot import CODEC, CYCLE, Robot


def is_code(frame_id: int, data: bytes, code: BoardCode) -> bool:
    """Whether a frame is this board command."""
    try:
        _, message = CODEC.decode(frame_id, data)
    except FrameError:
        return False
    return isinstance(message, BoardCommand) and message.code is code


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


def test_what_the_boards_keep_does_not_replace_the_reason_of_the_fault(robot: Robot) -> None:
    robot.run(0.3)  # no commands
    assert [fault.kind for fault in robot.driver.faults] == ["command_timeout"]
    robot.run(1.0)
    assert robot.driver.boards_keep_fault
    assert robot.driver.state is SafetyState.FAULT
    assert [fault.kind for fault in robot.driver.faults] == ["command_timeout"]
