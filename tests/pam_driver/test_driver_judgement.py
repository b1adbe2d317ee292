"""What the driver lets be judged by physics and by the sensor checks, and what follows."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from pam_driver.boards.pam_board.codec import BoardCodec, BoardState
from pam_driver.boards.protocol import Condition
from pam_driver.safety.pressure_plausibility import Deviation
from pam_driver.safety.states import SafetyState
from pam_driver.safety.stop_categories import BRAKING_TIME
from pam_model.rig import Plausibility, Rig

from .exact_bench import GOOD, SUPPLY, TICK, ExactBench, Judge


@pytest.fixture
def bench(rig: Rig, codec: BoardCodec) -> ExactBench:
    return ExactBench(rig, codec)


@pytest.fixture
def judge() -> Judge:
    return Judge()


@pytest.fixture
def judged(rig: Rig, codec: BoardCodec, judge: Judge) -> ExactBench:
    return ExactBench(rig, codec, judge)


def test_the_judge_sees_commands_where_a_board_follows(judged: ExactBench, judge: Judge) -> None:
    judged.pressures = (0.0, 0.0)
    judged.step(8)
    assert judge.seen[-1].commands == (-1.0, -1.0)
    judged.activate()
    judged.step(1)
    assert judge.seen[-1].commands == (-1.0, -1.0)
    judged.follows = False
    judged.step(2, GOOD)
    assert judged.driver.state is SafetyState.ACTIVE
    assert judge.seen[-1].commands == (-1.0, -1.0)
    judged.follows = True
    judged.step(2, GOOD)
    assert judge.seen[-1].commands == GOOD
    judged.driver.vent_at_once(judged.now)
    judged.follows, judged.state = False, BoardState.ACTIVE
    judged.step(1)
    assert judge.seen[-1].commands == (-1.0, -1.0)


def test_a_regulator_vents_at_zero(rig: Rig, codec: BoardCodec, judge: Judge) -> None:
    extensor = rig.muscles[1]
    valve = replace(extensor.valve, kind="pressure_regulator", full_scale=6e5)
    bench = ExactBench(rig.with_muscle(replace(extensor, valve=valve)), codec, judge)
    bench.step(8)
    assert judge.seen[-1].commands == (-1.0, 0.0)


def test_the_judge_sees_what_was_measured(judged: ExactBench, judge: Judge) -> None:
    for _ in range(64):
        judged.position += 0.001
        snapshot = judged.step()
    seen = judge.seen[-1]
    assert seen.pressures == snapshot.pressures == (1e5, 2e5)
    assert seen.positions == snapshot.positions
    assert seen.velocities == snapshot.velocities
    assert seen.velocities[0] > 0.1
    assert seen.supplies == (SUPPLY, SUPPLY)


def test_a_supply_never_told_is_unknown(judged: ExactBench, judge: Judge) -> None:
    judged.step(silent=True)
    assert all(map(math.isnan, judge.seen[-1].supplies))
    assert judge.seen[-1].commands == (-1.0, -1.0)


def test_the_judge_sees_each_measurement_once(judged: ExactBench, judge: Judge) -> None:
    """What is not new is unknown, so that the physics predicts and does not believe old values."""
    judged.step(8)
    judged.step(1, silent=True)
    assert all(map(math.isnan, judge.seen[-1].pressures))
    judged.step()
    assert judge.seen[-1].pressures == (1e5, 2e5)


@pytest.mark.parametrize(("ticks", "anew"), [(25, 0), (27, 1)])
def test_physics_makes_up_for_a_short_pause_of_the_driver_and_begins_anew_after_a_long_one(
    ticks: int, anew: int, judged: ExactBench, judge: Judge
) -> None:
    judged.step(8)
    before = len(judge.seen)
    judged.now += ticks * TICK
    judged.step()
    assert judge.restarts == anew
    assert len(judge.seen) - before == (1 if anew else ticks + 1)
    assert judge.seen[-1].pressures == (1e5, 2e5)


@pytest.mark.parametrize("size", [0.75, 1.0, 1.5])
def test_what_the_judge_finds_is_a_suspicion_below_one_and_a_fault_from_one_on(
    size: float, judged: ExactBench, judge: Judge
) -> None:
    judged.start()
    judge.finds = [Deviation("pressure_implausible", "elbow_flexor", size, "a leak")]
    judged.step(1, GOOD)
    found = (Condition("pressure_implausible", "elbow_flexor", "a leak"),)
    if size < 1.0:
        assert (judged.driver.suspicions, judged.driver.conditions) == (found, ())
        assert judged.driver.state is SafetyState.ACTIVE
    else:
        assert (judged.driver.suspicions, judged.driver.faults) == ((), found)
        assert judged.driver.state is SafetyState.FAULT_LOWERING
        judged.step(round(BRAKING_TIME / TICK) + 1)
        assert judged.driver.state is SafetyState.FAULT


def test_a_joint_is_braked_for_a_short_time_although_lowering_may_take_long(
    judged: ExactBench, judge: Judge
) -> None:
    """After a fault that leaves air moving, the valves vent after `BRAKING_TIME` at the latest."""
    judged.start()
    judge.finds = [Deviation("pressure_implausible", "elbow_flexor", 2.0, "a leak")]
    judged.step(1, GOOD)
    began = judged.now
    while judged.driver.lowers:
        judged.step(1, GOOD)
    assert judged.now - began == pytest.approx(BRAKING_TIME, abs=2.0 * TICK)
    assert judged.driver.state is SafetyState.FAULT


def test_two_implausible_muscles_are_not_braked(judged: ExactBench, judge: Judge) -> None:
    """Crossed hoses, for example: neither muscle brakes for certain."""
    judged.start()
    flexor = Deviation("pressure_implausible", "elbow_flexor", 2.0, "a leak")
    judge.finds = [flexor]
    judged.step(1, GOOD)
    assert judged.driver.state is SafetyState.FAULT_LOWERING
    judge.finds = [flexor, flexor._replace(subject="elbow_extensor")]
    judged.step(1, GOOD)
    assert judged.driver.state is SafetyState.FAULT
    assert [fault.subject for fault in judged.driver.faults] == ["elbow_flexor", "elbow_extensor"]


def test_sensor_checks_count_beside_the_judge(rig: Rig, codec: BoardCodec, judge: Judge) -> None:
    wide = replace(rig, plausibility=Plausibility(pressure_noise=1e9, position_noise=1e9))
    bench = ExactBench(wide, codec, judge)
    bench.start()
    judge.finds = [Deviation("torque_implausible", "elbow", 2.0, "load")]
    bench.pressures, bench.position = (4e5, 2e5), 0.5
    bench.step(1, GOOD)
    kinds = [(fault.kind, fault.subject) for fault in bench.driver.faults]
    assert kinds == [
        ("torque_implausible", "elbow"),
        ("pressure_rate", "elbow_flexor"),
        ("position_jump", "elbow"),
    ]


def test_without_a_judge_sensors_are_not_checked(bench: ExactBench) -> None:
    bench.start()
    bench.pressures, bench.position = (4e5, 2e5), 0.5
    bench.step(1, GOOD)
    assert (bench.driver.conditions, bench.driver.suspicions) == ((), ())
