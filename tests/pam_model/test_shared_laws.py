"""Shared laws of plant, controller and diagnosis: rates and exact steps agree, inverses too."""

from __future__ import annotations

import math

import pytest

from pam_model.effects import EFFECTS, Inverse, filled
from pam_model.effects.creep import maxwell_rate, maxwell_step
from pam_model.effects.slots import Opening
from pam_model.gas import flow_function, flow_share, mass_flow, reference_density, reference_flow
from pam_model.physics.dahl import dahl_rate, dahl_slope, dahl_step
from pam_model.physics.joint_geometry import (
    SIGNS,
    length_per_position,
    muscle_length,
    muscle_torque,
    relative_arm,
    wound_angle,
)
from pam_model.physics.pressure_sensor import pressure_reading, true_pressure


@pytest.mark.parametrize("travel", [-4e-3, 2e-4, 3e-3])
@pytest.mark.parametrize("start", [-0.7, 0.0, 0.9])
def test_dahl_friction_steps_as_it_turns(start: float, travel: float) -> None:
    presliding, duration, count = 1e-3, 0.1, 20000
    step = duration / count
    state = start
    for _ in range(count):
        half = state + 0.5 * step * dahl_rate(state, travel / duration, presliding, step)
        state += step * dahl_rate(half, travel / duration, presliding, step)
    assert dahl_step(start, travel, presliding) == pytest.approx(state, abs=1e-7)


def test_dahl_friction_has_one_slope() -> None:
    speed = 0.02
    rate = dahl_rate(0.3, speed, 1e-3, 1e-6)
    assert dahl_slope(0.3, 1.0, 1e-3) * speed == pytest.approx(rate)
    assert dahl_rate(0.3, -speed, 1e-3, 1e-6) == pytest.approx(-speed * dahl_slope(0.3, -1.0, 1e-3))


def test_dahl_friction_turns_no_faster_than_a_step_can_follow() -> None:
    assert dahl_rate(0.0, 1e9, 1e-3, 1e-3) == pytest.approx(1e3)


def test_creep_steps_as_it_relaxes() -> None:
    stretch, stroke, duration, count = 2e-3, 5e-3, 0.7, 20000
    step = duration / count
    state = stretch
    for _ in range(count):
        half = state + 0.5 * step * maxwell_rate(state, stroke / duration, step, 0.1, 1.3)
        state += step * maxwell_rate(half, stroke / duration, step, 0.1, 1.3)
    assert maxwell_step(stretch, stroke, duration, 0.1, 1.3) == pytest.approx(state, rel=1e-8)
    assert maxwell_step(stretch, stroke, 0.0, 0.1, 1.3) == stretch + stroke


@pytest.mark.parametrize("name", [effect.name for effect, _ in filled(Opening)])
@pytest.mark.parametrize("opening", [-0.8, -0.05, 0.05, 0.6])
def test_the_controllers_inverse_opens_the_valve_as_asked(name: str, opening: float) -> None:
    effect = EFFECTS[name]
    (slot,) = effect.slots
    assert isinstance(slot, Opening)
    assert isinstance(effect.control, Inverse)
    values = [effect.portrait.sizes[key] for key in effect.parameters]
    assert slot.law(effect.control.law(opening, *values), *values) == pytest.approx(opening)


def test_a_corrected_pressure_is_the_true_one() -> None:
    assert true_pressure(pressure_reading(2e5, 1.03, -700.0), 1.03, -700.0) == pytest.approx(2e5)


@pytest.mark.parametrize("sign", SIGNS)
def test_a_muscle_does_the_work_that_its_joint_receives(sign: float) -> None:
    radius, pull, turn = 0.03, 120.0, 0.01
    shorter = muscle_length(0.2, sign, radius, 0.3) - muscle_length(0.2, sign, radius, 0.3 + turn)
    assert muscle_torque(sign, radius, pull) * turn == pytest.approx(pull * shorter)
    assert -length_per_position(sign, radius) * turn == pytest.approx(shorter)


def test_arrays_and_floats_flow_alike() -> None:
    ratios = [0.0, 0.2, 0.5, 0.95, 0.9995, 1.0]
    assert flow_function(ratios, 0.3) == pytest.approx([flow_share(r, 0.3) for r in ratios])
    one = reference_flow(2e-9, 0.3, 5e5, 2e5)
    assert reference_flow(2e-9, 0.3, 2e5, 5e5) == -one
    many = mass_flow(2e-9, 0.3, [5e5, 2e5], [2e5, 5e5], 300.0)
    assert many == pytest.approx([one * reference_density(300.0), -one * reference_density(300.0)])
    assert math.isclose(flow_share(0.999999999, 0.3), 0.0, abs_tol=1e-5)


def test_the_cable_winds_up_by_the_arm_of_an_uneven_pulley() -> None:
    """Virtual work: the torque of a pull is the pull times the arm at every angle."""
    slope, bend, step = 0.4, -0.3, 1e-6
    for position in (-0.8, -0.1, 0.0, 0.5):
        ahead, behind = (wound_angle(position + d, slope, bend) for d in (step, -step))
        arm = relative_arm(position, slope, bend)
        assert (ahead - behind) / (2.0 * step) == pytest.approx(arm, rel=1e-8)
    assert wound_angle(0.7, 0.0, 0.0) == 0.7
    assert relative_arm(0.7, 0.0, 0.0) == 1.0
