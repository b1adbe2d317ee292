"""Swings of rigs with hidden effects are told within three seconds, with their likely cause."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from pam_check.__main__ import main
from pam_check.control.closed_loop import PERIOD, TOLD
from pam_check.control.reported_swings import (
    STEP,
    TOLD_WITHIN,
    SwingResult,
    ordinary_motion,
    played,
    swing_size,
    ways,
)
from pam_check.control.rough_control import RoughControl
from pam_model.rig import load_rig

ELBOW = Path(__file__).parents[2] / "config" / "elbow.yaml"
pytest.importorskip("numba", reason="the truth plant is some 300 times slower without numba")


@pytest.fixture(scope="module")
def rough():
    return RoughControl(load_rig(ELBOW), TOLD, 5)


def first_told(rough, rig, motion):
    """When the controller first tells or does something about swings [s], and what it tells."""
    cycles = played(rough.controller, rough.hidden(rig), rough.motions[motion], 5, 0.0)
    return next(((time, told) for time, _, told in cycles if told), None)


@pytest.mark.parametrize(
    ("rig", "motion", "cause"),
    [
        ("stribeck_friction", "chirp", "dry friction that sticks"),
        ("commands 25 ms", "arm", "a delay"),
        ("commands 30 ms", "arm", "likely cause: a delay"),
        ("hysteresis, commands 19 ms", "arm", "a delay"),
        ("tube, falling friction", "chirp", "a tube"),
    ],
)
def test_swings_are_told_within_three_seconds_with_their_likely_cause(rough, rig, motion, cause):
    """A soft cycle of friction does not stop the joint, but its torque takes work all the time."""
    found = first_told(rough, rig, motion)
    assert found is not None
    time, told = found
    assert time < TOLD_WITHIN
    assert cause in told


@pytest.mark.parametrize(
    "rig", ["falling friction 0.25 and 0.5 N m", "falling friction 0.4 and 0.8 N m, slow"]
)
def test_friction_that_swings_a_softer_joint_is_named(rig):
    """With the default feedback it does not swing any more."""
    weaker = TOLD.replace(motion_observer=0.0, feedback_lead=0.5)
    time, told = first_told(RoughControl(load_rig(ELBOW), weaker, 5), rig, "chirp")
    assert time < TOLD_WITHIN
    assert "likely cause: dry friction" in told


@pytest.mark.parametrize("rig", ["nothing", "coulomb_friction", "payload", "position_delay"])
def test_nothing_is_told_of_an_ordinary_motion(rough, rig):
    for motion in rough.motions:
        assert first_told(rough, rig, motion) is None


def test_what_swings_at_rest_and_is_not_told_in_time_is_counted():
    def result(size, late):
        return SwingResult("nothing", "arm", 1e-3 * size, late + 7.0, late, "")

    assert result(5.0, math.inf).untold
    assert result(5.0, 3.5).untold
    assert not any(result(*each).untold for each in ((5.0, 1.0), (2.0, math.inf), (math.inf, 1.0)))
    times = np.arange(1000) * PERIOD
    assert swing_size(2e-3 * times + 2e-3 * np.sin(60.0 * times)) == pytest.approx(4e-3, rel=0.1)


def test_an_alarm_is_right_if_the_true_error_went_to_and_fro():
    times = np.arange(500) * PERIOD
    swing = 1.5e-3 * np.sin(2.0 * np.pi * 8.0 * times)
    assert ways((swing + 5e-3 * times).tolist(), 2e-3) in (15, 16)
    assert ways(swing.tolist(), 3.1e-3) == 0
    assert ways((0.02 * np.sin(2.0 * np.pi * times)).tolist(), 2e-3) == 3
    assert ways([0.0, 5.0], 2.0) == 1


@pytest.mark.parametrize("seed", range(8))
def test_half_of_the_ordinary_motions_have_velocities_and_accelerations(seed):
    points = ordinary_motion(np.random.default_rng(seed), 20.0)
    kinds = {(len(point.velocities), len(point.accelerations)) for point in points}
    assert kinds == ({(0, 0)} if np.random.default_rng(seed).uniform() < 0.5 else {(1, 1)})
    if kinds == {(1, 1)}:
        times = np.array([point.time_from_start for point in points])
        angle, speed, push = (
            np.array([getattr(point, name)[0] for point in points])
            for name in ("positions", "velocities", "accelerations")
        )
        close = np.isclose(np.diff(times), STEP)
        mean = 0.5 * (speed[1:] + speed[:-1]) - STEP / 12.0 * np.diff(push)
        assert (np.diff(angle) / STEP)[close] == pytest.approx(mean[close], abs=1e-3)


def test_ordinary_motion_is_within_the_range_of_the_joint_and_not_too_long():
    points = ordinary_motion(np.random.default_rng(1), 20.0)
    assert 10.0 < points[-1].time_from_start < 23.0
    assert np.ptp([point.positions[0] for point in points]) < 1.3
    assert max(abs(point.positions[0]) for point in points) < 0.7


def test_a_short_piece_of_ordinary_motion_has_one_reach_at_least():
    for seed in range(30):
        points = ordinary_motion(np.random.default_rng(seed), 3.0)
        assert 0.5 < points[-1].time_from_start < 6.0


def test_an_unknown_rig_is_one_line_and_exit_code_2(capsys):
    assert main(["reported-swings", "--rigs", "gremlins"]) == 2
    assert "--rigs gremlins: unknown" in capsys.readouterr().err
