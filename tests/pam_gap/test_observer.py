"""The observer that follows a recording stays stable, whatever is tried in its parameters."""

from __future__ import annotations

import numpy as np

from pam_gap.prediction.channel_order import BOTH_PRESSURES, POSITION
from pam_gap.prediction.fit import mean_squares
from pam_gap.prediction.problem import DIVERGED, PredictionProblem, PredictionSettings
from pam_model.plant.parameters import INDEX
from pam_model.rig import Rig


def test_a_late_encoder_shows_in_the_position_alone(rig: Rig, record) -> None:
    """The motion is corrected at first; with a late measurement this correction can swing."""
    problem = PredictionProblem(rig, 0, [record()])
    delays = np.array([0.0, 0.05, 0.1, 0.15, 0.2])
    lanes = np.repeat(problem.base.values[None], delays.size, axis=0)
    lanes[:, INDEX["position_delay.delay"]] = delays
    left = np.sqrt(mean_squares(problem.errors(lanes), problem.counted))
    assert (left[:, BOTH_PRESSURES] < 5.0).all()  # in noises; 18 to 62 where it swings
    assert (np.diff(left[:, POSITION]) > 0.0).all()


def test_a_simulation_that_diverges_is_far_off_and_never_without_an_error(rig: Rig, record) -> None:
    """Errors that are no numbers would not be counted, and the worst plant would be perfect."""
    problem = PredictionProblem(rig, 0, [record()])
    lanes = np.repeat(problem.base.values[None], 2, axis=0)
    lanes[1, INDEX["joint.inertia"]] = 1e-7
    lanes[1, INDEX["joint.viscous_friction"]] = 1e4
    written, diverged = problem.errors(lanes)
    assert (np.isfinite(written) == np.isfinite(diverged)).all()
    assert np.isfinite(diverged[:, problem.present]).all()
    left = mean_squares(diverged, problem.counted)
    assert left[POSITION] > (0.9 * DIVERGED) ** 2


def test_motion_along_the_measured_pressures_is_that_of_the_plant(rig: Rig, record) -> None:
    """Pressures that are held from sample to sample are half a sample late: 37 noises off."""
    problem = PredictionProblem(rig, 0, [record(duration=10.0)])
    along = PredictionSettings(follow_pressures=True)
    left = mean_squares(problem.errors(problem.base.values[None], along)[0], problem.counted)
    assert np.sqrt(left[POSITION]) < 6.0
