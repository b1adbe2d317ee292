"""The start-up check step by step, with hand calculation."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from pam_driver.safety.start_up_check import (
    ABORT_ANGLE,
    ALLOWED_ANGLE,
    LARGEST,
    LEAST_SEEN,
    OVERLAP,
    RISE,
    SEEN_TURN,
    SMALLEST,
    Pulse,
    StartUpCheck,
    pulse_of,
)
from pam_model.rig import Muscle, Rig, load_rig
from pam_model.robot import compose

from .node_bench import ROOT
from .start_up_bench import TICK, Desk, desk_of, fills

TWO_JOINTS = ROOT / "config/two_joints.yaml"
NORMAL_DENSITY, NORMAL_TEMPERATURE = 1.185, 293.15  # kg/m^3, K: ISO 6358
GAS_CONSTANT = 287.05  # J/(kg K)
VALVES = [f"valve (board 0, channel {k})" for k in (0, 1)]
SENSORS = [f"pressure sensor (board 0, channel {k})" for k in (0, 1)]


@pytest.fixture
def elbow(rig: Rig) -> Rig:
    return rig


def pulse_in(rig: Rig, muscle: Muscle) -> Pulse:
    """The pulse of a muscle that takes its place in the rig."""
    robot = compose(rig.with_muscle(muscle))
    return pulse_of(robot, robot.muscle(muscle.name))


def gain(rig: Rig, muscle: int) -> float:
    """Torque for a pressure [N m/Pa], the largest of nine joint positions."""
    joint, one = rig.joints[0], rig.muscles[muscle]
    model, sign = compose(rig).muscle(one.name).force_model, (-1.0, 1.0)[muscle]
    low, high = joint.position_limits
    angles = [low + k * (high - low) / 8.0 for k in range(9)]
    lengths = [one.neutral_length + sign * joint.pulley_radius * angle for angle in angles]
    return joint.pulley_radius * max(float(model.force(LARGEST, x)) for x in lengths) / LARGEST


def with_joint(rig: Rig, **changes: float) -> Rig:
    return replace(rig, joints=(replace(rig.joints[0], **changes),))


@pytest.mark.parametrize("muscle", [0, 1])
@pytest.mark.parametrize("limits", [(-1.0, 1.0), (-0.2, 0.9)])
def test_a_pulse_is_what_gravity_or_inertia_hold(
    elbow: Rig, muscle: int, limits: tuple[float, float]
) -> None:
    """At the angle where the muscle pulls most: the agonist at the lower limit."""
    one, elbow = (
        elbow.muscles[muscle],
        replace(elbow, joints=(replace(elbow.joints[0], position_limits=limits),)),
    )
    heavy = with_joint(elbow, gravity_torque=-30.0, inertia=1e-6)
    expected = 30.0 * math.sin(ALLOWED_ANGLE) / gain(heavy, muscle)
    assert SMALLEST < expected < LARGEST
    assert pulse_in(heavy, one).pressure == pytest.approx(expected, rel=1e-9)
    slow = with_joint(elbow, gravity_torque=0.0, inertia=0.5)
    expected = 4.0 * 0.5 * ALLOWED_ANGLE / (gain(slow, muscle) * RISE**2)
    assert SMALLEST < expected < LARGEST
    assert pulse_in(slow, one).pressure == pytest.approx(expected, rel=1e-9)


def test_a_pulse_is_never_lost_in_noise_nor_dangerous(elbow: Rig) -> None:
    one = elbow.muscles[0]
    light = with_joint(elbow, gravity_torque=0.0, inertia=1e-6)
    assert pulse_in(light, one).pressure == SMALLEST
    assert pulse_in(with_joint(elbow, inertia=1e3), one).pressure == LARGEST
    weak = replace(one, max_pressure=2e4)
    assert pulse_in(with_joint(elbow, inertia=1e3), weak).pressure == 1e4
    alone = replace(elbow, joints=())
    assert pulse_in(alone, one).pressure == SMALLEST


def test_a_muscle_that_does_not_pull_at_low_pressure_has_the_largest_pulse(elbow: Rig) -> None:
    """Though its joint is light, which gives a muscle of the usual length the smallest."""
    light = with_joint(elbow, gravity_torque=0.0, inertia=1e-4)
    assert pulse_in(light, elbow.muscles[0]).pressure == SMALLEST
    shorter = replace(elbow.muscles[0], neutral_length=0.12)
    slack = with_joint(elbow.with_muscle(shorter), gravity_torque=0.0, inertia=1e-4)
    assert gain(slack, 0) <= 0.0
    assert pulse_in(slack, shorter).pressure == LARGEST


@pytest.mark.parametrize("temperature", [293.15, 340.0])
def test_the_ramp_of_a_flow_valve_fills_the_muscle_in_time(elbow: Rig, temperature: float) -> None:
    """Choked flow into the volume: m = s C p_0 rho_0 sqrt(T_0/T), dp/dt = n R T m / V."""
    elbow = replace(elbow, gas=replace(elbow.gas, temperature=temperature))
    one, pulse = elbow.muscles[0], pulse_in(elbow, elbow.muscles[0])
    gas, valve = elbow.gas, one.valve
    assert elbow.supply_pressure * valve.critical_ratio > gas.ambient_pressure
    volume = float(elbow.force_model(one.name).volume(one.neutral_length)) + one.dead_volume
    flow = valve.sonic_conductance * elbow.supply_pressure * NORMAL_DENSITY
    flow *= math.sqrt(NORMAL_TEMPERATURE / gas.temperature)
    rate = gas.polytropic_exponent * GAS_CONSTANT * gas.temperature * flow / volume
    # the spool opens with the time, so that the pressure grows with its square
    assert 0.5 * pulse.ramp * RISE**2 * rate == pytest.approx(pulse.pressure, rel=0.02)
    assert pulse.rise == pytest.approx(OVERLAP / pulse.ramp + 3.0 * RISE + 0.3, rel=1e-12)


def test_emptying_may_take_three_times_as_long_as_physics_needs(elbow: Rig) -> None:
    one, pulse = elbow.muscles[0], pulse_in(elbow, elbow.muscles[0])
    small = replace(one, valve=replace(one.valve, sonic_conductance=1e-12))
    held = pulse.fall - 0.9 - 2.0 * one.valve.time_constant
    # the flow after ISO 6358 is below its critical ratio; T = p / (dp/dt), and 4 T is almost empty
    gas, valve = elbow.gas, one.valve
    inside = pulse.pressure + gas.ambient_pressure
    ratio = (gas.ambient_pressure / inside - valve.critical_ratio) / (1.0 - valve.critical_ratio)
    flow = valve.sonic_conductance * inside * NORMAL_DENSITY * math.sqrt(1.0 - ratio**2)
    flow *= math.sqrt(NORMAL_TEMPERATURE / gas.temperature)
    volume = float(elbow.force_model(one.name).volume(one.neutral_length)) + one.dead_volume
    rate = gas.polytropic_exponent * GAS_CONSTANT * gas.temperature * flow / volume
    assert held == pytest.approx(3.0 * 4.0 * pulse.pressure / rate, rel=0.01)
    tiny = pulse_in(elbow, small).fall - 0.9 - 2.0 * one.valve.time_constant
    ratio = one.valve.sonic_conductance / 1e-12
    assert tiny == pytest.approx(held * ratio, rel=1e-6)
    slower = replace(one, valve=replace(one.valve, time_constant=one.valve.time_constant + 0.1))
    assert pulse_in(elbow, slower).fall == pytest.approx(pulse.fall + 0.2, rel=1e-12)


def test_a_regulator_gets_its_set_point_at_once_and_time_to_reach_it() -> None:
    rig = load_rig(TWO_JOINTS)
    one = rig.muscle("elbow_flexor")
    pulse = pulse_in(rig, one)
    assert pulse.ramp == 0.0
    assert pulse.rise == pytest.approx(30.0 * one.valve.time_constant + 0.3, rel=1e-12)
    assert pulse.fall > pulse.rise
    check = StartUpCheck(compose(rig), [0.0] * len(rig.muscles))
    place = rig.muscle_names.index(one.name)
    desk = Desk(rig, check, answers=[lambda fraction: 0.0] * len(rig.muscles))
    told = {round(fractions[place], 9) for fractions in desk.run()}
    assert told == {0.0, round(check.pulses[place].pressure / one.valve.full_scale, 9)}


def test_a_healthy_elbow_has_one_pulse_for_each_muscle_and_no_finding(elbow: Rig) -> None:
    desk = desk_of(elbow)
    told = desk.run()
    assert desk.findings == []
    order = [place for fractions in told for place in (0, 1) if fractions[place] > 0.0]
    assert order == sorted(order), "one after the other"
    assert set(order) == {0, 1}
    for fractions in told:
        assert fractions[0] >= 0.0 or fractions[0] == -1.0, "the others vent"
        assert fractions[1] >= 0.0 or fractions[1] == -0.5
    ramp = [fractions[0] for fractions in told if fractions[0] > 0.0]
    assert ramp[0] == pytest.approx(desk.check.pulses[0].ramp * TICK, rel=1e-6)
    assert ramp[-1] - ramp[-2] == pytest.approx(ramp[0], rel=1e-6)
    assert fills(ramp[-2]) < desk.check.pulses[0].pressure <= fills(ramp[-1] + ramp[0])


def test_muscles_without_a_joint_are_tested_too(elbow: Rig) -> None:
    desk = desk_of(replace(elbow, joints=()))
    assert {place for told in desk.run() for place in (0, 1) if told[place] > 0.0} == {0, 1}
    assert desk.findings == []


@pytest.mark.parametrize(
    ("turn", "reason"),
    [
        (0.02, f"the {SENSORS[0]} and the {SENSORS[1]} (elbow_extensor) are exchanged"),
        (-0.02, "its hose and that of elbow_extensor are crossed"),
        (0.0, "hoses, valves or sensors: elbow_extensor fills"),
    ],
)
def test_another_pressure_rises_and_the_turn_tells_why(
    elbow: Rig, turn: float, reason: str
) -> None:
    desk = desk_of(
        elbow,
        shows=lambda air: air[::-1],
        turns=lambda air: turn * (air[0] > 0.0) - turn * (air[1] > 0.0),
    )
    desk.run()
    assert desk.findings[0] == (
        "elbow_flexor",
        f"its {VALVES[0]} raises the pressure of elbow_extensor: {reason}",
    )
    assert [subject for subject, _ in desk.findings] == ["elbow_flexor", "elbow_extensor"]


def test_joined_hoses_are_named_with_all_muscles_that_fill(elbow: Rig) -> None:
    desk = desk_of(elbow, shows=lambda air: [sum(air)] * 2)
    desk.run()
    assert desk.findings == [
        (
            name,
            f"its {valve} also raises the pressure of {other}: hoses are joined",
        )
        for name, valve, other in (
            ("elbow_flexor", VALVES[0], "elbow_extensor"),
            ("elbow_extensor", VALVES[1], "elbow_flexor"),
        )
    ]


def test_a_joint_that_turns_the_wrong_way_means_crossed_hoses(elbow: Rig) -> None:
    desk = desk_of(elbow, turns=lambda air: -0.02 * (air[0] > 0.0) + 0.03 * (air[1] > 0.0))
    desk.run()
    wrong = "rad, the wrong way: hoses are crossed behind the"
    assert desk.findings == [
        (
            name,
            f"its {valve} turns the joint by {turn:+.2f} {wrong} {sensor}, or the encoder counts "
            "the other way",
        )
        for name, valve, turn, sensor in (
            ("elbow_flexor", VALVES[0], -0.02, SENSORS[0]),
            ("elbow_extensor", VALVES[1], 0.03, SENSORS[1]),
        )
    ]


@pytest.mark.parametrize("turn", [0.011, -0.011])
def test_a_turn_without_pressure_means_a_dead_sensor(elbow: Rig, turn: float) -> None:
    desk = desk_of(elbow, shows=lambda air: [0.0, air[1]], turns=lambda air: turn * (air[0] > 0.0))
    desk.run()
    assert desk.findings == [
        (
            "elbow_flexor",
            f"its {VALVES[0]} turns the joint by {turn:+.2f} rad, but its {SENSORS[0]} shows no "
            "pressure: the sensor is dead",
        )
    ]


@pytest.mark.parametrize("turn", [0.009, SEEN_TURN, -SEEN_TURN])
def test_a_turn_of_the_agonist_that_is_not_seen_tells_nothing(elbow: Rig, turn: float) -> None:
    desk = desk_of(elbow, shows=lambda air: [0.0, air[1]], turns=lambda air: turn * (air[0] > 0))
    desk.run()
    ((subject, text),) = desk.findings
    assert subject == "elbow_flexor"
    assert "shows no pressure after a pulse" in text


def test_a_pressure_that_rises_by_less_than_half_a_pulse_is_noise(elbow: Rig) -> None:
    desk = desk_of(
        elbow, shows=lambda air: [a + 0.49 * b for a, b in zip(air, air[::-1], strict=True)]
    )
    desk.run()
    assert desk.findings == []


def test_a_pulse_is_judged_when_the_sensors_had_time_to_show_it(elbow: Rig) -> None:
    """The other muscle is not touched before, also if the pressure has fallen at once."""
    desk = desk_of(elbow, now=1000.0)
    told = desk.run(until=1060.0)
    last = max(cycle for cycle, fractions in enumerate(told) if fractions[0] > 0.0)
    first = min(cycle for cycle, fractions in enumerate(told) if fractions[1] > 0.0)
    assert (first - last) * TICK >= 0.3 + 0.25, "settling of the sensors, then stillness"


@pytest.mark.parametrize("turn", [0.009, SEEN_TURN, -SEEN_TURN])
def test_nothing_at_all_means_valve_hose_or_sensor(elbow: Rig, turn: float) -> None:
    desk = desk_of(elbow, shows=lambda air: [air[0], 0.0], turns=lambda air: turn * (air[1] > 0))
    told = desk.run()
    assert desk.findings == [
        (
            "elbow_extensor",
            f"its {SENSORS[1]} shows no pressure after a pulse: its {VALVES[1]} is stuck shut, its "
            "hose is off or closed, or the sensor is dead",
        )
    ]
    pulse = desk.check.pulses[1]
    filled = TICK * sum(fractions[1] > 0.0 for fractions in told)
    assert filled == pytest.approx(pulse.rise, abs=2.0 * TICK)
    assert max(fractions[1] for fractions in told) == pytest.approx(
        min(1.0, pulse.ramp * pulse.rise), rel=0.02
    )


def test_a_joint_that_turns_too_far_ends_the_check(elbow: Rig) -> None:
    too_far = ABORT_ANGLE + 0.01
    desk = desk_of(elbow, turns=lambda air: too_far * (air[0] > 5e3))
    told = desk.run()
    ((subject, text),) = desk.findings
    assert subject == "elbow_flexor"
    assert text.startswith("a pulse of ")
    assert text.endswith(
        f" Pa turns the joint by {too_far:+.2f} rad, allowed are 0.15 rad: load or {SENSORS[0]} "
        "differ from the rig file"
    )
    assert not any(fractions[1] > 0.0 for fractions in told), "the other muscle gets no air"


def test_only_a_joint_that_nothing_holds_back_is_free(elbow: Rig) -> None:
    one = elbow.muscles[0]
    assert not pulse_in(elbow, one).free
    assert not pulse_in(with_joint(elbow, gravity_torque=0.0, inertia=0.5), one).free
    assert pulse_in(with_joint(elbow, gravity_torque=0.0, inertia=1e-4), one).free
    assert not pulse_in(replace(elbow, joints=()), one).free


def test_a_free_joint_cuts_its_pulse_short_and_may_coast_on(elbow: Rig) -> None:
    """Half of the pressure that was reached tells the muscles apart."""
    free = with_joint(elbow, gravity_torque=0.0, inertia=1e-4)
    desk = desk_of(free, turns=lambda air: 0.2 * (air[0] >= LEAST_SEEN) - 0.2 * (air[1] >= 3e3))
    told = desk.run()
    assert desk.findings == []
    highest = [max(fills(fractions[place]) for fractions in told) for place in (0, 1)]
    assert LEAST_SEEN <= highest[0] < 1.2 * LEAST_SEEN
    assert 3e3 <= highest[1] < 3.6e3
    joined = desk_of(
        free,
        turns=lambda air: 0.2 * (air[0] >= LEAST_SEEN),
        shows=lambda air: [air[0], max(air[1], air[0])],
    )
    joined.run()
    assert joined.findings[0][1].endswith("hoses are joined")


def test_a_free_joint_that_turns_without_pressure_ends_the_check(elbow: Rig) -> None:
    free = with_joint(elbow, gravity_torque=0.0, inertia=1e-4)
    desk = desk_of(
        free,
        turns=lambda air: 0.2 * (air[0] > 1e3),
        shows=lambda air: [0.9 * LEAST_SEEN * (a > 0) for a in air],
    )
    desk.run()
    assert desk.findings[0][1].endswith("the sensor is dead")


def test_the_largest_turn_counts_though_the_joint_swings_back(elbow: Rig) -> None:
    swing = iter([0.0, *[-0.03] * 3])
    desk = desk_of(
        elbow,
        shows=lambda air: [0.0, air[1]],
        turns=lambda air: next(swing, 0.0) if air[0] > 0.0 else 0.0,
    )
    desk.run()
    assert "turns the joint by -0.03 rad" in desk.findings[0][1]


def test_a_muscle_that_does_not_become_empty_is_told_before_any_pulse(elbow: Rig) -> None:
    desk = desk_of(elbow, shows=lambda air: [2.5e4, air[1]])
    told = desk.run()
    assert desk.findings == [
        (
            "elbow_flexor",
            f"shows 25000 Pa while it vents: its {VALVES[0]} is stuck open, its exhaust is "
            f"blocked, or its {SENSORS[0]} is wrong",
        )
    ]
    assert set(told) == {(-1.0, -0.5)}
    assert desk.now == pytest.approx(10.0, abs=0.01)


def test_a_missing_reading_is_no_empty_muscle(elbow: Rig) -> None:
    desk = desk_of(elbow, shows=lambda air: [math.nan, air[1]])
    assert set(desk.run()) == {(-1.0, -0.5)}
    assert [subject for subject, _ in desk.findings] == ["elbow_flexor"]


def test_a_joint_that_does_not_come_to_rest_is_not_tested(elbow: Rig) -> None:
    desk = desk_of(elbow)
    desk.turns = lambda air: 0.01 * math.sin(20.0 * desk.now)
    assert set(desk.run()) == {(-1.0, -0.5)}
    assert desk.findings == [("elbow_flexor", "not tested: elbow does not come to rest")]


def test_which_of_several_joints_does_not_come_to_rest_is_not_said() -> None:
    rig = load_rig(TWO_JOINTS)
    check = StartUpCheck(compose(rig), [0.0] * len(rig.muscles))
    desk = Desk(rig, check, answers=[fills] * len(rig.muscles))
    desk.turns = lambda air: 0.01 * math.sin(20.0 * desk.now)
    desk.run()
    assert desk.findings == [(rig.muscle_names[0], "not tested: a joint does not come to rest")]


def test_a_pulse_waits_until_joint_and_pressures_have_been_still(elbow: Rig) -> None:
    desk = desk_of(elbow)
    desk.turns = lambda air: 0.01 * min(desk.now, 1.0)
    first = next(k for k, fractions in enumerate(desk.run()) if fractions[0] > 0.0)
    assert 1.0 < TICK * first < 1.3, "still for 0.25 s"
    desk = desk_of(elbow)
    step = 0.3 * desk.check.pulses[0].pressure
    desk.shows = lambda air: [air[0], step * (desk.now % 0.2 < 0.1) * (desk.now < 1.0) + air[1]]
    first = next(k for k, fractions in enumerate(desk.run()) if fractions[0] > 0.0)
    assert 0.95 < TICK * first < 1.3


def test_a_muscle_that_keeps_its_air_ends_the_check_after_its_time(elbow: Rig) -> None:
    kept = [0.0]

    def keeps(air: list[float]) -> list[float]:
        kept[0] = max(kept[0], air[0])
        return [kept[0], air[1]]

    desk = desk_of(elbow, shows=keeps)
    told = desk.run()
    pulse: Pulse = desk.check.pulses[0]
    ((subject, text),) = desk.findings
    assert subject == "elbow_flexor"
    assert text == (
        f"its {SENSORS[0]} still shows {kept[0]:.0f} Pa {pulse.fall:.2g} s after the pulse: its "
        f"exhaust is blocked or its {VALVES[0]} is stuck open"
    )
    last = max(k for k, fractions in enumerate(told) if fractions[0] > 0.0)
    assert TICK * (len(told) - last) == pytest.approx(pulse.fall, abs=4.0 * TICK)
    assert not any(fractions[1] > 0.0 for fractions in told)


@pytest.mark.parametrize(("left", "empty"), [(0.4, True), (0.6, False)])
def test_a_muscle_is_empty_below_half_of_its_pulse(elbow: Rig, left: float, empty: bool) -> None:
    desk = desk_of(elbow)
    filled = [False]

    def leaves(air: list[float]) -> list[float]:
        filled[0] |= air[0] > 0.0
        rest = left * desk.check.pulses[0].pressure * filled[0]
        return [max(air[0], rest), air[1]]

    desk.shows = leaves
    desk.run()
    assert (desk.findings == []) is empty


def test_a_check_that_has_not_been_started_begins_at_time_zero(elbow: Rig) -> None:
    check = StartUpCheck(compose(elbow), (-1.0, -0.5))
    assert check.findings == ()
    for now in (0.02 * tick for tick in range(501)):
        assert check.setpoints([5e4, 0.0], [0.0], now) == (-1.0, -0.5)
        assert not check.finished
    check.setpoints([5e4, 0.0], [0.0], 10.001)
    assert check.finished
    assert [found.subject for found in check.findings] == ["elbow_flexor"]


def test_a_second_start_forgets_the_first(elbow: Rig) -> None:
    desk = desk_of(elbow, shows=lambda air: [0.0, 0.0])
    desk.run()
    assert len(desk.findings) == 2
    desk.shows = list
    desk.run(until=desk.now + 60.0)
    assert desk.findings == []
