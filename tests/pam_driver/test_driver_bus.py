"""What the driver asks of its bus: when boards are told what, and how old frames are."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest

from pam_driver.boards.pam_board.codec import (
    BoardCode,
    BoardCodec,
    BoardCommand,
    Measurement,
    ValveCommand,
)
from pam_driver.can_bus.bus import ReceivedFrame, SendOutcome
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_model.rig import Encoder, Rig

from .exact_bench import GOOD, NAMES, SETTINGS, SETTLED, TICK, ExactBench


@pytest.fixture
def bench(rig: Rig, codec: BoardCodec) -> ExactBench:
    return ExactBench(rig, codec)


def test_a_new_driver_knows_of_nothing(bench: ExactBench) -> None:
    driver = bench.driver
    assert (driver.faults, driver.conditions, driver.suspicions) == ((), (), ())
    assert driver.state is SafetyState.VENTING
    assert bench.port.sent == []
    assert driver.activation_problem(bench.now).startswith("no answer from board 0:")


def test_the_snapshot_tells_the_state_after_the_cycle(bench: ExactBench) -> None:
    assert bench.step(8).state is SafetyState.VENTING
    bench.activate()
    assert bench.step(1).state is SafetyState.READY
    assert bench.step(1, GOOD).state is SafetyState.ACTIVE
    bench.pressures = (9e5, 0.0)
    assert bench.step(1, GOOD).state is SafetyState.FAULT


def test_the_snapshot_tells_what_the_boards_were_told(bench: ExactBench) -> None:
    vents = (-1.0, -1.0)
    assert bench.step(8).sent == vents
    bench.activate()
    assert bench.step(1).sent == vents
    assert bench.step(1, (0.25, -0.5)).sent == (0.25, -0.5)
    assert bench.step(2).sent == (0.25, -0.5)
    bench.port.outcome = SendOutcome.QUEUE_FULL
    assert bench.step(1).sent == ()
    bench.port.outcome = SendOutcome.SENT
    bench.driver.vent_at_once(bench.now)
    assert bench.step(1, (0.25, -0.5)).sent == vents


def test_the_counter_of_commands_goes_on_by_one_and_wraps(bench: ExactBench) -> None:
    bench.step(300)
    counters = [command.counter for command in bench.valve_commands()]
    assert all((b - a) & 0xFF == 1 for a, b in itertools.pairwise(counters))
    assert max(counters) == 255 and min(counters) == 0


def test_a_vent_at_once_tells_the_boards_at_that_very_moment(bench: ExactBench) -> None:
    bench.start()
    bench.port.sent.clear()
    bench.driver.vent_at_once(bench.now)
    assert (BoardCode.VENT, bench.now) in bench.board_commands()
    assert not any(any(command.enable) for command in bench.valve_commands())
    bench.driver.vent(bench.now)
    assert bench.port.sent[-1][1:] == (bench.valve_commands()[-1], bench.now)
    bench.port.sent.clear()
    bench.driver.close(bench.now)
    assert bench.driver.state is SafetyState.UNCONFIGURED
    # once for the call, once for the state that is entered
    assert bench.board_commands() == [(BoardCode.VENT, bench.now)] * 2


def test_a_fault_tells_the_boards_in_the_cycle_that_finds_it(bench: ExactBench) -> None:
    bench.start()
    bench.port.sent.clear()
    bench.pressures = (9e5, 0.0)
    bench.step(1, GOOD)
    told = [(BoardCode.VENT, bench.now), (BoardCode.LATCH_FAULT, bench.now)]
    assert bench.board_commands() == told
    assert [command.enable for command in bench.valve_commands()] == [(False, False)]


def test_a_fault_in_the_start_up_check_tells_the_boards_in_the_cycle_that_finds_it(
    rig: Rig, codec: BoardCodec
) -> None:
    bench = ExactBench(rig, codec, settings=replace(SETTINGS, start_up_check=True))
    bench.pressures = (0.0, 0.0)
    bench.step(SETTLED)
    bench.driver.activate(bench.now)
    bench.step(8)
    assert bench.driver.state is SafetyState.CHECKING
    bench.port.sent.clear()
    bench.pressures = (9e5, 0.0)
    bench.step(1)
    assert [fault.kind for fault in bench.driver.faults] == ["over_pressure"]
    told = [(BoardCode.VENT, bench.now), (BoardCode.LATCH_FAULT, bench.now)]
    assert bench.board_commands() == told
    assert [command.enable for command in bench.valve_commands()] == [(False, False)]


def test_clearing_faults_tells_the_boards_to_vent_then_to_clear(bench: ExactBench) -> None:
    bench.start()
    bench.pressures = (9e5, 0.0)
    bench.step(1)
    bench.port.sent.clear()
    bench.driver.clear_faults(bench.now)
    vent, clear = BoardCode.VENT, BoardCode.CLEAR_FAULTS
    assert bench.board_commands() == [(vent, bench.now), (clear, bench.now)]
    assert bench.driver.faults == ()


def test_clearing_faults_in_motion_changes_nothing(bench: ExactBench) -> None:
    bench.start()
    bench.port.sent.clear()
    bench.driver.clear_faults(bench.now)
    assert bench.port.sent == []
    assert bench.driver.state is SafetyState.ACTIVE


def test_the_port_is_told_the_time_of_the_cycle(bench: ExactBench) -> None:
    bench.step()
    assert bench.port.received_at == [bench.now]
    assert {now for _, _, now in bench.port.sent} == {bench.now}


@pytest.mark.parametrize(
    ("stamped", "age"),
    [(0.0, 0.0), (-TICK / 2, TICK / 2), (-5.0, TICK), (5.0, 0.0)],
    ids=["now", "half a cycle ago", "long ago: since the last cycle", "in the future: now"],
)
def test_the_age_of_a_frame(stamped: float, age: float, bench: ExactBench) -> None:
    bench.step(8)
    bench.now += TICK
    stamp = bench.wall + stamped
    bench.hear(0, Measurement((0.0, 0.0), 0.25, bench.counter + 1), stamp)
    bench.driver.cycle(bench.now, bench.wall)
    position = bench.driver.boards[0].position
    assert (position.value, position.time, position.stamp) == (0.25, bench.now - age, stamp)


@pytest.mark.parametrize(
    ("frame_id", "data", "kind", "text"),
    [
        (0x185, bytes(8), "unknown_board", "frame 0x185: board 5"),
        (0x123, b"", "unknown_id", "frame 0x123"),
    ],
)
def test_odd_frames_are_counted_and_named(
    frame_id: int, data: bytes, kind: str, text: str, bench: ExactBench
) -> None:
    for _ in range(3):
        bench.port.waiting.append(ReceivedFrame(frame_id, data, bench.wall))
    bench.step()
    assert bench.driver.frame_errors == {kind: 3}
    assert bench.driver.last_frame_error[kind].startswith(text)


@pytest.mark.parametrize("channel", [0, 1])
def test_a_channel_without_a_muscle_is_never_enabled(
    channel: int, rig: Rig, codec: BoardCodec
) -> None:
    alone = replace(rig.muscles[0], channel=channel)
    bench = ExactBench(replace(rig, joints=(), muscles=(alone,)), codec)
    bench.activate()
    bench.driver.set_commands(NamedCommand(NAMES[:1], (0.25,)), bench.now)
    bench.step(1)
    command = bench.valve_commands()[-1]
    assert command.enable == (channel == 0, channel == 1)
    assert command.valves[channel] == pytest.approx(0.25, abs=2e-5)
    assert command.valves[1 - channel] == 0.0


def test_vented_valves_are_told_no_value(bench: ExactBench) -> None:
    bench.start()
    bench.pressures = (0.0, 0.0)
    bench.driver.deactivate(bench.now)
    bench.step()
    command = bench.valve_commands()[-1]
    assert (command.valves, command.enable) == ((0.0, 0.0), (False, False))


@pytest.mark.parametrize(
    ("way", "code"),
    [
        ("vent", BoardCode.VENT),
        ("close", BoardCode.VENT),
        ("clear_faults", BoardCode.CLEAR_FAULTS),
    ],
)
def test_every_board_is_told_to_vent_and_to_clear(
    way: str, code: BoardCode, rig: Rig, codec: BoardCodec
) -> None:
    names = ("wrist_a", "wrist_b")
    wrist = replace(rig.joints[0], name="wrist", muscles=names, encoder=Encoder(4))
    muscles = tuple(
        replace(muscle, name=name, board=4) for muscle, name in zip(rig.muscles, names, strict=True)
    )
    both = replace(rig, joints=(*rig.joints, wrist), muscles=rig.muscles + muscles)
    bench = ExactBench(both, codec)
    bench.step(8)
    bench.port.sent.clear()
    getattr(bench.driver, way)(bench.now)
    told = [
        board
        for board, message, _ in bench.port.sent
        if isinstance(message, BoardCommand) and message.code is code
    ]
    assert set(told) == {0, 4}
    if code is BoardCode.VENT:
        shut = [board for board, message, _ in bench.port.sent if isinstance(message, ValveCommand)]
        assert set(shut) == {0, 4}


def test_a_measurement_stamped_in_the_future_grows_old_like_any_other(bench: ExactBench) -> None:
    """A clock that was set back must not keep a dead sensor fresh."""
    bench.step(8)
    bench.now += TICK
    bench.hear(0, Measurement((1e5, 2e5), 0.125, bench.counter + 1), bench.wall + 3600.0)
    assert bench.driver.cycle(bench.now, bench.wall).pressures == (1e5, 2e5)
    silent = round(SETTINGS.sensor_timeout / TICK) + 1
    snapshot = bench.step(silent, silent=True)
    assert all(map(math.isnan, (*snapshot.pressures, *snapshot.positions)))
    assert {found.kind for found in bench.driver.conditions} == {"stale_sensor"}
