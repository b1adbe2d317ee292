"""Regulators of second order exceed their commands; no known effect does, and none is named."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pam_gap.diagnosis_engine import JointDiagnosis
from pam_gap.inference.background import sensor_parts
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import Recording
from pam_gap.rules import DEFAULT
from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import Plant, initial_state
from pam_model.rig import Rig

needs_numba = pytest.mark.skipif(not HAVE_NUMBA, reason="a whole search needs the compiled plant")
STEP, DURATION = 0.004, 9.0  # s
SLOW, LEAD = 0.028, 2.2  # s and -: the outlet exceeds the command by 15 to 20 % near 4 Hz
MEAN = 2.2e5  # Pa


def regulated(rig: Rig) -> Rig:
    for muscle in rig.muscles:
        valve = replace(muscle.valve, kind="pressure_regulator")
        rig = rig.with_muscle(replace(muscle, valve=valve))
    return rig


def overshooting(rig: Rig) -> Recording:
    """Regulators (1 + LEAD SLOW s)/((1 + SLOW s)(1 + lag s)) from command to outlet."""
    time = np.arange(round(DURATION / STEP)) * STEP
    phase = 2.0 * np.pi * (0.4 * time + 0.5 * (8.0 - 0.4) / DURATION * time**2)
    half = 3.5e4 * np.sin(phase) + 3e4 * np.sin(2.0 * np.pi * 0.35 * time)
    wanted = MEAN + np.stack([half, -half], axis=1) * np.clip(time, 0.0, 1.0)[:, None]
    shaped, lag = np.zeros_like(wanted), wanted[0].copy()
    for k in range(time.size):
        lag = lag + (1.0 - np.exp(-STEP / SLOW)) * (wanted[k] - lag)
        shaped[k] = lag + LEAD * (wanted[k] - lag)
    parameters = PlantParameters.from_rig(rig)
    start = [MEAN, MEAN]
    plant = Plant(parameters, 1e-3, initial_state(parameters, pressures=start, commands=start))
    random, shown = np.random.default_rng(5), (0.0, MEAN, MEAN)
    rows = np.zeros((time.size, 3))
    for k in range(time.size):
        rows[k] = (*shown[1:], shown[0]) + random.standard_normal(3) * (150.0, 150.0, 1.5e-4)
        shown = plant.step(shaped[k].tolist(), STEP)
    muscles, joint = rig.joints[0].muscles, rig.joints[0].name
    values = {f"pressure_states.{name}": rows[:, i] for i, name in enumerate(muscles)}
    values |= {f"valve_commands.{name}": wanted[:, i] for i, name in enumerate(muscles)}
    values[f"joint_states.{joint}.position"] = rows[:, 2]
    valid = {name: np.ones(time.size, dtype=np.bool_) for name in values}
    return Recording(Path("regulators"), STEP, time, values, valid, ())


@pytest.mark.long("a whole search that ends in `unknown`; test_verdict holds when it does")
@needs_numba
def test_pressures_that_exceed_their_commands_have_no_known_cause(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pam_gap.diagnosis_engine.propose", lambda *_: None)  # takes long
    engine = JointDiagnosis(regulated(rig), 0, [overshooting(regulated(rig))])
    answer = engine.run()
    assert answer.verdict == "unknown"
    assert answer.effects == ()
    assert answer.location is not None
    valve = next(s for s in answer.location.stages if s.stage == "valve")
    assert valve.gap_over_floor is not None and valve.gap_over_floor > 10.0
    assert next(iter(answer.probabilities)) == "unknown"
    assert answer.improved is None


def test_a_good_regulator_has_a_zero_a_gain_and_a_hysteresis_of_a_share_of_the_supply(
    rig: Rig,
) -> None:
    """Its commands are pressures, of which the hysteresis of a spool would be no part at all."""
    own = regulated(rig)
    problem = PredictionProblem(own, 0, [overshooting(own)])
    parts = {part.name: part for part in sensor_parts(problem)}
    size = DEFAULT.decision.ordinary_regulator * (own.supply_pressure - own.gas.ambient_pressure)
    data = problem.data[0]
    shifted = parts["the zero of the agonist's regulator"].change(problem, data, 1.0)
    assert np.ptp(shifted.commands - data.commands, axis=0) == pytest.approx([0.0, 0.0], abs=1e-6)
    assert (shifted.commands - data.commands)[0] == pytest.approx([size, 0.0])
    scaled = parts["the gain of the antagonist's regulator"].change(problem, data, -1.0)
    assert scaled.commands[:, 1] == pytest.approx(0.99 * data.commands[:, 1])
    played = parts["a hysteresis of the regulators"].change(problem, data, 1.0)
    assert np.abs(played.commands - data.commands).max() == pytest.approx(0.5 * size)
