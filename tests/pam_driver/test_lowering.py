"""A stop of category 1 on a simulated elbow: the joint sinks and is never thrown."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from pam_driver.can_bus.bus import BusState
from pam_driver.driver_settings import DriverSettings
from pam_driver.safety.lowering import MOST_OPEN, LoweringSetpoints, _share
from pam_driver.safety.states import SafetyState
from pam_model.gas import valve_flow
from pam_model.rig import Rig
from pam_model.robot import compose

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
        """At most so long: until the driver has ended the motion and the empty arm hangs still."""
        end = self.bench.now + seconds
        while self.bench.now < end and not self._is_over():
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

    def _is_over(self) -> bool:
        truth = self.bench.truth
        ended = self.bench.driver.state in {SafetyState.VENTED, SafetyState.FAULT}
        is_empty = max(truth.pressures) < 1e3
        return ended and is_empty and abs(truth.velocities[0]) + abs(truth.positions[0]) < 0.02


def held(rig: Rig, settings: DriverSettings | None = None, **effects: float) -> ArmBench:
    bench = ArmBench(rig, settings, effects)
    bench.hold(list(HELD), 2.5)
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


@pytest.mark.sampled("four of the seven differences", cases=4)
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


# --- the law by hand, for the elbow: K = 30 1/s, Kp = 20 1/s times 0.05 kg m^2 = 1 N m s/rad ------


@pytest.mark.parametrize(
    ("rate", "first", "second", "openings"),
    [
        # one exhaust opens by a half, the other so far that -u_a first + u_b second = rate
        (0.0, 2.0, 1.0, (0.25, 0.5)),
        (0.0, 1.0, 2.0, (0.5, 0.25)),
        (0.2, 2.0, 1.0, (0.15, 0.5)),
        (-0.2, 1.0, 2.0, (0.5, 0.15)),
        # one alone opens further, at most fully
        (0.8, 2.0, 1.0, (0.0, 0.8)),
        (-0.8, 1.0, 2.0, (0.8, 0.0)),
        (3.0, 2.0, 2.0, (0.0, 1.0)),
        (-3.0, 2.0, 2.0, (1.0, 0.0)),
        # an empty muscle can give nothing
        (0.0, 0.0, 2.0, (0.5, 0.0)),
        (0.0, 2.0, 0.0, (0.0, 0.5)),
        (0.1, 2.0, 0.0, (0.0, 1.0)),
        (-0.1, 0.0, 2.0, (1.0, 0.0)),
    ],
)
def test_two_exhausts_share_the_rate_of_torque(
    rate: float, first: float, second: float, openings: tuple[float, float]
) -> None:
    assert _share(rate, first, second) == pytest.approx(openings, abs=1e-5)


def torque_of(rig: Rig, muscle: int, pressure: float, position: float) -> float:
    """Magnitude of a muscle's torque [N m]."""
    one, radius = rig.muscles[muscle], rig.joints[0].pulley_radius
    length = one.neutral_length + (-radius, radius)[muscle] * position
    return radius * float(rig.force_model(one.name).force(pressure, length))


def fall_of_pressure(rig: Rig, muscle: int, pressure: float, position: float) -> float:
    """With the exhaust fully open [Pa/s]: n R T m / V of air."""
    one, radius, gas = rig.muscles[muscle], rig.joints[0].pulley_radius, rig.gas
    length = one.neutral_length + (-radius, radius)[muscle] * position
    volume = float(rig.force_model(one.name).volume(length)) + one.dead_volume
    flow = valve_flow(
        -1.0,
        pressure + gas.ambient_pressure,
        supply_pressure=rig.supply_pressure,
        ambient_pressure=gas.ambient_pressure,
        conductance=one.valve.sonic_conductance,
        critical_ratio=one.valve.critical_ratio,
        temperature=gas.temperature,
    )
    return -gas.polytropic_exponent * 287.0 * gas.temperature * float(flow) / volume


def rate_of_torque(
    rig: Rig, openings: tuple[float, ...], pressures: tuple[float, float], position: float
) -> float:
    """How fast these openings change the joint's torque [N m/s]; force grows with pressure."""
    slopes = [
        torque_of(rig, k, pressures[k] + 1e3, position) - torque_of(rig, k, pressures[k], position)
        for k in (0, 1)
    ]
    falls = [
        slope / 1e3 * fall_of_pressure(rig, k, pressures[k], position)
        for k, slope in enumerate(slopes)
    ]
    return -openings[0] * falls[0] + openings[1] * falls[1]


def sum_of_torques(rig: Rig, pressures: tuple[float, float], position: float) -> float:
    """Of muscles and gravity [N m]."""
    joint = rig.joints[0]
    pull = torque_of(rig, 0, pressures[0], position) - torque_of(rig, 1, pressures[1], position)
    return pull - joint.gravity_torque * math.sin(position - joint.gravity_angle)


HELD_PAIR = (408e3, 121e3)
SPEED = 0.5  # rad/s


def begun(rig: Rig, setpoints: tuple[float, float] = (0.0, 0.0)) -> LoweringSetpoints:
    lowering = LoweringSetpoints(compose(rig), SPEED)
    lowering.start(setpoints, 10.0)
    return lowering


@pytest.mark.parametrize(("position", "pressures"), [(0.8, HELD_PAIR), (-0.8, HELD_PAIR[::-1])])
@pytest.mark.parametrize(
    ("pause", "rate"),
    # the wanted sum is Kp v = 0.5 N m downwards at once, and 8 1/s of it more with time, but not
    # for more than 20 ms
    [(0.0, 15.0), (0.005, 15.6), (0.01, 16.2), (1.0, 17.4)],
)
def test_the_torque_falls_at_the_rate_that_lets_a_held_joint_sink(
    position: float, pressures: tuple[float, float], pause: float, rate: float, rig: Rig
) -> None:
    lowering, down = begun(rig), math.copysign(1.0, -position)
    for now in (10.0, 10.0 + pause, 10.0 + pause):
        openings = opened(lowering, pressures, position, 0.0, now)
    assert rate_of_torque(rig, openings, pressures, position) == pytest.approx(
        down * rate, rel=2e-3
    )
    assert max(openings) == MOST_OPEN or min(openings) == 0.0, "as far open as possible"
    lowering.start((0.0, 0.0), 20.0)
    assert rate_of_torque(
        rig, opened(lowering, pressures, position, 0.0, 20.0), pressures, position
    ) == pytest.approx(down * 15.0, rel=2e-3), "a new lowering forgets the last one"


@pytest.mark.parametrize(("velocity", "counted"), [(0.0, 1.0), (0.15, 0.5), (-0.1, 2.0 / 3.0)])
def test_what_the_model_does_not_know_counts_as_long_as_the_joint_stands(
    velocity: float, counted: float, rig: Rig
) -> None:
    """A sum that is not zero at rest is the load's; at 0.3 rad/s it may be motion."""
    rig = replace(rig, gas=replace(rig.gas, temperature=340.0, polytropic_exponent=1.2))
    pressures = (390e3, 121e3)
    total = sum_of_torques(rig, pressures, 0.8)
    assert abs(total) > 0.3
    openings = opened(begun(rig), pressures, 0.8, velocity, 10.0)
    wanted = counted * total + 1.0 * (-0.5 - velocity)
    assert rate_of_torque(rig, openings, pressures, 0.8) == pytest.approx(
        30.0 * (wanted - total), rel=2e-3
    )


@pytest.mark.parametrize(
    ("speed", "most"),
    [
        (0.1, 4.9 * math.sin(0.05)),  # as much as gravity, which is 0.245 N m
        (0.2, 2.0 * 0.2),  # a joint that rises may be braked by Kp times its speed
    ],
)
def test_nothing_pulls_a_joint_down_faster_than_gravity_does(
    speed: float, most: float, rig: Rig
) -> None:
    """Near rest, where half of SPEED is wanted; with twice the inertia Kp is 2 N m s/rad."""
    rig = replace(rig, joints=(replace(rig.joints[0], inertia=0.1),))
    pressures, position = (135e3, 118e3), 0.05
    wanted_speed = SPEED * math.sin(position) / 0.1
    total = sum_of_torques(rig, pressures, position)
    unknown = total * (1.0 - speed / 0.3)
    assert unknown - 2.0 * (wanted_speed + speed) < -most
    lowering = begun(rig)
    for now in (10.0, 10.01, 10.02):
        openings = opened(lowering, pressures, position, speed, now)
        assert rate_of_torque(rig, openings, pressures, position) == pytest.approx(
            30.0 * (-most - total), rel=2e-3
        )
    # what was not given has not been added up either; what can be given is
    missing = 2.0 * (wanted_speed - 0.2)
    for added in (0.0, 8.0 * missing * 0.01):
        openings = opened(lowering, pressures, position, -0.2, 10.03)
        assert rate_of_torque(rig, openings, pressures, position) == pytest.approx(
            30.0 * (unknown - missing - added - total), rel=2e-3
        )


def opened(
    lowering: LoweringSetpoints,
    pressures: tuple[float, float],
    position: float,
    speed: float,
    now: float,
) -> tuple[float, ...]:
    """The openings of the exhausts of flow valves, 0 to 1."""
    return tuple(-told for told in lowering.setpoints(pressures, (position,), (speed,), now))


def test_the_set_points_of_regulators_fall_by_what_the_exhausts_let_out(rig: Rig) -> None:
    """The set point stands for the pressure, since the measured one lags behind it."""
    flow, setpoints = begun(rig), (0.68, 0.2)
    acting = (0.68 * 6e5, 0.2 * 6e5)
    for muscle in rig.muscles:
        valve = replace(muscle.valve, kind="pressure_regulator", full_scale=6e5)
        rig = rig.with_muscle(replace(muscle, valve=valve))
    lowering = begun(rig, setpoints)
    openings = opened(flow, acting, 0.8, 0.0, 10.004)
    told = lowering.setpoints((300e3, 200e3), (0.8,), (0.0,), 10.004)
    for k in (0, 1):
        fall = openings[k] * fall_of_pressure(rig, k, acting[k], 0.8) * 0.004
        assert told[k] == pytest.approx(setpoints[k] - fall / 6e5, rel=1e-4)
        assert told[k] < setpoints[k] - 1e-5


def test_the_set_point_of_a_regulator_with_a_wide_exhaust_ends_at_zero(rig: Rig) -> None:
    for muscle in rig.muscles:
        valve = replace(
            muscle.valve, kind="pressure_regulator", full_scale=6e5, sonic_conductance=1e-6
        )
        rig = rig.with_muscle(replace(muscle, valve=valve))
    assert begun(rig, (0.1, 0.1)).setpoints((6e4, 6e4), (0.0,), (0.0,), 10.02) == (0.0, 0.0)


@pytest.mark.parametrize("unknown", ["pressure", "position", "velocity"])
@pytest.mark.parametrize(("regulator", "vent"), [(False, -1.0), (True, 0.0)])
def test_exhausts_open_fully_where_a_measurement_is_missing(
    unknown: str, regulator: bool, vent: float, rig: Rig
) -> None:
    if regulator:
        for muscle in rig.muscles:
            valve = replace(muscle.valve, kind="pressure_regulator", full_scale=6e5)
            rig = rig.with_muscle(replace(muscle, valve=valve))
    told = begun(rig, (0.68, 0.2)).setpoints(
        (math.nan if unknown == "pressure" else 408e3, 121e3),
        (math.nan if unknown == "position" else 0.8,),
        (math.nan if unknown == "velocity" else 0.0,),
        10.0,
    )
    assert told == (vent, vent)


def test_measurements_that_do_not_fit_the_rig_are_a_mistake(rig: Rig) -> None:
    for positions, velocities in (((0.8,), ()), ((0.8,), (0.0, 0.0)), ((), (0.0,))):
        with pytest.raises(ValueError, match="zip"):
            begun(rig).setpoints(HELD_PAIR, positions, velocities, 10.0)
