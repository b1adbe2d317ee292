"""`vented` is measured in the muscles, and a blocked exhaust is a fault."""

from __future__ import annotations

import itertools
import random
from dataclasses import replace

import pytest

from pam_driver.boards.pam_board.codec import BoardCodec
from pam_driver.boards.protocol import Condition
from pam_driver.driver import ActivationError
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.exhaust_watch import exhaust_timeout
from pam_driver.safety.states import SafetyState
from pam_driver.safety.stop_categories import STOP_CATEGORIES, can_lower
from pam_model.rig import Rig
from pam_model.robot import compose

from .arm_bench import ArmBench
from .exact_bench import GOOD, SETTLED, TICK, ExactBench

LIMIT = DriverSettings().vented_pressure


@pytest.fixture
def bench(rig: Rig, codec: BoardCodec) -> ExactBench:
    return ExactBench(rig, codec)


@pytest.mark.parametrize("muscle", [0, 1])
def test_a_muscle_with_air_is_venting_and_is_not_activated(muscle: int, bench: ExactBench) -> None:
    pressures = [0.0, 0.0]
    pressures[muscle] = LIMIT
    bench.pressures = (pressures[0], pressures[1])
    bench.step(SETTLED)
    assert bench.driver.state is SafetyState.VENTING
    name = bench.driver.rig.muscle_names[muscle]
    with pytest.raises(ActivationError, match=f"empty yet: {name}: still 20000 Pa"):
        bench.driver.activate(bench.now)
    pressures[muscle] = LIMIT - 20.0
    bench.pressures = (pressures[0], pressures[1])
    bench.step()
    with pytest.raises(ActivationError, match="below 20000 Pa for less than 20 ms"):
        bench.driver.activate(bench.now)
    bench.step(SETTLED)
    assert bench.driver.state is SafetyState.VENTED
    bench.driver.activate(bench.now)
    assert bench.driver.state is SafetyState.READY


def test_a_reading_above_the_limit_does_not_change_the_state_but_air_does(
    bench: ExactBench,
) -> None:
    bench.pressures = (0.0, 0.0)
    bench.step(SETTLED)
    for pressure, ticks in ((1.2 * LIMIT, SETTLED), (3.0 * LIMIT, 10)):
        bench.pressures = (pressure, 0.0)
        bench.step(ticks)
        assert bench.driver.state is SafetyState.VENTED
    bench.pressures = (1.2 * LIMIT, 0.0)
    bench.step()
    bench.pressures = (1.3 * LIMIT, 0.0)
    bench.step(10)
    assert bench.driver.state is SafetyState.VENTED
    bench.step(2)
    assert bench.driver.state is SafetyState.VENTING


@pytest.mark.parametrize("share", [0.9, 1.0, 1.1, 1.25])
def test_noise_at_the_limit_does_not_make_the_state_flicker(
    share: float, bench: ExactBench
) -> None:
    """The lamp, the log and the controller follow the state."""
    draw = random.Random(7)
    states = []
    for _ in range(2048):
        bench.pressures = (draw.gauss(share * LIMIT, 5e3), 0.0)
        bench.step()
        states.append(bench.driver.state)
    assert set(states) <= {SafetyState.VENTING, SafetyState.VENTED}
    assert len(list(itertools.groupby(states))) <= 2


def test_air_that_is_let_in_is_seen_at_once(bench: ExactBench) -> None:
    """A stop just after the valves have opened must lower the arm, not drop it."""
    bench.pressures = (0.0, 0.0)
    bench.activate()
    bench.step(1, GOOD)
    bench.pressures = (2.0 * LIMIT, 2.0 * LIMIT)
    bench.step(1, GOOD)
    bench.driver.vent(bench.now)
    assert bench.driver.state is SafetyState.LOWERING


def test_an_unknown_pressure_is_not_empty(bench: ExactBench) -> None:
    bench.pressures = (0.0, 0.0)
    bench.step(SETTLED)
    assert bench.driver.state is SafetyState.VENTED
    bench.step(36, silent=True)  # sensor_timeout is 32 ticks
    assert bench.driver.state is SafetyState.VENTING


def test_a_blocked_exhaust_is_latched_and_named(rig: Rig, codec: BoardCodec) -> None:
    bench = ExactBench(rig, codec)
    bench.pressures = (0.0, 64e3)
    timeout = exhaust_timeout(compose(rig), LIMIT)
    bench.step(round(timeout / TICK))
    assert bench.driver.state is SafetyState.VENTING
    bench.step(4)
    assert bench.driver.state is SafetyState.FAULT
    (fault,) = bench.driver.faults
    assert (fault.kind, fault.subject) == ("exhaust_blocked", "elbow_extensor")
    assert fault.text.startswith("still 64000 Pa after")
    with pytest.raises(ActivationError, match=r"faults are latched.*still 64000 Pa"):
        bench.driver.activate(bench.now)
    bench.driver.clear_faults(bench.now)
    bench.step(4)
    assert bench.driver.state is SafetyState.VENTING
    with pytest.raises(ActivationError, match="not all muscles are empty"):
        bench.driver.activate(bench.now)
    bench.pressures = (0.0, 0.0)
    bench.step(SETTLED)
    bench.driver.activate(bench.now)


def test_an_exhaust_that_blocks_after_a_fault_joins_its_faults(rig: Rig, codec: BoardCodec) -> None:
    bench = ExactBench(rig, codec)
    bench.start()
    bench.pressures = (9e5, 0.0)
    bench.step(1, GOOD)
    bench.pressures = (3e5, 0.0)
    bench.step(round(exhaust_timeout(compose(rig), LIMIT) / TICK) + 4)
    assert [fault.kind for fault in bench.driver.faults] == ["over_pressure", "exhaust_blocked"]


def test_the_arm_is_vented_when_its_muscles_are_empty_and_not_before(rig: Rig) -> None:
    bench = ArmBench(rig)
    bench.hold([4e5, 4e5], 1.0)
    bench.driver.vent_at_once(bench.now)
    bench.wanted = None
    while bench.driver.state is not SafetyState.VENTED:
        bench.step()
        assert bench.driver.state in {SafetyState.VENTING, SafetyState.VENTED}
        assert bench.now < 110.0
    assert max(bench.truth.pressures) < LIMIT
    assert max(bench.truth.pressures) > 0.7 * LIMIT  # and it does not wait longer


def test_the_time_limit_follows_volume_and_conductance(rig: Rig) -> None:
    usual = exhaust_timeout(compose(rig), LIMIT)
    assert 3.0 < usual < 8.0
    flexor = rig.muscles[0]
    slow = replace(flexor.valve, sonic_conductance=flexor.valve.sonic_conductance / 10.0)
    slower = exhaust_timeout(compose(rig.with_muscle(replace(flexor, valve=slow))), LIMIT)
    assert slower - 1.0 == pytest.approx(10.0 * (usual - 1.0), rel=1e-6)


def test_a_condition_without_a_category_vents_at_once() -> None:
    assert can_lower([Condition("command_timeout", "", "")])
    assert not can_lower([Condition("command_timeout", "", ""), Condition("new", "", "")])
    assert all(category.reason for category in STOP_CATEGORIES.values())
