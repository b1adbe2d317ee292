"""A mapped device as the driver sees it: when frames are sent, and what the device reports."""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import Any

import pytest

from pam_driver.boards.mapped.board import MappedBoard
from pam_driver.boards.mapped.sample_counter import SampleCounter
from pam_driver.boards.power_on_time import has_restarted
from pam_driver.boards.wiring import RigWiring
from pam_model.rig import load_rig
from support.mapped_device import ELBOW_VENDOR, Change, changed, vendor_dbc

TIMEOUT, SENSOR_TIMEOUT = 0.5, 0.05


def board_with(change: Change) -> MappedBoard:
    (board,) = RigWiring(changed(load_rig(ELBOW_VENDOR), change)).make_boards().values()
    assert isinstance(board, MappedBoard)
    return board


def every_ten_milliseconds(section: dict[str, Any]) -> None:
    section["commands"]["PVM_Demand"]["period"] = 0.01


def test_a_period_thins_out_commands_but_never_a_vent() -> None:
    board = board_with(every_ten_milliseconds)
    demand = (0.5, 0.5)
    sent = [len(list(board.command(demand, 10.0 + 0.002 * tick))) for tick in range(500)]
    assert sum(sent) == pytest.approx(100, abs=2)
    now = 11.002
    while list(board.command(demand, now)):
        now += 0.002
    ((_, data),) = board.command(None, now + 0.001)
    assert data[:4] == bytes(4), "the vent goes out although no frame is due"
    assert list(board.command(None, now + 0.002)) == []
    board.vent()
    assert len(list(board.command(None, now + 0.003))) == 1


def test_a_late_cycle_gets_one_frame_and_no_burst() -> None:
    board = board_with(every_ten_milliseconds)
    assert len(list(board.command(None, 10.0))) == 1
    assert len(list(board.command(None, 10.5))) == 1
    assert list(board.command(None, 10.502)) == []


def vents_by_mode(section: dict[str, Any]) -> None:
    section["vent"] = {"PVM_Demand": {"Op_Mode": "off", "Spare": 7}}


def test_a_vent_message_is_sent_beside_the_set_points() -> None:
    board = board_with(vents_by_mode)
    ((_, data),) = board.vent()
    assert data[4] >> 4 == 0
    assert struct.unpack(">H", data[5:7]) == (7,)
    assert list(board_with(lambda section: None).vent()) == []


def turning(section: dict[str, Any]) -> None:
    section["angles"]["shaft"] = {"signal": "PVM_Joint.Shaft_Ang", "zero": 350.0, "wraps": True}


def test_an_angle_that_wraps_stays_near_zero() -> None:
    board = board_with(turning)
    hear = board.listeners[board.identifiers.answers[1]]
    for count, (shown, expected) in enumerate([(350.0, 0.0), (5.0, 15.0), (320.0, -30.0)]):
        hear(struct.pack(">fB", shown, count + 1), 1.0 + count, 0.0)
        assert math.degrees(board.angles["shaft"].value) == pytest.approx(expected, abs=1e-4)
    hear(struct.pack(">fB", math.nan, 9), 9.0, 0.0)
    assert board.angles["shaft"].time == 3.0, "not a number is no measurement"


def status(state: int, errors: int = 0, echo: int = 0, uptime: float = 1.0) -> bytes:
    return struct.pack(">BBIB", state << 4 | errors, echo << 4, round(uptime * 1000), 0)


def test_state_faults_echo_and_restart_become_conditions() -> None:
    board = board_with(lambda section: None)
    _measured, _joint, told = board.identifiers.answers
    hear = board.listeners[told]

    def kinds(now: float, moving: bool = True) -> list[str]:
        found = board.conditions(now, TIMEOUT, SENSOR_TIMEOUT, moving)
        return [str(one) for one in found if one.kind != "board_lost"]

    hear(status(1), 1.0, 0.0)
    assert not board.follows
    assert kinds(1.0) == ["board manifold: is off although it was commanded to be active"]
    hear(status(2, echo=3), 1.1, 0.0)
    assert board.follows and kinds(1.1) == []
    assert kinds(1.7) == ["board manifold: has accepted no command for 0.5 s"]
    hear(status(3, errors=8), 1.2, 0.0)
    assert kinds(1.2) == ["board manifold: fault: over_pressure, state error"]
    hear(status(1, uptime=0.1), 1.3, 0.0)
    assert kinds(1.3, moving=False) == ["board manifold: has restarted"]
    assert board.restarts == 1
    board.acknowledge()
    assert kinds(1.3, moving=False) == []


def test_a_counter_of_four_bits_counts_lost_and_repeated_frames() -> None:
    counter = SampleCounter(16)
    fresh = [counter.fresh(value, time) for time, value in enumerate([14, 15, 0, 2, 2, 2])]
    assert fresh == [True, True, True, True, False, False]
    assert (counter.lost, counter.repeated, counter.reordered) == (1, 2, 0)
    assert counter.frozen(10.0, 0.05) and not counter.frozen(3.01, 0.05)
    counter.reset()
    assert counter.fresh(2, 6.0) and counter.lost == 1


def test_a_counter_of_eight_bits_knows_frames_out_of_order() -> None:
    counter = SampleCounter(256)
    fresh = [counter.fresh(value, float(time)) for time, value in enumerate([10, 12, 11, 13])]
    assert fresh == [True, True, False, True]
    assert (counter.lost, counter.reordered) == (1, 1)


def with_dbc(tmp_path: Path, before: str, after: str) -> MappedBoard:
    text = vendor_dbc().read_text()
    assert before in text
    path = tmp_path / "other.dbc"
    path.write_text(text.replace(before, after))
    return board_with(lambda section: section.update(dbc=str(path)))


def test_a_counter_goes_through_the_range_of_the_dbc_file(tmp_path: Path) -> None:
    """15 is no count in AUTOSAR's profile 1; a device takes it for a defect of the sender."""
    board = with_dbc(tmp_path, "Roll_Cnt : 35|4@0+ (1,0) [0|15]", "Roll_Cnt : 35|4@0+ (1,0) [0|14]")
    counts = [next(iter(board.command(None, 0.002 * cycle)))[1][4] & 15 for cycle in range(31)]
    assert counts == [(cycle + 1) % 15 for cycle in range(31)]
    heard = SampleCounter(15)
    assert all(heard.fresh(count % 15, 0.002 * count) for count in range(40))
    assert heard.lost == 0


@pytest.mark.parametrize(
    ("before", "now", "restarted"),
    [(65_530.0, 4.0, False), (65_530.0, 30_000.0, True), (30_000.0, 4.0, True), (5.0, 6.0, False)],
)
def test_a_time_since_power_up_that_begins_again_at_its_end_is_no_restart(
    before: float, now: float, restarted: bool, tmp_path: Path
) -> None:
    """16 bits of milliseconds last for 65 s, 32 bits for 50 days."""
    assert has_restarted(before, now, 0.0, 65_535.0) is restarted
    board = with_dbc(tmp_path, "[0|4294967.295]", "[0|65.535]")
    hear = board.listeners[board.identifiers.answers[2]]
    for time, uptime in ((1.0, before), (2.0, now)):
        hear(status(1, uptime=1e-3 * uptime), time, 0.0)
    assert board.restarts == restarted
