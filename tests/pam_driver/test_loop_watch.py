"""The delays of the loop and the speed of the joints are measured and limited."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from pam_driver.boards.echo_delay import EchoDelay
from pam_driver.boards.pam_board.codec import BoardCodec
from pam_driver.driver import ActivationError
from pam_driver.safety.loop_watch import WINDOW, LoopWatch
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_model.rig import Rig

from .arm_bench import ArmBench
from .exact_bench import GOOD, NAMES, TICK, ExactBench

PERIOD, LIMIT = 0.002, 0.010
HELD = [3e5, 3e5]


@pytest.mark.parametrize("way", ["delay_down", "delay_up"])
@pytest.mark.parametrize(("delay", "stops"), [(0.006, False), (0.015, True), (0.04, True)])
def test_transport_delay_beyond_the_margins_stops_the_arm(
    way: str, delay: float, stops: bool, rig: Rig
) -> None:
    bench = ArmBench(rig)
    bench.hold(list(HELD), 1.0)
    setattr(bench, way, delay)
    began = bench.now
    while bench.driver.state is SafetyState.ACTIVE and bench.now - began < 0.5:
        bench.step()
    assert (bench.driver.state is SafetyState.FAULT) is stops
    if stops:
        assert [fault.kind for fault in bench.driver.faults] == ["loop_too_slow"]
        assert bench.now - began < WINDOW + 3.0 * delay + 0.03
        bench.driver.clear_faults(bench.now)
        bench.wanted = None
        bench.step(1.5)
        with pytest.raises(ActivationError, match="ms slower than 3 cycles"):
            bench.driver.activate(bench.now)


def test_both_ways_add_up(rig: Rig) -> None:
    bench = ArmBench(rig)
    bench.hold(list(HELD), 1.0)
    bench.delay_down = bench.delay_up = 0.008
    bench.step(0.3)
    assert [fault.kind for fault in bench.driver.faults] == ["loop_too_slow"]


def test_commands_that_arrive_late_count(rig: Rig, codec: BoardCodec) -> None:
    bench = ExactBench(rig, codec)
    bench.start()
    bench.step(16)
    for _ in range(128):
        bench.step()
        if bench.driver.state is not SafetyState.ACTIVE:
            break
        bench.driver.set_commands(NamedCommand(NAMES, GOOD, age=0.025), bench.now)
    (fault,) = bench.driver.faults
    assert fault.kind == "loop_too_slow"
    assert "commands 25 ms" in fault.text


def run(watch: LoopWatch, delays: list[float]) -> list[bool]:
    return [
        watch.update({"board 0": delay}, 0.0, 0.0, index * PERIOD) or bool(list(watch.conditions()))
        for index, delay in enumerate(delays)
    ]


def test_a_single_late_frame_is_no_fault_but_lasting_delay_is() -> None:
    normal, late = 0.004, 0.1
    burst = [normal] * 200 + [late] * 30 + [normal] * 200
    assert not any(run(LoopWatch(LIMIT, PERIOD), burst))
    lasting = run(LoopWatch(LIMIT, PERIOD), [normal] * 200 + [late] * 100)
    assert lasting.index(True) - 200 == pytest.approx(0.8 * WINDOW / PERIOD, abs=2)


def test_the_limit_is_counted_from_three_cycles() -> None:
    exactly = 3.0 * PERIOD + LIMIT
    assert not any(run(LoopWatch(LIMIT, PERIOD), [exactly - 1e-6] * 100))
    assert any(run(LoopWatch(LIMIT, PERIOD), [exactly + 1e-6] * 100))
    assert not any(run(LoopWatch(LIMIT, 2.0 * PERIOD), [exactly + 1e-6] * 100))


def test_what_is_unknown_is_no_delay() -> None:
    watch = LoopWatch(LIMIT, PERIOD)
    assert not any(run(watch, [math.nan] * 100))
    watch.update({}, math.inf, 0.0, 1.0)
    assert watch.delay == 0.0


def test_the_round_trip_is_that_of_the_echoed_command() -> None:
    echo = EchoDelay()
    echo.heard(7, 1.0)
    assert math.isnan(echo.value)
    for counter in range(300):
        echo.sent(counter & 0xFF, 1.0 + 0.002 * counter)
    echo.heard(43, 1.61)  # the 299th command
    assert echo.value == pytest.approx(1.61 - 1.598)
    echo.sent(43, 2.0)  # the counter comes round while the echo stands still
    echo.heard(43, 2.1)
    assert echo.value == pytest.approx(2.1 - 1.598)


def fast(bench: ExactBench, speed: float, ticks: int) -> Any:
    for _ in range(ticks):
        bench.position += speed * TICK
        snapshot = bench.step(1, GOOD)
    return snapshot


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_joint_above_its_speed_limit_stops(sign: float, rig: Rig, codec: BoardCodec) -> None:
    slow = replace(rig, joints=(replace(rig.joints[0], max_velocity=2.0),))
    bench = ExactBench(slow, codec)
    bench.start()
    for share in range(
        100
    ):  # a sudden start would be an acceleration that the air could go on with
        fast(bench, 0.0185 * share * sign, 1)
    assert bench.driver.state is SafetyState.ACTIVE
    fast(bench, 3.0 * sign, 12)
    (fault,) = bench.driver.faults
    assert (fault.kind, fault.subject) == ("joint_too_fast", "elbow")
    assert fault.text.endswith("max_velocity is 2 rad/s")


def test_one_outlier_of_the_encoder_is_not_speed(rig: Rig, codec: BoardCodec) -> None:
    bench = ExactBench(rig, codec)
    bench.start()
    bench.position += 0.05
    snapshot = bench.step(1, GOOD)
    assert snapshot.velocities[0] > rig.joints[0].max_velocity
    bench.position -= 0.05
    bench.step(50, GOOD)
    assert bench.driver.state is SafetyState.ACTIVE
