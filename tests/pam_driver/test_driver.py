"""The driver against a board that misbehaves, step by step on a bus inside this process."""

from __future__ import annotations

import math
import uuid
from dataclasses import replace

import pytest

from pam_driver.boards.pam_board.codec import (
    BoardCodec,
    BoardState,
    Measurement,
)
from pam_driver.boards.wiring import RigWiring
from pam_driver.can_bus.bus import CanPort, open_bus
from pam_driver.driver import ActivationError, Driver
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import CommandRefusedError, NamedCommand
from pam_driver.snapshot import Snapshot
from pam_model.errors import PamError
from pam_model.rig import Encoder, Rig
from support.commands import offer

from .driver_bench import NAMES, PERIOD, SETTINGS, Bench
from .fake_board import FakeBoard


def test_commands_reach_the_valves_and_measurements_come_back(bench: Bench) -> None:
    bench.start()
    assert bench.board.air == pytest.approx((0.25, -0.5), abs=2e-5)
    bench.board.pressures = [200_000.0, 100_000.0]
    bench.board.position = 0.5
    snapshot = bench.step(0.01, (0.0, 0.0))
    assert snapshot.pressures == (200_000.0, 100_000.0)
    assert snapshot.positions == (0.5,)
    assert snapshot.pressure_stamp > 0.0


def test_nothing_moves_before_activation_and_a_command(bench: Bench) -> None:
    bench.step(0.2, (1.0, 1.0))
    assert bench.board.air == (0.0, 0.0)
    bench.driver.activate(bench.now)
    bench.step(0.2)
    assert bench.driver.state is SafetyState.READY
    assert not any(any(command.enable) for command in bench.board.commands)


def test_a_command_from_before_activation_is_not_used(bench: Bench) -> None:
    bench.step(0.2, (1.0, 1.0))
    bench.driver.activate(bench.now)
    bench.step(0.05)
    assert bench.board.air == (0.0, 0.0)


def test_a_command_that_was_computed_before_the_activation_and_arrives_after_it_is_refused(
    bench: Bench,
) -> None:
    """It may have been on its way when a person stopped the arm."""
    bench.step(0.2)
    bench.driver.activate(bench.now)
    bench.step(0.01)
    with pytest.raises(CommandRefusedError, match="computed before the driver was activated"):
        bench.driver.set_commands(NamedCommand(NAMES, (0.25, 0.25), age=0.02), bench.now)
    assert bench.driver.state is SafetyState.READY
    bench.driver.set_commands(NamedCommand(NAMES, (0.25, 0.25), age=0.005), bench.now)
    assert bench.driver.state is SafetyState.ACTIVE


def test_commands_that_nobody_may_follow_are_counted_with_the_reason(bench: Bench) -> None:
    command = NamedCommand(NAMES, (0.25, 0.25))
    bench.step(0.2)
    with pytest.raises(CommandRefusedError, match="the driver is vented; activate it first"):
        bench.driver.set_commands(command, bench.now)
    bench.start()
    assert bench.driver.intake.last_rejection == ""
    bench.board.pressures[0] = 610_000.0
    bench.step(0.05)
    with pytest.raises(CommandRefusedError, match="a fault is latched; clear it, then activate"):
        bench.driver.set_commands(command, bench.now)
    assert bench.driver.intake.rejected == {"not_active": 2}
    assert bench.driver.intake.accepted == 350


def test_activation_names_the_missing_board(bench: Bench) -> None:
    bench.step(0.2, board=False)
    with pytest.raises(ActivationError, match="board 0"):
        bench.driver.activate(bench.now)
    assert bench.driver.state is SafetyState.VENTING


@pytest.mark.parametrize("way", ["deactivate", "vent", "close"])
def test_every_way_out_vents_at_once(way: str, bench: Bench) -> None:
    bench.start()
    getattr(bench.driver, way)(bench.now)
    bench.board.step(bench.now)
    assert bench.board.state is BoardState.VENTED
    bench.step(0.1, (1.0, 1.0))
    assert bench.board.air == (0.0, 0.0)


def test_commands_that_stop_end_vented(bench: Bench) -> None:
    bench.start()
    bench.step(SETTINGS.command_timeout - PERIOD)
    assert bench.driver.state is SafetyState.ACTIVE
    bench.step(2 * PERIOD)
    assert bench.kinds() == {"command_timeout"}
    bench.step()
    assert bench.board.air == (0.0, 0.0)


GOOD = (0.1, 0.2)
BAD_COMMANDS: dict[str, tuple[NamedCommand, str]] = {
    "unknown name": (NamedCommand(("elbow_flexor", "knee"), GOOD), "knee"),
    "twice": (NamedCommand(("elbow_flexor", "elbow_flexor"), GOOD), "twice"),
    "one missing": (NamedCommand(("elbow_flexor",), (0.1,)), "expected 2"),
    "no names": (NamedCommand((), ()), "expected 2"),
    "too many": (NamedCommand((*NAMES, "x"), (0.1, 0.2, 0.3)), "expected 2"),
    "values missing": (NamedCommand(NAMES, (0.1,)), "1 values in position"),
    "NaN": (NamedCommand(NAMES, (0.1, math.nan)), "elbow_extensor: nan"),
    "infinite": (NamedCommand(NAMES, (-math.inf, 0.0)), "elbow_flexor: -inf"),
    "percent": (NamedCommand(NAMES, (50.0, 0.0)), "expected -1 to 1"),
    "effort": (NamedCommand(NAMES, (), (), (1e5, 1e5)), "takes position"),
    "effort too": (NamedCommand(NAMES, GOOD, (), (1e5, 1e5)), "takes position"),
    "velocity": (NamedCommand(NAMES, GOOD, (0.0, 0.0)), "takes position"),
    "old": (NamedCommand(NAMES, GOOD, age=0.2), "0.200 s old"),
    "future": (NamedCommand(NAMES, GOOD, age=-1.0), "in the future"),
    "NaN age": (NamedCommand(NAMES, GOOD, age=math.nan), "future"),
}


@pytest.mark.parametrize("name", BAD_COMMANDS)
def test_a_bad_command_is_refused_whole_and_ages_out(name: str, bench: Bench) -> None:
    command, expected = BAD_COMMANDS[name]
    bench.start()
    with pytest.raises(CommandRefusedError, match=expected):
        bench.driver.set_commands(command, bench.now)
    bench.step()
    assert bench.board.commands[-1].valves == pytest.approx((0.25, -0.5), abs=2e-5)
    assert sum(bench.driver.intake.rejected.values()) == 1
    for _ in range(60):
        bench.step()
        with pytest.raises(CommandRefusedError):
            bench.driver.set_commands(command, bench.now)
    assert bench.kinds() == {"command_timeout"}
    assert expected.split(":")[0] in str(bench.driver.faults[0])
    bench.step(0.01)
    assert bench.board.air == (0.0, 0.0)


def test_a_command_older_than_the_last_is_refused(bench: Bench) -> None:
    bench.start()
    with pytest.raises(CommandRefusedError, match="older than"):
        bench.driver.set_commands(NamedCommand(NAMES, GOOD, age=0.05), bench.now)


def test_names_may_come_in_any_order(bench: Bench) -> None:
    bench.start()
    bench.driver.set_commands(NamedCommand(NAMES[::-1], (0.5, 0.25)), bench.now)
    bench.step(2 * PERIOD)
    assert bench.board.air == pytest.approx((0.25, 0.5), abs=2e-5)


def test_rounding_beyond_full_scale_is_clipped(bench: Bench) -> None:
    bench.start()
    bench.driver.set_commands(NamedCommand(NAMES, (1.0 + 1e-9, -1.0 - 1e-9)), bench.now)
    bench.step(2 * PERIOD)
    assert bench.board.air == (1.0, -1.0)


def test_values_that_are_not_fresh_are_nan(bench: Bench) -> None:
    bench.step(0.1)
    bench.board.pressures[1] = bench.board.position = math.nan
    snapshot = bench.step(SETTINGS.sensor_timeout + 2 * PERIOD)
    assert snapshot.pressures[0] == 0.0
    assert math.isnan(snapshot.pressures[1])
    assert math.isnan(snapshot.positions[0]) and math.isnan(snapshot.velocities[0])
    assert snapshot.joint_stamp == 0.0


def test_a_lost_frame_or_two_are_no_fault(bench: Bench) -> None:
    bench.start()
    for _ in range(20):
        bench.board.counter += 2
        bench.step(0.01, (0.0, 0.0))
    assert bench.driver.state is SafetyState.ACTIVE
    assert bench.driver.boards[0].frames_lost == 40


def test_frames_out_of_order_are_not_used(bench: Bench) -> None:
    bench.step(0.1)
    old = bench.codec.encode(0, Measurement((1e5, 1e5), 0.3, (bench.board.counter - 2) & 0xFF))
    bench.board_port.send(*old, bench.now)
    snapshot = bench.driver.cycle(bench.now, 0.0)
    assert snapshot.positions == (0.0,)
    assert bench.driver.boards[0].frames_reordered == 1


@pytest.mark.parametrize(
    ("frame_id", "data", "kind"),
    [
        (0x123, b"\1", "unknown_id"),
        (0x180, b"\1\2", "wrong_length"),
        (0x280, b"\xff" * 8, "out_of_range"),
        (0x100, b"\1" * 8, "bad_crc"),
        (0x185, b"\0" * 8, "unknown_board"),
    ],
)
def test_a_bad_frame_is_counted_named_and_not_fatal(
    frame_id: int, data: bytes, kind: str, bench: Bench
) -> None:
    bench.start()
    bench.board_port.send(frame_id, data, bench.now)
    bench.step(0.05, (0.0, 0.0))
    assert bench.driver.frame_errors == {kind: 1}
    assert f"0x{frame_id:03X}" in bench.driver.last_frame_error[kind]
    assert bench.driver.state is SafetyState.ACTIVE


def test_velocity_follows_the_angle(bench: Bench) -> None:
    bench.step(0.1)
    for _ in range(100):
        bench.board.position += 3.0 * PERIOD
        snapshot = bench.step()
    assert snapshot.velocities[0] == pytest.approx(3.0, rel=1e-3)


def test_a_step_of_the_wall_clock_is_no_fault(bench: Bench) -> None:
    bench.start()
    for wall in (1e10, 0.0, -1e10):
        bench.now += PERIOD
        bench.board.step(bench.now)
        bench.driver.set_commands(NamedCommand(NAMES, GOOD), bench.now)
        bench.driver.cycle(bench.now, wall)
    assert bench.driver.state is SafetyState.ACTIVE


def test_two_joints_on_two_boards(rig: Rig, codec: BoardCodec) -> None:
    joint = replace(rig.joints[0], name="wrist", muscles=("wrist_a", "wrist_b"), encoder=Encoder(4))
    others = tuple(
        replace(muscle, name=name, board=4)
        for muscle, name in zip(rig.muscles, joint.muscles, strict=True)
    )
    both = replace(rig, joints=(*rig.joints, joint), muscles=rig.muscles + others)
    channel = uuid.uuid4().hex
    ends = [open_bus("virtual", channel) for _ in range(3)]
    driver = Driver(both, ends[0], SETTINGS)
    elbow, wrist = FakeBoard(ends[1], codec, 0), FakeBoard(ends[2], codec, 4)
    wrist.position = -0.5
    names = (*NAMES, "wrist_a", "wrist_b")
    now = 1.0

    def run(boards: list[FakeBoard], values: tuple[float, ...] = ()) -> Snapshot:
        nonlocal now
        for _ in range(100):
            now += PERIOD
            for board in boards:
                board.step(now)
            if values:
                offer(driver, NamedCommand(names, values), now)
            snapshot = driver.cycle(now, 0.0)
        return snapshot

    run([elbow])
    with pytest.raises(ActivationError, match=r"no answer from board 4:"):
        driver.activate(now)
    run([elbow, wrist])
    driver.activate(now)
    wrist.pressures = [1e5, 2e5]
    snapshot = run([elbow, wrist])
    assert snapshot.pressures == (0.0, 0.0, 1e5, 2e5)
    assert snapshot.positions == (0.0, -0.5)
    run([elbow, wrist], (0.1, 0.2, 0.3, 0.4))
    assert (*elbow.air, *wrist.air) == pytest.approx((0.1, 0.2, 0.3, 0.4), abs=2e-5)
    run([elbow], (0.1, 0.2, 0.3, 0.4))
    assert {fault.subject for fault in driver.faults} == {"wrist_a", "wrist_b", "wrist"}
    run([elbow, wrist])
    assert (*elbow.air, *wrist.air) == (0.0, 0.0, 0.0, 0.0)
    for end in ends:
        end.close()


@pytest.mark.parametrize(
    ("field", "value", "expected"),
    [
        ("board", None, "missing"),
        ("board", 16, "expected board 0 to 15"),
        ("channel", 2, "channel 0 to 1"),
        ("channel", 1, "already"),
    ],
)
def test_a_rig_that_is_not_wired_is_refused(
    field: str, value: int | None, expected: str, rig: Rig, codec: BoardCodec
) -> None:
    wrong = rig.with_muscle(replace(rig.muscles[0], **{field: value}))
    with pytest.raises(PamError, match=expected):
        RigWiring(wrong)


def test_a_regulator_takes_pascal(rig: Rig, codec: BoardCodec, ports: tuple) -> None:
    muscles = tuple(
        replace(m, valve=replace(m.valve, kind="pressure_regulator", full_scale=800_000.0))
        for m in rig.muscles
    )
    bench = Bench(replace(rig, muscles=muscles), codec, ports)
    bench.step(0.2)
    bench.driver.activate(bench.now)
    bench.driver.set_commands(NamedCommand(NAMES, effort=(200_000.0, 0.0)), bench.now)
    bench.step(3 * PERIOD)
    assert bench.board.air == pytest.approx((0.25, 0.0), abs=2e-5)
    for command, expected in (
        (NamedCommand(NAMES, (0.1, 0.1)), "takes effort"),
        (NamedCommand(NAMES, effort=(600_100.0, 0.0)), "expected 0 to 600000 Pa"),
        (NamedCommand(NAMES, effort=(-1.0, 0.0)), "expected 0 to 600000 Pa"),
    ):
        with pytest.raises(CommandRefusedError, match=expected):
            bench.driver.set_commands(command, bench.now)


class SeenPressures:
    """A judge of measurements that only remembers them."""

    period = PERIOD

    def __init__(self) -> None:
        self.seen: list[tuple[float, ...]] = []
        self.restarts = 0

    def restart(self) -> None:
        self.restarts += 1

    def update(self, commands, pressures, positions, velocities, supply_pressures) -> None:
        self.seen.append(tuple(pressures))

    def deviations(self):
        return iter(())


def test_physics_begins_anew_after_a_stall(
    rig: Rig, codec: BoardCodec, ports: tuple[CanPort, CanPort]
) -> None:
    """A host that stood still must not take the gas that went on for a leak."""
    bench = Bench(rig, codec, ports)
    judge = SeenPressures()
    bench.driver = Driver(rig, bench.port, SETTINGS, judge)
    bench.step(0.2)
    assert not any(math.isnan(value) for value in judge.seen[-1])
    begun = judge.restarts
    bench.now += 0.1
    bench.step()
    assert judge.restarts == begun + 1
    bench.step(0.01)
    assert not any(math.isnan(value) for value in judge.seen[-1])
    assert judge.restarts == begun + 1


def test_a_controller_in_the_cycle_sends_in_the_cycle_that_has_measured(bench: Bench) -> None:
    """What the measurements ask for leaves with the same call, judged like every other command."""
    bench.start()
    seen: list[Snapshot] = []

    def control(snapshot: Snapshot) -> None:
        seen.append(snapshot)
        share = snapshot.pressures[0] / 1e6
        bench.driver.set_commands(NamedCommand(NAMES, (share, 0.0)), bench.now)

    for pressure in (100_000.0, 300_000.0):
        bench.board.pressures = [pressure, 100_000.0]
        bench.now += PERIOD
        bench.board.step(bench.now)
        snapshot = bench.driver.cycle(bench.now, 0.0, control=control)
        assert seen[-1].pressures[0] == pressure
        assert seen[-1].pressure_time == pytest.approx(bench.now, abs=PERIOD)
        assert seen[-1].joint_time == pytest.approx(bench.now, abs=PERIOD)
        assert snapshot.sent == pytest.approx((pressure / 1e6, 0.0))
