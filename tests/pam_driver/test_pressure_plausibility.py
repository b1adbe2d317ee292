"""The observer of each muscle's gas and the balance of each joint, by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from pam_driver.safety.pressure_plausibility import PressurePlausibility
from pam_model.effects import EFFECTS
from pam_model.effects.slots import JointTorque
from pam_model.rig import Rig
from pam_model.robot import compose

from .plausibility_bench import (
    PERIOD,
    SHARP,
    UNKNOWN,
    after_a_step,
    by_hand,
    largest_torque,
    observed,
    regulated,
    static_torque,
    torque_off,
)


@pytest.mark.parametrize("command", [1.0, 0.3, -0.4])
@pytest.mark.parametrize(
    ("position", "velocity"),
    [(0.0, 0.0), (0.5, 0.0), (-0.7, 1.5), (1.0, 3.0), (-1.0, 3.0), (1.4, -2.0)],
)
@pytest.mark.parametrize("supply", [math.nan, 5e5])
def test_the_observer_follows_the_gas_equations(
    command: float, position: float, velocity: float, supply: float, rig: Rig
) -> None:
    found = observed(rig, command, 1.5e5, position, velocity, supply)
    known = rig.supply_pressure if math.isnan(supply) else supply
    for name in rig.muscle_names:
        expected = by_hand(rig, name, command, 1.5e5, position, velocity, known)
        assert found[name] == pytest.approx(expected, rel=2e-3, abs=0.5)


@pytest.mark.parametrize("command", [0.9, 0.3, 0.26, 0.0])
def test_the_observer_of_a_regulator(command: float, rig: Rig) -> None:
    with_regulators = regulated(rig)
    found = observed(with_regulators, command, 1.5e5, 0.2, 0.5, steps=8)
    for name in rig.muscle_names:
        expected = by_hand(
            with_regulators, name, command, 1.5e5, 0.2, 0.5, rig.supply_pressure, steps=8
        )
        assert found[name] == pytest.approx(expected, rel=2e-3, abs=0.5)


@pytest.mark.parametrize(("regulator", "vent"), [(False, -1.0), (True, 0.0)])
def test_a_delay_of_the_command_in_the_rig_file_is_waited_for(
    regulator: bool, vent: float, rig: Rig
) -> None:
    """Until then the valve vents, as it does when the driver starts."""
    at_once = replace(regulated(rig) if regulator else rig, plausibility=SHARP)
    late = at_once
    for muscle in at_once.muscles:
        late = late.with_muscle(
            replace(muscle, effects={"command_delay": {"delay": 3.4 * PERIOD}})  # three periods
        )
    commands = [0.8, 0.2, 0.6, 0.4, 0.7, 0.3]
    delayed, told = (
        PressurePlausibility(compose(late), PERIOD),
        PressurePlausibility(compose(at_once), PERIOD),
    )
    seen = set()
    for command, acting in zip(commands, [vent] * 3 + commands[:3], strict=True):
        for plausibility, value in ((delayed, command), (told, acting)):
            plausibility.update([value] * 2, [1.5e5, 1.2e5], [0.1], [0.0], UNKNOWN)
        assert list(delayed.deviations()) == list(told.deviations())
        seen.add(tuple(delayed.deviations()))
    assert len(seen) == len(commands)


def test_an_adiabatic_gas_reacts_more(rig: Rig) -> None:
    adiabatic = replace(rig, gas=replace(rig.gas, polytropic_exponent=1.4))
    (slow, _), (fast, _) = (
        observed(r, 1.0, 1e5, 0.0, 0.0, steps=2).values() for r in (rig, adiabatic)
    )
    assert fast == pytest.approx(1.4 * slow, rel=1e-6)


def test_an_unknown_angle_counts_as_the_middle(rig: Rig) -> None:
    for position, velocity in ((math.nan, 1.0), (0.5, math.nan)):
        assert observed(rig, 1.0, 1e5, position, velocity) == observed(rig, 1.0, 1e5, 0.0, 0.0)


STEP = 5 * PERIOD  # torques are looked at in every fifth update


MEMORY = 0.15


@pytest.mark.parametrize("position", [0.3, -0.6])
@pytest.mark.parametrize("count", [5, 50])
def test_the_imbalance_of_a_joint_that_stands_still(position: float, count: int, rig: Rig) -> None:
    tilted = replace(rig, joints=(replace(rig.joints[0], gravity_angle=0.4),))
    pressures = (4e5, 1e5)
    found = torque_off(tilted, [(pressures, position, 0.0)] * count)
    settled = 1.0 - math.exp(-STEP / MEMORY * (count // 5))
    expected = static_torque(tilted, pressures, position) * settled
    limit = 0.25 * largest_torque(tilted)
    assert found is not None
    assert (found.kind, found.subject) == ("torque_implausible", "elbow")
    assert found.size == pytest.approx(abs(expected) / limit, rel=1e-9)
    assert found.text == (
        f"pressures and motion disagree by {expected:+.2f} N m (limit {limit:.2f} N m): "
        "sensor or load"
    )


def test_friction_and_inertia_take_their_share(rig: Rig) -> None:
    joint, pressures = rig.joints[0], (2e5, 2e5)
    limit = 0.25 * largest_torque(rig)
    weight = 1.0 - math.exp(-STEP / MEMORY)
    still = [(pressures, 0.2, 0.5)] * 5
    torque = static_torque(rig, pressures, 0.2) - joint.viscous_friction * 0.5
    found = torque_off(rig, still)
    assert found is not None
    assert found.size == pytest.approx(abs(torque * weight) / limit, rel=1e-9)
    found = torque_off(rig, [*still, *[(pressures, 0.2, 0.8)] * 5])
    faster = torque - joint.viscous_friction * 0.3
    settled = torque * weight + weight * (faster - torque * weight)
    expected = settled - joint.inertia * 0.3 / MEMORY
    assert found is not None
    assert found.size == pytest.approx(abs(expected) / limit, rel=1e-9)
    # the same speed goes on: what is left of the step fades with the memory
    found = torque_off(rig, [*still, *[(pressures, 0.2, 0.8)] * 10])
    settled += weight * (faster - settled)
    expected = settled - joint.inertia * 0.3 * (1.0 - weight) / MEMORY
    assert found is not None
    assert found.size == pytest.approx(abs(expected) / limit, rel=1e-9)


def spring_and_damper(position: float, speed: float, stiffness: float, damping: float) -> float:
    return -stiffness * (position - 0.1) - damping * speed


def test_a_joint_torque_of_an_own_effect_takes_its_share(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A spring and a damper beside the joint, as a user may add them in a file of effects."""
    # with the parameters of another effect of two numbers, so that the rest of it is complete
    effect = replace(EFFECTS["coulomb_friction"], slots=(JointTorque(spring_and_damper),))
    monkeypatch.setitem(EFFECTS, "coulomb_friction", effect)  # type: ignore[arg-type]
    effects = {"coulomb_friction": {"torque": 6.0, "presliding_angle": 0.1}}
    sprung = replace(rig, joints=(replace(rig.joints[0], effects=effects),))
    position, speed, pressures = 0.3, 0.5, (2e5, 2e5)
    found = torque_off(sprung, [(pressures, position, speed)] * 5)
    torque = static_torque(rig, pressures, position) - rig.joints[0].viscous_friction * speed
    torque += -6.0 * 0.2 - 0.1 * 0.5
    weight = 1.0 - math.exp(-STEP / MEMORY)
    assert found is not None
    assert found.text.startswith(f"pressures and motion disagree by {torque * weight:+.2f} N m")
    assert found.size == pytest.approx(
        abs(torque * weight) / (0.25 * largest_torque(rig)), rel=1e-9
    )


@pytest.mark.parametrize(("position", "judged"), [(0.96, True), (0.98, False), (-0.98, False)])
def test_nothing_is_said_near_the_end_stops(position: float, judged: bool, rig: Rig) -> None:
    found = torque_off(rig, [((4e5, 1e5), position, 0.0)] * 50)
    assert (found is not None) == judged


@pytest.mark.parametrize(
    "between", [((4e5, 1e5), 0.99, 0.0), ((math.nan, 1e5), 0.3, 0.0), ((4e5, math.nan), 0.3, 0.0)]
)
def test_the_balance_begins_anew_after_what_it_cannot_judge(
    between: tuple[tuple[float, float], float, float], rig: Rig
) -> None:
    good = [((4e5, 1e5), 0.3, 0.5)]
    # a gap in the measurements is ridden through, a long one is not
    count = 5 if math.isfinite(sum(between[0])) else 30
    assert torque_off(rig, good * 50 + [between] * count) is None
    # neither the torque nor the speed of before count
    after = [((4e5, 1e5), 0.3, -0.5)] * 5
    assert torque_off(rig, good * 50 + [between] * count + after) == torque_off(rig, after)


def test_a_vacuum_pulls_no_muscle(rig: Rig) -> None:
    assert torque_off(rig, [((-5e4, 1e5), 0.3, 0.0)] * 5) == torque_off(
        rig, [((0.0, 1e5), 0.3, 0.0)] * 5
    )


def test_torques_are_looked_at_in_every_fifth_update(rig: Rig) -> None:
    sample = [((4e5, 1e5), 0.3, 0.0)]
    assert torque_off(rig, sample * 4) is None
    assert torque_off(rig, sample * 9) == torque_off(rig, sample * 5)


def test_deviations_up_to_their_warning_share_are_not_named(rig: Rig) -> None:
    samples = [((4e5, 1e5), 0.3, 0.0)] * 50
    found = torque_off(rig, samples)
    assert found is not None
    assert torque_off(rig, samples, share=found.size) is None
    assert torque_off(rig, samples, share=math.nextafter(found.size, 0.0)) == found


def test_a_residual_is_named_with_its_limit(rig: Rig) -> None:
    plausibility = PressurePlausibility(compose(rig), PERIOD)
    assert plausibility.period == PERIOD
    for pressure in (2e5, 3.5e5):
        plausibility.update([0.0, 0.0], [pressure, 2e5], [0.0], [0.0], UNKNOWN)
    (found,) = [one for one in plausibility.deviations() if one.kind == "pressure_implausible"]
    assert found.subject == "elbow_flexor"
    assert found.text == (
        f"pressure deviates by {found.size * 1e5:+.0f} Pa from what the valve command should cause "
        "(limit 100000 Pa): leak, valve or sensor"
    )
    assert found.size == pytest.approx(1.5, rel=0.02)


@pytest.mark.parametrize(("first", "second"), [(0.6e5, -0.8e5), (-0.9e5, 0.7e5), (-0.6e5, 1.7e5)])
def test_opposite_deviations_of_a_pair_have_half_the_limit(
    rig: Rig, first: float, second: float
) -> None:
    """Both count as much as the smaller one, unless the larger one alone counts more."""
    found = after_a_step(rig, first, second)
    pair = min(abs(first), abs(second)) / 0.5e5
    for name, step in zip(rig.muscle_names, (first, second), strict=True):
        alone = abs(step) / 1e5
        assert found[name].size == pytest.approx(max(pair, alone), rel=0.02)
        if pair > alone:
            assert found[name].text.endswith(
                "(limit 50000 Pa): the other muscle of the joint the other way: hoses, sensors or "
                "encoder"
            )
            assert found[name].text.startswith(f"pressure deviates by {step / 1e3:+.0f}"[:22])
        else:
            assert found[name].text.endswith("(limit 100000 Pa): leak, valve or sensor")


def test_deviations_of_a_pair_in_one_direction_are_judged_alone(rig: Rig) -> None:
    """A supply that differs moves both pressures the same way."""
    assert after_a_step(rig, 0.45e5, 0.45e5) == {}
    assert after_a_step(rig, 0.45e5, 0.0) == {}


def test_the_smallest_deviations_of_a_pair_in_one_direction_are_judged_alone(rig: Rig) -> None:
    """With valves through which next to nothing flows, a residual is the whole step."""
    shut = replace(rig, plausibility=replace(SHARP, pressure_residual=1e3, warning_share=0.5))
    for muscle in rig.muscles:
        valve = replace(muscle.valve, sonic_conductance=1e-12)
        shut = shut.with_muscle(replace(muscle, valve=valve))
    assert after_a_step(shut, 400.0, 450.0) == {}
    found = after_a_step(shut, 400.0, -450.0)
    assert [one.size for one in found.values()] == pytest.approx([0.8, 0.8], rel=2e-3)


def test_a_pair_below_its_warning_share_is_not_named(rig: Rig) -> None:
    assert after_a_step(rig, 0.22e5, -0.4e5) == {}
    assert set(after_a_step(rig, 0.28e5, -0.4e5)) == set(rig.muscle_names)


def test_a_muscle_without_a_joint_is_observed_at_its_neutral_length(rig: Rig) -> None:
    alone = replace(rig, joints=(), muscles=rig.muscles[:1], plausibility=SHARP)
    plausibility = PressurePlausibility(compose(alone), PERIOD)
    for _ in range(6):
        plausibility.update([1.0], [1.5e5], [], [], [math.nan])
    (found,) = plausibility.deviations()
    expected = by_hand(rig, "elbow_flexor", 1.0, 1.5e5, 0.0, 0.0, rig.supply_pressure)
    assert found.size * 1e3 == pytest.approx(abs(expected), rel=2e-3)


def test_a_warm_gas_reacts_as_the_equations_say(rig: Rig) -> None:
    warm = replace(rig, gas=replace(rig.gas, temperature=340.0))
    found = observed(warm, 1.0, 1.5e5, 0.2, 0.5)
    for name in rig.muscle_names:
        expected = by_hand(warm, name, 1.0, 1.5e5, 0.2, 0.5, rig.supply_pressure)
        assert abs(expected) > 100.0
        assert found[name] == pytest.approx(expected, rel=2e-3)


def test_the_limit_of_torque_is_that_of_the_agonist_alone(rig: Rig) -> None:
    extensor = replace(rig.muscles[1], turns=1.5, rest_length=0.26, neutral_length=0.23)
    uneven = rig.with_muscle(extensor)
    found = torque_off(uneven, [((4e5, 1e5), 0.3, 0.0)] * 5)
    expected = static_torque(uneven, (4e5, 1e5), 0.3) * (1.0 - math.exp(-STEP / MEMORY))
    assert found is not None
    assert found.size == pytest.approx(abs(expected) / (0.25 * largest_torque(rig)), rel=1e-9)


def test_nothing_is_off_before_anything_is_known(rig: Rig) -> None:
    plausibility = PressurePlausibility(compose(replace(rig, plausibility=SHARP)), PERIOD)
    assert list(plausibility.deviations()) == []
    plausibility.update([1.0, 1.0], [1e5, 1e5], [0.0], [0.0], UNKNOWN)
    plausibility.update([1.0, 1.0], UNKNOWN, [0.0], [0.0], UNKNOWN)
    assert list(plausibility.deviations()) == []


def test_a_restart_forgets_every_deviation_of_a_pressure(rig: Rig) -> None:
    limits = replace(SHARP, pressure_residual=1.0)
    plausibility = PressurePlausibility(compose(replace(rig, plausibility=limits)), PERIOD)
    for pressure in (2e5, 3.5e5):
        plausibility.update([0.0, 0.0], [pressure, 2e5], [0.0], [0.0], UNKNOWN)
    assert len(list(plausibility.deviations())) == 2
    plausibility.restart()
    assert list(plausibility.deviations()) == []


def test_a_restart_forgets_the_balance_of_a_joint(rig: Rig) -> None:
    """Its speed from before a pause and that of after it would make an acceleration."""
    limits = replace(SHARP, pressure_residual=1e12)
    plausibility = PressurePlausibility(compose(replace(rig, plausibility=limits)), PERIOD)
    for _ in range(10):
        plausibility.update([0.0, 0.0], [4e5, 1e5], [0.3], [0.0], UNKNOWN)
    assert len(list(plausibility.deviations())) == 1
    plausibility.restart()
    assert list(plausibility.deviations()) == []


@pytest.mark.parametrize(("missing", "balanced"), [(2, True), (3, False)])
def test_the_balance_of_a_joint_outlives_a_gap_of_fifty_milliseconds(
    missing: int, balanced: bool, rig: Rig
) -> None:
    limits = replace(SHARP, pressure_residual=1e12)
    plausibility = PressurePlausibility(compose(replace(rig, plausibility=limits)), 0.025)
    for _ in range(5):
        plausibility.update([0.0, 0.0], [4e5, 1e5], [0.3], [0.0], UNKNOWN)
    before = list(plausibility.deviations())
    assert len(before) == 1
    for _ in range(missing):
        plausibility.update([0.0, 0.0], UNKNOWN, [0.3], [0.0], UNKNOWN)
    assert list(plausibility.deviations()) == (before if balanced else [])


def test_an_observer_starts_anew_once_after_a_gap_of_more_than_fifty_milliseconds(rig: Rig) -> None:
    plausibility = PressurePlausibility(compose(rig), PERIOD)
    plausibility.update([0.0, 0.0], UNKNOWN, [0.0], [0.0], UNKNOWN)
    assert plausibility.restarts == 0, "nothing was known that could be forgotten"
    plausibility.update([0.0, 0.0], [2e5, 2e5], [0.0], [0.0], UNKNOWN)
    seen = []
    for _ in range(30):
        plausibility.update([0.0, 0.0], [math.nan, 2e5], [0.0], [0.0], UNKNOWN)
        seen.append(plausibility.restarts)
    assert seen == [0] * 25 + [1] * 5


def test_measurements_that_do_not_fit_the_rig_are_a_mistake(rig: Rig) -> None:
    plausibility = PressurePlausibility(compose(rig), PERIOD)
    for positions, velocities in (([0.0], []), ([0.0], [0.0, 0.0]), ([], [0.0])):
        with pytest.raises(ValueError, match="zip"):
            plausibility.update([0.0] * 2, [1e5] * 2, positions, velocities, UNKNOWN)


# --- on the simulated plant --------------------------------------------------------------------
