"""Constant channels and locked joints: rounding is no gap, and nothing is named for it."""

from dataclasses import replace

import numpy as np
import pytest

import pam_gap
from pam_gap.diagnosis_engine import JointDiagnosis
from pam_gap.prediction.channel_order import POSITION
from pam_gap.prediction.channels import joint_channels
from pam_gap.prediction.dead_sensors import dead_encoder
from pam_gap.prediction.identifiable import cautions
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.noise_floor import channel_noise, quantisation
from pam_gap.recordings.recording import LOCKED, Recording
from pam_gap.recordings.still_channels import without_still
from pam_model.effects import EFFECTS
from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.rig import Rig

from .conftest import Maker

POSITION_NAME = "joint_states.elbow.position"
LARGE = 1e9
"""kg m^2: an inertia that holds the joint of the simulated truth."""


def held(record: Maker, noise: float = 0.0, **effects: float) -> Recording:
    """Both muscles at constant length, with load cells; the position is a column of one value."""
    changes = {"joint.inertia": LARGE, "joint.viscous_friction": 100.0 * LARGE, **effects}
    recording = record(changes, cells=True)
    flicker = np.random.default_rng(2).standard_normal(recording.time.size)
    values = {**recording.values, POSITION_NAME: noise * flicker}
    return replace(recording, values=values)


def test_no_floor_is_below_what_any_sensor_resolves(rig: Rig, record: Maker) -> None:
    """A constant position had a floor of 5e-13 rad, and 7e-10 rad of drift counted as a gap."""
    constant = replace(held(record), mounting=LOCKED)
    channels = joint_channels(constant, rig, 0)
    assert channels.deviation[POSITION] > 1e-8
    assert channels.block_deviation[POSITION] > 1e-8


@pytest.mark.parametrize("changes", [1, 5])
def test_a_channel_that_changes_a_few_times_is_not_finer_than_its_changes(changes: int) -> None:
    values = np.full(4000, 0.2)
    for k in range(changes):
        values[700 * (k + 1) :] += 1e-3
    assert quantisation(values) == pytest.approx(1e-3)
    assert channel_noise(values).resolution == pytest.approx(1e-3)


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_a_joint_that_never_moves_is_locked_and_said_to_be(
    rig: Rig, record: Maker, noise: float
) -> None:
    found = without_still(held(record, noise), rig, 0)
    assert found.mounting == LOCKED
    assert "treated as locked" in found.repairs[-1]
    problem = PredictionProblem(rig, 0, [found])
    assert not problem.present[POSITION]
    assert problem.present.sum() == 4


def test_a_joint_that_moves_is_not_taken_for_locked(rig: Rig, record: Maker) -> None:
    recording = record()
    assert without_still(recording, rig, 0) is recording


def test_a_joint_held_against_a_known_torque_keeps_its_vote(rig: Rig, record: Maker) -> None:
    """Dry friction can hold it, so that the position tells something."""
    recording = held(record, 1e-4)
    torque = {"joint_states.elbow.effort": np.linspace(0.0, 1.0, recording.time.size)}
    pushed = replace(recording, values={**recording.values, **torque})
    assert without_still(pushed, rig, 0).mounting == ""


def test_a_pressure_of_one_value_is_not_compared(rig: Rig, record: Maker) -> None:
    recording = record()
    name = "pressure_states.elbow_flexor"
    values = {**recording.values, name: np.full(recording.time.size, 2e5)}
    found = without_still(replace(recording, values=values), rig, 0)
    assert found.silent == {name}
    assert "not compared" in found.repairs[-1]


def test_a_locked_joint_has_no_joint_effects_as_candidates(rig: Rig, record: Maker) -> None:
    locked, free = held(record), record(cells=True)
    stages = [
        {EFFECTS[c.effect].stage for c in JointDiagnosis(rig, 0, given).candidates}
        for given in ([without_still(locked, rig, 0)], [replace(locked, mounting=LOCKED), free])
    ]
    assert stages[0] == {"valve", "muscle", "sensing"}
    assert stages[1] == {"valve", "muscle", "joint", "sensing"}


@pytest.mark.skipif(not HAVE_NUMBA, reason="a whole search needs the compiled plant")
def test_nothing_of_the_joint_is_named_for_muscles_at_constant_length(
    rig: Rig, record: Maker
) -> None:
    """They were said to have Coulomb friction that closes 100 % of the gap."""
    (answer,) = pam_gap.diagnose(replace(held(record), mounting=LOCKED), rig)
    assert answer.verdict == "none"
    assert answer.effects == ()
    assert POSITION_NAME not in answer.gap


@pytest.mark.parametrize("size", [0.8, 1.0, 1.25])
def test_a_dead_encoder_is_not_taken_for_a_locked_joint(
    rig: Rig, record: Maker, size: float
) -> None:
    """A joint that moved with its encoder at 0 was named a tube, with a probability of 80 %."""
    moving = record({"pulley_radius.scale": size})
    dead = replace(moving, values={**moving.values, POSITION_NAME: np.zeros(moving.time.size)})
    (answer,) = pam_gap.diagnose(dead, rig, threads=1)
    assert answer.verdict == "not_identifiable"
    assert "Dead encoder: joint_states.elbow.position" in answer.sentence


@pytest.mark.parametrize("effects", [{}, {"agonist.leakage.conductance": 2e-10}])
def test_a_locked_joint_is_not_taken_for_a_dead_encoder(
    rig: Rig, record: Maker, effects: dict[str, float]
) -> None:
    problem = PredictionProblem(rig, 0, [without_still(held(record, **effects), rig, 0)])
    assert dead_encoder(problem) == ()
    assert "taken for locked" in cautions(problem)[0]
    told = without_still(replace(held(record), mounting=LOCKED), rig, 0)
    assert not any("taken for locked" in c for c in cautions(PredictionProblem(rig, 0, [told])))


def test_a_dead_pressure_sensor_is_told(rig: Rig, record: Maker) -> None:
    moving = record()
    name = "pressure_states.elbow_extensor"
    dead = replace(moving, values={**moving.values, name: np.zeros(moving.time.size)})
    (answer,) = pam_gap.diagnose(dead, rig, threads=1)
    assert answer.verdict == "not_identifiable"
    assert f"Dead sensor: {name} is 0 Pa throughout" in answer.sentence
