"""What is remembered of one board, and from where on something is wrong with it."""

from __future__ import annotations

import math

import pytest

from pam_driver.boards.pam_board.codec import (
    PROTOCOL_VERSION,
    BoardFault,
    BoardState,
    Heartbeat,
    Measurement,
    Status,
)
from pam_driver.boards.pam_board.monitor import BoardMonitor
from pam_driver.boards.protocol import Condition, Sample

# halves and quarters, so that a limit can be met exactly
TIMEOUT, SENSOR_TIMEOUT = 0.5, 0.25


def measurement(counter: int, position: float = 0.1) -> Measurement:
    return Measurement((1e5, 2e5), position, counter)


def status(
    state: BoardState = BoardState.ACTIVE, faults: BoardFault | int = 0, counter: int = 1
) -> Status:
    return Status(state, BoardFault(faults), counter, 7e5, 0)


@pytest.fixture
def board() -> BoardMonitor:
    """One that has said everything at 8 s, counter 100."""
    board = BoardMonitor(3)
    board.hear_measurement(measurement(100), 8.0, 1008.0)
    board.hear_status(status(), 8.0)
    board.hear_heartbeat(Heartbeat(5.0, PROTOCOL_VERSION, 1), 8.0)
    return board


def found(board: BoardMonitor, now: float, moving: bool = False) -> list[Condition]:
    return list(board.conditions(now, TIMEOUT, SENSOR_TIMEOUT, moving))


def test_a_condition_names_who_is_concerned_if_anyone_is() -> None:
    assert str(Condition("board_lost", "board 3", "is gone")) == "board 3: is gone"
    assert str(Condition("bus_down", "", "the bus is down")) == "the bus is down"


def test_samples_keep_both_times(board: BoardMonitor) -> None:
    assert list(board.pressures.values()) == [Sample(1e5, 8.0, 1008.0), Sample(2e5, 8.0, 1008.0)]
    assert board.position == Sample(0.1, 8.0, 1008.0)


def test_a_value_that_is_not_available_leaves_the_one_before(board: BoardMonitor) -> None:
    board.hear_measurement(Measurement((math.nan, 3e5), math.nan, 101), 8.002, 1008.002)
    assert list(board.pressures.values()) == [
        Sample(1e5, 8.0, 1008.0),
        Sample(3e5, 8.002, 1008.002),
    ]
    assert board.position == Sample(0.1, 8.0, 1008.0)


def test_the_first_counter_may_be_any() -> None:
    board = BoardMonitor(0)
    board.hear_measurement(measurement(250), 1.0, 1.0)
    assert (board.frames_lost, board.frames_repeated, board.frames_reordered) == (0, 0, 0)


def test_repetitions_and_gaps_are_counted_across_the_wrap(board: BoardMonitor) -> None:
    for _ in range(3):
        board.hear_measurement(measurement(100, 0.7), 8.1, 1008.1)
    assert (board.frames_repeated, board.position.value) == (3, 0.1)
    board.hear_measurement(measurement(254), 8.2, 1008.2)
    board.hear_measurement(measurement(1), 8.3, 1008.3)
    assert board.frames_lost == 153 + 2


@pytest.mark.parametrize(("behind", "taken"), [(1, False), (15, False), (16, True), (100, True)])
def test_a_little_behind_is_out_of_order_and_farther_is_another_counter(
    behind: int, taken: bool, board: BoardMonitor
) -> None:
    board.hear_measurement(measurement(100 - behind, 0.7), 8.1, 1008.1)
    assert board.position.value == (0.7 if taken else 0.1)
    assert board.frames_reordered == (0 if taken else 1)
    assert board.frames_lost == (255 - behind if taken else 0)


def test_a_counter_that_stays_behind_is_believed_after_a_window(board: BoardMonitor) -> None:
    for step in range(16):
        board.hear_measurement(measurement(90, 0.7), 8.0 + 0.002 * step, 1008.0)
    assert (board.frames_reordered, board.position.value) == (16, 0.1)
    board.hear_measurement(measurement(90, 0.7), 8.1, 1008.1)
    assert (board.frames_reordered, board.position.value) == (16, 0.7)
    # and the window begins anew
    for _ in range(16):
        board.hear_measurement(measurement(85, 0.9), 8.2, 1008.2)
    assert (board.frames_reordered, board.position.value) == (32, 0.7)


def test_a_frozen_counter_takes_more_than_one_repetition_and_some_time(
    board: BoardMonitor,
) -> None:
    board.hear_measurement(measurement(100), 8.1, 1008.1)
    assert found(board, 8.4) == []
    board.hear_measurement(measurement(100), 8.1, 1008.1)
    assert found(board, 8.0 + SENSOR_TIMEOUT) == []
    text = "measurement counter has not changed for 0.25 s"
    assert found(board, 8.4) == [Condition("counter_frozen", "board 3", text)]
    board.hear_measurement(measurement(101), 8.4, 1008.4)
    board.hear_measurement(measurement(101), 8.4, 1008.4)
    board.hear_status(status(), 8.6)
    board.hear_heartbeat(Heartbeat(6.0, PROTOCOL_VERSION, 1), 8.6)
    assert found(board, 8.8) == []


def test_a_smaller_uptime_is_a_restart_until_acknowledged(board: BoardMonitor) -> None:
    board.hear_heartbeat(Heartbeat(5.0, PROTOCOL_VERSION, 1), 8.0)
    assert (board.restarts, found(board, 8.0)) == (0, [])
    for uptime in (6.0, 0.5, 1.5, 0.1):
        board.hear_heartbeat(Heartbeat(uptime, PROTOCOL_VERSION, 1), 8.0)
    assert board.restarts == 2
    assert found(board, 8.0) == [Condition("board_restarted", "board 3", "has restarted")]
    # its counter has begun anew
    board.hear_measurement(measurement(99, 0.7), 8.0, 1008.0)
    assert (board.frames_lost, board.frames_reordered, board.position.value) == (0, 0, 0.7)
    board.acknowledge()
    assert found(board, 8.0) == []


@pytest.mark.parametrize("other", [5.5, 90.0])
def test_two_boards_of_one_number_are_told_from_one_that_restarts(
    other: float, board: BoardMonitor
) -> None:
    """Both carry out the same commands, and the driver sees now the one, now the other."""
    expected = "reports two times since power-up in turns: two boards have this number"
    for turn in range(4):
        for uptime in (other, 5.0):
            now = 8.0 + 0.1 * turn
            board.hear_heartbeat(Heartbeat(uptime + 0.1 * turn, PROTOCOL_VERSION, 1), now)
            board.acknowledge()
        assert found(board, now) == [Condition("board_number", "board 3", expected)]
    board.hear_measurement(measurement(1), 9.25, 1009.25)
    board.hear_status(status(), 9.25)
    board.hear_heartbeat(Heartbeat(6.25, PROTOCOL_VERSION, 1), 9.25)
    assert found(board, 9.25) == [Condition("board_number", "board 3", expected)]
    assert found(board, 9.35) == []  # the second one was taken away a second ago


def test_what_is_silent_is_named_after_the_timeout() -> None:
    board = BoardMonitor(3)
    assert board.silent(8.0, TIMEOUT) == ["measurement", "status", "heartbeat"]
    board.hear_measurement(measurement(1), 8.0, 1008.0)
    board.hear_status(status(), 8.25)
    assert board.silent(8.25, TIMEOUT)
    board.hear_heartbeat(Heartbeat(1.0, PROTOCOL_VERSION, 1), 8.5)
    assert not board.silent(8.5, TIMEOUT)
    assert found(board, 8.5) == []
    text = "no measurement for 0.5 s"
    assert found(board, 8.625) == [Condition("board_lost", "board 3", text)]
    text = "no measurement, no status for 0.5 s"
    assert found(board, 9.0) == [Condition("board_lost", "board 3", text)]
    assert board.silent(9.25, TIMEOUT) == ["measurement", "status", "heartbeat"]


def test_another_protocol_is_named(board: BoardMonitor) -> None:
    board.hear_heartbeat(Heartbeat(6.0, 1, 1), 8.0)
    text = f"uses protocol version 1, expected {PROTOCOL_VERSION}"
    assert found(board, 8.0) == [Condition("protocol_version", "board 3", text)]


@pytest.mark.parametrize(
    ("state", "faults", "text"),
    [
        (BoardState.FAULT, BoardFault.WATCHDOG, "fault: watchdog"),
        (BoardState.FAULT, BoardFault.CRC | BoardFault.VALVE, "crc, valve"),
        (BoardState.FAULT, 0, "fault: unnamed"),
        (BoardState.VENTED, BoardFault.SENSOR, "fault: sensor"),
    ],
)
@pytest.mark.parametrize("moving", [False, True])
def test_a_board_s_fault_is_named_in_motion_or_not(
    state: BoardState, faults: int, text: str, moving: bool, board: BoardMonitor
) -> None:
    board.hear_status(status(state, faults), 8.0)
    (condition,) = found(board, 8.0, moving)
    assert (condition.kind, condition.subject) == ("board_fault", "board 3")
    names = set(condition.text.removeprefix("fault: ").split(", "))
    assert names == set(text.removeprefix("fault: ").split(", "))


def test_a_board_that_does_not_move_with_the_others_is_a_fault_only_in_motion(
    board: BoardMonitor,
) -> None:
    board.hear_status(status(BoardState.VENTED), 8.0)
    assert found(board, 8.0) == []
    text = "is vented although it was commanded to be active"
    assert found(board, 8.0, moving=True) == [Condition("board_not_active", "board 3", text)]


def test_a_board_that_hears_no_command_is_a_fault_only_in_motion(board: BoardMonitor) -> None:
    board.hear_status(status(counter=1), 8.5)
    board.hear_measurement(measurement(101), 8.5, 1008.5)
    board.hear_heartbeat(Heartbeat(6.0, PROTOCOL_VERSION, 1), 8.5)
    assert found(board, 8.5, moving=True) == []
    assert found(board, 8.625) == []
    text = "has accepted no command for 0.5 s"
    assert found(board, 8.625, moving=True) == [Condition("command_not_heard", "board 3", text)]
    board.hear_status(status(counter=2), 8.625)
    assert found(board, 8.625, moving=True) == []


def test_a_board_never_heard_has_no_status_to_judge() -> None:
    board = BoardMonitor(3)
    assert [condition.kind for condition in found(board, 8.0, moving=True)] == ["board_lost"]
