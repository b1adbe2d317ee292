"""The observer that follows a recording stays stable, whatever is tried in its parameters."""

from __future__ import annotations

import numpy as np

from pam_gap.prediction.channel_order import BOTH_PRESSURES, POSITION
from pam_gap.prediction.fit import mean_squares
from pam_gap.prediction.observer import observe
from pam_gap.prediction.problem import DIVERGED, PredictionProblem, PredictionSettings
from pam_model.plant.compiled import for_kernel
from pam_model.plant.constants import derive_constants
from pam_model.plant.parameters import INDEX, PlantParameters
from pam_model.plant.sensors import sensor_constants
from pam_model.plant.simulate import initial_state, simulate
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


def test_a_lagging_pressure_sensor_is_late_by_its_time_constant_at_any_rate(rig: Rig) -> None:
    """A lag of 30 ms in a log of 50 Hz was found 10 ms too short: each input came a sample late."""
    lag, sample_time, fine = 0.03, 0.02, 2.5e-4
    times, each = np.arange(400) * sample_time, round(sample_time / fine)
    swing = 0.04 * np.sin(2.0 * np.pi * (0.3 + 0.15 * times) * times)
    commands = np.column_stack([swing, -swing])
    parameters = PlantParameters.from_rig(rig)
    state = initial_state(parameters, pressures=(2e5, 2e5), position=0.0)
    true = simulate(parameters, np.repeat(commands, each, axis=0), fine, state).valve_pressures
    shown, reading = np.empty_like(true), true[0]
    for k, pressure in enumerate(true):  # of the sensor's equation, in steps of a lag/120
        reading = reading + fine / lag * (pressure - reading)
        shown[k] = reading
    values = parameters.values.copy()
    for muscle in ("agonist", "antagonist"):
        values[INDEX[f"{muscle}.pressure_lag.time_constant"]] = lag
    measured, known = np.zeros((len(times), 5)), np.zeros((len(times), 5), dtype=bool)
    measured[:, BOTH_PRESSURES], known[:, BOTH_PRESSURES] = shown[::each], True
    errors = observe(
        derive_constants(values)[None], sensor_constants(values)[None],
        tuple(for_kernel(table) for table in parameters.tables), commands, measured, known,
        state[None], sample_time=sample_time, step=1e-3, horizon=np.inf, block=1, catch_time=0.0,
    )[0, 5:, BOTH_PRESSURES]  # fmt: skip
    half_a_sample = 0.5 * sample_time * np.gradient(shown[::each], sample_time, axis=0)[5:]
    assert np.sqrt(np.mean(errors**2)) < 0.15 * np.sqrt(np.mean(half_a_sample**2))
