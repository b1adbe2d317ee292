"""Friction of the joint: sticking, sliding and presliding follow their laws."""

from __future__ import annotations

import numpy as np
import pytest

from .held_run import simulate_held


def test_dry_friction_sticks_and_never_speeds_up(parameters):
    held = simulate_held(parameters, {"coulomb_friction.torque": 2.0}, pressures=(2.05e5, 2e5))
    assert np.all(held.position == 0.0)
    free = simulate_held(parameters, {}, pressures=(2.05e5, 2e5))
    assert np.ptp(free.position) > 1e-3
    swing = simulate_held(
        parameters, {"coulomb_friction.torque": 0.5, "joint.viscous_friction": 0.0},
        position=0.5, shut=True,
    )  # fmt: skip
    assert swing.velocity[-1] == 0.0
    rough = simulate_held(parameters, {"joint.viscous_friction": 0.0}, position=0.5, shut=True)
    assert np.max(np.abs(rough.velocity[-200:])) > 0.1


def test_stick_is_independent_of_the_step(parameters, run):
    rough = parameters.replaced({"coulomb_friction.torque": 0.6})
    a, b = run(rough, step=2.5e-4), run(rough, step=1e-4)
    np.testing.assert_allclose(a.position, b.position, atol=2e-4)


def test_presliding_is_a_spring_until_it_slips(parameters):
    """After a push in one direction, Dahl's law gives torque = T (1 - exp(-q/q_p)) at rest."""
    changes = {
        "coulomb_friction.torque": 2.0,
        "coulomb_friction.presliding_angle": 2e-3,
        "joint.viscous_friction": 20.0,  # no overshoot
    }
    result = simulate_held(parameters, changes, pressures=(2.3e5, 2e5), shut=True)
    turned = result.position[-1]
    pushed = result.torque[-1] - parameters["joint.gravity_torque"] * np.sin(turned)
    assert abs(result.velocity[-1]) < 1e-6
    assert 0.2 < pushed / 2.0 < 0.95
    assert turned == pytest.approx(-2e-3 * np.log(1.0 - pushed / 2.0), rel=0.02)


def test_presliding_vanishes_with_its_angle(parameters, run):
    """A very stiff contact gives the same motion as exact sticking."""
    rough = parameters.replaced({"coulomb_friction.torque": 0.6})
    exact = run(rough).position
    far, near = (
        np.max(
            np.abs(run(rough.replaced({"coulomb_friction.presliding_angle": q})).position - exact)
        )
        for q in (1e-2, 3e-4)
    )
    assert near < 2e-3 < far


def test_presliding_brings_a_swing_to_rest(parameters):
    changes = {
        "stribeck_friction.static_torque": 0.8,
        "stribeck_friction.torque": 0.4,
        "stribeck_friction.presliding_angle": 1e-3,
        "joint.viscous_friction": 0.0,
    }
    swing = simulate_held(parameters, changes, position=0.5, shut=True)
    assert np.max(np.abs(swing.velocity[:200])) > 0.1
    assert np.max(np.abs(swing.velocity[-100:])) < 1e-3


def test_stribeck_breaks_away_late_and_slides_easily(parameters):
    ramp = np.tile([0.004, -0.004], (1500, 1))
    level = {"stribeck_friction.static_torque": 1.0, "stribeck_friction.torque": 0.3}
    falling = simulate_held(parameters, level, commands=ramp)
    low = simulate_held(parameters, {"coulomb_friction.torque": 0.3}, commands=ramp)
    high = simulate_held(parameters, {"coulomb_friction.torque": 1.0}, commands=ramp)
    first = [np.argmax(np.abs(r.position) > 1e-6) for r in (low, falling, high)]
    assert first[0] < first[1]
    assert abs(first[1] - first[2]) <= 1
    assert np.max(falling.velocity) > np.max(high.velocity)
