"""The gas volume of a muscle whose threads or cable stretch: slopes, energy, another plant."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from pam_check.blind.truth_plant import length_and_volume_at_rest
from pam_check.control.closed_loop import true_rig
from pam_model.muscles.force_model import ForceModel
from pam_model.rig import Muscle, load_rig
from pam_model.robot import compose
from pam_model.robot.static_force import gas_volume

ELBOW = Path(__file__).parents[2] / "config" / "elbow.yaml"
CABLE = {"cable_compliance": {"compliance": 8e-6}}
THREADS = {"braid_extensibility": {"compliance": 2.3e-7}}
STATES = [(5e4, 0.215), (2e5, 0.225), (4.5e5, 0.24)]  # Pa, m


def muscle_with(effects: dict[str, dict[str, float]]) -> tuple[ForceModel, Muscle]:
    rig = load_rig(ELBOW)
    muscle = replace(rig.muscles[0], effects=effects)
    return compose(rig.with_muscle(muscle)).muscle(muscle.name).force_model, muscle


@pytest.mark.parametrize("effects", [CABLE, THREADS, CABLE | THREADS], ids="+".join)
@pytest.mark.parametrize(("pressure", "length"), STATES)
def test_slopes_are_those_of_the_volume(effects, pressure, length):
    model, _ = muscle_with(effects)
    _, by_length, by_pressure = gas_volume(model, pressure, length)

    def volume(more_pressure: float, more_length: float) -> float:
        return gas_volume(model, pressure + more_pressure, length + more_length)[0]

    assert by_length == pytest.approx((volume(0, 1e-6) - volume(0, -1e-6)) / 2e-6, rel=1e-5)
    assert by_pressure == pytest.approx((volume(50, 0) - volume(-50, 0)) / 100, rel=1e-5)
    assert by_pressure > 0.0


@pytest.mark.parametrize(("pressure", "length"), STATES)
def test_the_gas_works_on_load_and_cable_alone(pressure, length):
    """At constant pressure p, p dV = -F dL + d(c F^2 / 2): nothing is gained or lost."""
    model, _ = muscle_with(CABLE)
    compliance = CABLE["cable_compliance"]["compliance"]
    force, stiffness = model.force(pressure, length), model.stiffness(pressure, length)
    work = pressure * gas_volume(model, pressure, length)[1]
    assert work == pytest.approx(-force + compliance * force * stiffness, rel=1e-9)


@pytest.mark.parametrize("effects", [{}, CABLE, THREADS, CABLE | THREADS], ids="+".join)
@pytest.mark.parametrize(("pressure", "length"), STATES)
def test_the_independent_plant_has_the_same_gas(effects, pressure, length):
    model, muscle = muscle_with(effects)
    per_thread = 2.0 * math.pi * muscle.turns**2 / muscle.thread_length
    threads = effects.get("braid_extensibility", {}).get("compliance", 0.0)
    _, (stiff, _) = true_rig(load_rig(ELBOW))
    truth = stiff._replace(
        cable_compliance=effects.get("cable_compliance", {}).get("compliance", 0.0),
        thread_compliance=threads * per_thread,
    )
    _, volume = length_and_volume_at_rest(truth, pressure, length)
    own = gas_volume(model, pressure, length)[0] + muscle.dead_volume
    assert own == pytest.approx(volume, rel=1e-7)


def test_a_slack_cable_changes_nothing():
    stiff, _ = muscle_with({})
    slack, _ = muscle_with(CABLE)
    short = stiff.length_bounds[0] + 1e-4
    assert slack.force(1e3, short) <= 0.0
    assert gas_volume(slack, 1e3, short) == gas_volume(stiff, 1e3, short)
