"""Short regular gaps in the measurements do not blind the comparison with the physics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from pam_driver.boards.pam_board.codec import BoardCodec
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.pressure_plausibility import LONGEST_GAP, PressurePlausibility
from pam_driver.safety.states import SafetyState
from pam_model.rig import Rig
from pam_model.robot import compose

from .arm_bench import ArmBench
from .exact_bench import GOOD, TICK, ExactBench, Judge

PERIOD = 0.002


def gaps(now: float) -> bool:
    """24 ms without measurements in every 60 ms."""
    return now % 0.06 < 0.024


def never(now: float) -> bool:
    return False


def moving(rig: Rig, silent: Callable[[float], bool]) -> ArmBench:
    """An arm whose pressures rise and fall, with these gaps in its measurements."""
    quick = replace(rig, joints=(replace(rig.joints[0], max_velocity=20.0),))
    bench = ArmBench(quick)
    bench.hold([2.5e5, 2.5e5], 1.5)
    bench.silent = silent
    return bench


def time_to_fault(bench: ArmBench, longest: float) -> float:
    """Time until the driver stops while the flexor is told to fill and to empty [s]."""
    began = bench.now
    while bench.driver.state is SafetyState.ACTIVE and bench.now - began < longest:
        high = int((bench.now - began) / 0.25) % 2 == 0
        bench.wanted = [3.5e5, 1.5e5] if high else [1.5e5, 3.5e5]
        bench.step()
    return bench.now - began


def stick(bench: ArmBench) -> None:
    address = next(iter(bench.sim.boards))
    bench.sim.faults.valves[address, 0] = 0.0


@pytest.mark.parametrize("silent", [never, gaps])
def test_a_stuck_valve_is_found_in_its_usual_time(
    silent: Callable[[float], bool], rig: Rig
) -> None:
    bench = moving(rig, silent)
    assert time_to_fault(bench, 1.0) >= 1.0, bench.driver.faults
    stick(bench)
    assert time_to_fault(bench, 1.0) < 0.4
    assert "pressure_implausible" in {fault.kind for fault in bench.driver.faults}


def test_a_gap_is_predicted_and_the_measurement_after_it_corrects(rig: Rig) -> None:
    """The residual after a gap is as small as without one, in a muscle that fills."""
    check = PressurePlausibility(compose(rig), PERIOD)
    idle = (0.0, 0.0)
    nan = float("nan")
    supply = (rig.supply_pressure,) * 2
    for _ in range(50):
        check.update(idle, (1e5, 1e5), (0.0,), (0.0,), supply)
    for _ in range(20):
        check.update((0.3, -0.3), (nan, nan), (0.0,), (0.0,), supply)
    flexor = check._muscles[0]
    assert flexor._state.at_sensor > 1.1e5 + rig.gas.ambient_pressure
    assert check.restarts == 0


def test_a_gap_that_is_too_long_starts_the_observers_anew(rig: Rig) -> None:
    check = PressurePlausibility(compose(rig), PERIOD)
    nan = float("nan")
    supply = (rig.supply_pressure,) * 2
    check.update((0.0, 0.0), (1e5, 1e5), (0.0,), (0.0,), supply)
    longest = round(LONGEST_GAP / PERIOD)
    for _ in range(longest):
        check.update((0.0, 0.0), (nan, nan), (0.0,), (0.0,), supply)
    assert check.restarts == 0
    for _ in range(5):
        check.update((0.0, 0.0), (nan, nan), (0.0,), (0.0,), supply)
    assert check.restarts == len(rig.muscles)
    assert not list(check.deviations())


def test_a_host_that_stalls_again_and_again_is_blind(rig: Rig, codec: BoardCodec) -> None:
    judge = Judge()
    bench = ExactBench(rig, codec, judge)
    bench.start()
    for stall in range(4):
        assert bench.driver.state is SafetyState.ACTIVE, stall
        bench.now += 0.06
        bench.step(32, GOOD)
    kinds = [fault.kind for fault in bench.driver.faults]
    assert kinds == ["driver_paused", "observers_blind"]
    assert judge.restarts == 4


def test_the_driver_catches_up_on_the_cycles_of_a_short_stall(rig: Rig, codec: BoardCodec) -> None:
    judge = Judge()
    bench = ExactBench(rig, codec, judge)
    bench.start()
    before = len(judge.seen)
    bench.now += 10 * TICK
    bench.step(1, GOOD)
    assert len(judge.seen) - before == 11
    assert judge.restarts == 0
    assert DriverSettings().period == PERIOD
