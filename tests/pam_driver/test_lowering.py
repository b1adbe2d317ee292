"""A stop of category 1 on a simulated elbow: the joint sinks and is never thrown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from pam_driver.can_bus.bus import BusState
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.states import SafetyState
from pam_model.rig import Rig

from .arm_bench import ArmBench

HELD = [408e3, 121e3]  # Pa; they hold the elbow at 0.8 rad against gravity
DROPS = DriverSettings(lowering_timeout=0.0)


class Watched:
    """What the arm does after a stop."""

    def __init__(self, bench: ArmBench) -> None:
        self.bench = bench
        self.start = bench.truth.positions[0]
        self.highest = self.lowest = self.start
        self.fastest = 0.0
        self.states: list[SafetyState] = []
        self.let_in = False

    def run(self, seconds: float) -> Watched:
        end = self.bench.now + seconds
        while self.bench.now < end:
            self.bench.step()
            truth = self.bench.truth
            self.highest = max(self.highest, truth.positions[0])
            self.lowest = min(self.lowest, truth.positions[0])
            self.fastest = max(self.fastest, abs(truth.velocities[0]))
            self.let_in |= any(value > 0.0 for value in self.bench.valve_commands)
            state = self.bench.driver.state
            if not self.states or state is not self.states[-1]:
                self.states.append(state)
        return self


def held(rig: Rig, settings: DriverSettings | None = None, **effects: float) -> ArmBench:
    bench = ArmBench(rig, settings, effects)
    bench.hold(list(HELD))
    return bench


def test_a_vent_at_once_throws_the_arm_upwards(rig: Rig) -> None:
    """Why there is a category 1: the antagonist empties first."""
    bench = held(rig, DROPS)
    assert bench.truth.positions[0] == pytest.approx(0.8, abs=0.02)
    bench.driver.vent(bench.now)
    bench.wanted = None
    seen = Watched(bench).run(3.0)
    assert seen.states == [SafetyState.VENTING, SafetyState.VENTED]
    assert seen.highest > seen.start + 0.1
    assert seen.fastest > 1.5


def test_a_lowered_arm_sinks_slowly_between_hold_and_rest(rig: Rig) -> None:
    bench = held(rig)
    bench.driver.vent(bench.now)
    bench.wanted = None
    seen = Watched(bench).run(4.0)
    assert seen.states == [SafetyState.LOWERING, SafetyState.VENTING, SafetyState.VENTED]
    assert seen.highest < seen.start + 0.002
    assert seen.lowest > -0.03  # of the swing about the rest position, 0 rad
    assert seen.fastest < 0.6
    assert not seen.let_in
    assert max(bench.truth.pressures) < 1e3


@pytest.mark.parametrize(
    "effects",
    [
        {"payload.mass": 2.0, "payload.distance": 0.2},
        {"coulomb_friction.torque": 0.4},
        {"elbow_flexor.exhaust_restriction.ratio": 0.5},
        {"elbow_extensor.exhaust_restriction.ratio": 0.5},
        {"position_delay.delay": 0.015},
        {"command_delay.delay": 0.015},
        {"valve_dead_zone.overlap": 0.05},
    ],
    ids=lambda effects: next(iter(effects)),
)
def test_an_arm_that_differs_from_its_file_is_not_thrown(
    effects: dict[str, float], rig: Rig
) -> None:
    bench = held(rig, None, **effects)
    bench.driver.vent(bench.now)
    bench.wanted = None
    seen = Watched(bench).run(6.0)
    assert seen.states[0] is SafetyState.LOWERING
    assert seen.states[-1] is SafetyState.VENTED
    assert seen.highest < seen.start + 0.005
    assert seen.fastest < 0.8


def test_regulators_are_lowered_too(rig: Rig) -> None:
    regulated = rig
    for muscle in rig.muscles:
        valve = replace(muscle.valve, kind="pressure_regulator", full_scale=6e5, time_constant=0.02)
        regulated = regulated.with_muscle(replace(muscle, valve=valve))
    bench = held(regulated)
    before = bench.valve_commands
    bench.driver.vent(bench.now)
    bench.wanted = None
    seen = Watched(bench)
    while bench.driver.state is not SafetyState.VENTED:
        seen.run(0.001)
        commands = bench.valve_commands
        assert all(new <= old for new, old in zip(commands, before, strict=True))
        before = commands
        assert bench.now < 110.0
    assert seen.highest < seen.start + 0.005
    assert seen.fastest < 0.8


def test_without_commands_the_arm_is_lowered_and_the_fault_latched(rig: Rig) -> None:
    bench = held(rig)
    bench.wanted = None
    seen = Watched(bench).run(4.0)
    assert seen.states == [SafetyState.ACTIVE, SafetyState.FAULT_LOWERING, SafetyState.FAULT]
    assert [fault.kind for fault in bench.driver.faults] == ["command_timeout"]
    assert seen.highest < seen.start + 0.01
    assert seen.fastest < 0.8


def lose_measurements(bench: ArmBench) -> None:
    bench.silent = lambda now: True


def lose_bus(bench: ArmBench) -> None:
    bench.wire.state = BusState.DOWN


@pytest.mark.parametrize("first", ["vent", "fault"])
@pytest.mark.parametrize(
    ("spoil", "kind"),
    [
        (lose_measurements, "stale_sensor"),
        (lose_bus, "bus_down"),
    ],
)
def test_a_fault_while_lowering_vents_at_once(
    first: str, spoil: Callable[[ArmBench], None], kind: str, rig: Rig
) -> None:
    bench = held(rig)
    bench.wanted = None
    if first == "vent":
        bench.driver.vent(bench.now)
    bench.step(0.3)
    assert bench.driver.state in {SafetyState.LOWERING, SafetyState.FAULT_LOWERING}
    spoil(bench)
    bench.step(0.06)
    assert bench.driver.state is SafetyState.FAULT
    assert kind in {fault.kind for fault in bench.driver.faults}
    assert bench.valve_commands == [-1.0, -1.0]


def test_a_second_vent_does_not_wait_for_the_lowering(rig: Rig) -> None:
    bench = held(rig)
    bench.driver.vent(bench.now)
    bench.wanted = None
    bench.step(0.1)
    assert bench.driver.state is SafetyState.LOWERING
    bench.driver.vent(bench.now)
    bench.step(0.002)
    assert bench.driver.state is SafetyState.VENTING
    assert bench.valve_commands == [-1.0, -1.0]


def test_a_lowering_that_takes_too_long_ends_in_a_vent(rig: Rig) -> None:
    bench = held(rig, DriverSettings(lowering_timeout=0.5))
    bench.driver.vent(bench.now)
    bench.wanted = None
    bench.step(0.49)
    assert bench.driver.state is SafetyState.LOWERING
    bench.step(0.02)
    assert bench.driver.state is SafetyState.VENTING


@pytest.mark.parametrize("speed", [1.0, 4.0])
def test_an_arm_that_is_stopped_in_motion_gets_no_faster_than_by_a_vent(
    speed: float, rig: Rig
) -> None:
    """Air that drives the arm must leave first; lowering keeps the air that brakes it."""
    seen = {}
    quick = replace(rig, joints=(replace(rig.joints[0], max_velocity=20.0),))
    for name, settings in (("lowered", None), ("vented", DROPS)):
        bench = held(quick, settings)
        bench.wanted = [HELD[1], HELD[0]]  # the mirrored position
        while bench.truth.velocities[0] > -speed:
            bench.step()
        bench.driver.vent(bench.now)
        bench.wanted = None
        seen[name] = Watched(bench).run(4.0)
        assert seen[name].states[-1] is SafetyState.VENTED
    assert seen["lowered"].fastest < seen["vented"].fastest
    assert seen["lowered"].highest < seen["vented"].highest
    assert seen["lowered"].lowest > seen["vented"].lowest
