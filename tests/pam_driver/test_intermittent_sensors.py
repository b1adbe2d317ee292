"""Measurements that are missing between others are noticed, although no value becomes too old."""

from __future__ import annotations

import math

import pytest

from pam_driver.boards.availability import Availability
from pam_driver.boards.pam_board.codec import BoardCodec
from pam_driver.boards.pam_board.messages import Measurement
from pam_driver.boards.protocol import MuscleWire, WiredBoard
from pam_driver.boards.samples import ANGLE_INPUT, PRESSURE_INPUT, Samples
from pam_driver.safety.states import SafetyState
from pam_model.rig import People, Rig

from .test_short_noes import Bench

pytest.importorskip("rclpy")

EMPTY = (math.nan, math.nan)


def stranger(bench: Bench, pressures: tuple[float, float], position: float) -> None:
    """A frame under the identifier of the board, with the counter that is its turn or any other."""
    message = Measurement(pressures, position, (bench.board.counter + 1) & 0xFF)
    bench.board.port.send(*bench.codec.encode(0, message), bench.now)


@pytest.mark.parametrize(
    ("pressures", "position", "named"),
    [
        (EMPTY, math.nan, {"elbow_flexor", "elbow_extensor", "elbow"}),
        ((0.0, math.nan), 0.0, {"elbow_extensor"}),
        ((0.0, 0.0), math.nan, {"elbow"}),
    ],
)
def test_490_that_are_not_available_in_a_second_are_a_fault_with_its_own_name(
    rig: Rig,
    codec: BoardCodec,
    pressures: tuple[float, float],
    position: float,
    named: set[str],
) -> None:
    bench = Bench(rig, codec, People())
    bench.start()
    for number in range(500):
        if number % 50:  # 490 in a second, between 500 of the board
            stranger(bench, pressures, position)
        bench.cycle(command=bench.driver.state is SafetyState.ACTIVE)
    found = [fault for fault in bench.driver.faults if fault.kind == "sensor_intermittent"]
    assert {fault.subject for fault in found} & named
    assert "again and again" in found[0].text
    assert bench.driver.state is SafetyState.FAULT


def test_one_that_is_not_available_now_and_then_is_tolerated(rig: Rig, codec: BoardCodec) -> None:
    bench = Bench(rig, codec, People())
    bench.start()
    for number in range(500):
        if number % 100 == 50:
            stranger(bench, EMPTY, math.nan)
        bench.cycle(command=True)
    assert bench.driver.state is SafetyState.ACTIVE, bench.driver.faults


def test_what_stays_away_is_old_and_not_intermittent() -> None:
    availability = Availability()
    for tick in range(1000):
        availability.hear(ANGLE_INPUT, 0, tick < 500, 0.002 * tick)
    assert availability.missing_share(ANGLE_INPUT, 0, 2.0) == 0.0
    assert availability.missing_share(PRESSURE_INPUT, 0, 2.0) == 0.0
    availability.hear(ANGLE_INPUT, 0, True, 2.0)
    assert availability.missing_share(ANGLE_INPUT, 0, 2.0) > 0.5
    assert availability.missing_share(ANGLE_INPUT, 0, 3.1) == 0.0


def test_devices_of_other_kinds_are_counted_by_what_keeps_their_samples(rig: Rig) -> None:
    """Mapped and CANopen devices keep what they measure with the same object."""
    wired = WiredBoard("x", {}, (), (MuscleWire("p", 0, rig.muscles[0]),), ())
    samples = Samples(wired)
    keep = samples.keeper(PRESSURE_INPUT, "p")
    for tick in range(100):
        keep("sensor_error" if tick % 2 else "", 1e5, 0.002 * tick, 0.0)
    assert samples.availability.missing_share(PRESSURE_INPUT, "p", 0.2) == pytest.approx(
        0.5, abs=0.02
    )
