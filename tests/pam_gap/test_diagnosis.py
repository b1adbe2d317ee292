"""Prediction errors, names and files of a diagnosis on short simulated recordings.

The plant is the one the diagnosis fits, so that these show the machinery sound; what it is worth
on rigs with other physics is shown by `pam check blind`.
"""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import pam_gap
from pam_gap.__main__ import main
from pam_gap.diagnosis_engine import DiagnosisOptions, JointDiagnosis
from pam_gap.inference.candidates import candidates_for
from pam_gap.inference.decide import decide, decided_answer
from pam_gap.inference.held_out import score_held_out
from pam_gap.inference.hypothesis import FitTask
from pam_gap.prediction.fit import mean_squares
from pam_gap.prediction.gap_figures import noise_level
from pam_gap.prediction.locate import locate
from pam_gap.prediction.problem import PredictionProblem, PredictionSettings
from pam_gap.recordings.computed_channels import without_computed
from pam_gap.recordings.recording import Recording
from pam_gap.rules import DEFAULT
from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.rig import Rig, load_rig, save_rig

from .conftest import Maker

OTHERS = pytest.mark.long(
    "the same friction is named in memory below; no effect and two effects stay here"
)
needs_numba = pytest.mark.skipif(not HAVE_NUMBA, reason="a whole search needs the compiled plant")


def without(recording: Recording, prefix: str) -> Recording:
    keep = {k: v for k, v in recording.values.items() if not k.startswith(prefix)}
    return replace(recording, values=keep)


def test_a_true_plant_leaves_noise(rig: Rig, record: Maker) -> None:
    problem = PredictionProblem(rig, 0, [record(duration=8.0)])
    values = problem.base.values
    for horizon in (0.1, 0.3):
        errors = problem.errors(values[None], PredictionSettings(horizon))[0]
        floor = noise_level(problem, values, PredictionSettings(horizon))
        assert (mean_squares(errors, problem.counted) < 1.5 * floor)[:3].all()


@needs_numba
@pytest.mark.parametrize(
    ("changes", "stage", "quiet"),
    [
        ({"leakage.conductance": 8e-11}, "valve", "joint"),
        ({"coulomb_friction.torque": 0.6}, "joint", "valve"),
    ],
)
def test_the_gap_is_located(
    rig: Rig, record: Maker, changes: dict[str, float], stage: str, quiet: str
) -> None:
    problem = PredictionProblem(rig, 0, [record(changes)])
    values = problem.base.values
    location = locate(problem, values, problem.errors(values[None])[0])
    gaps = {s.stage: s.gap_over_floor for s in location.stages}
    assert location.worst == stage
    assert gaps[stage] > 5.0 * gaps[quiet]


@needs_numba
@pytest.mark.parametrize(
    ("changes", "effects"),
    [
        ({}, ()),
        pytest.param({"coulomb_friction.torque": 0.6}, ("coulomb_friction",), marks=OTHERS),
        pytest.param(
            {"agonist.valve_null_offset.offset": 0.03}, ("valve_null_offset",), marks=OTHERS
        ),
        pytest.param({"hysteresis.amplitude": 0.05}, ("hysteresis",), marks=OTHERS),
        (
            {"valve_dead_zone.overlap": 0.06, "viscous_friction.extra": 0.5},
            ("valve_dead_zone", "viscous_friction"),
        ),
    ],
)
def test_effects_are_named(
    rig: Rig, record: Maker, changes: dict[str, float], effects: tuple[str, ...]
) -> None:
    engine = JointDiagnosis(rig, 0, [record(changes)])
    diagnosis = engine.run()
    assert diagnosis.verdict == ("named" if effects else "none")
    assert engine.evidence is not None
    verdict = decide(engine.evidence, DEFAULT)
    assert verdict.is_exact
    again, whole = decided_answer(engine.evidence, verdict, DEFAULT), diagnosis.to_json()
    assert again == {key: whole[key] for key in again}
    assert set(diagnosis.effects) == set(effects)
    if effects:
        assert diagnosis.closed is not None
        assert diagnosis.closed.value > 0.95
        assert diagnosis.improved is not None
        improved = PredictionProblem(diagnosis.improved, 0, [record(changes)])
        left = mean_squares(improved.errors(improved.base.values[None])[0], improved.counted)
        assert (left[:3] < 2.0).all()


@needs_numba
def test_a_diagnosis_in_memory_writes_nothing(
    rig: Rig, record: Maker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    told: list[str] = []
    recording = record({"coulomb_friction.torque": 0.6})
    (answer,) = pam_gap.diagnose(recording, rig, progress=lambda task, share: told.append(task))
    assert (answer.verdict, answer.effects) == ("named", ("coulomb_friction",))
    assert "coulomb" in answer.sentence.lower()
    assert any("load cell" in note for note in answer.left_out)
    assert told
    assert list(tmp_path.iterdir()) == []


@needs_numba
@pytest.mark.long("three whole searches; test_background names a delay in addition to a background")
@pytest.mark.parametrize(
    ("delay", "is_stamped", "effects"),
    [(0.002, True, ()), (0.002, False, ("command_delay",)), (0.02, True, ("command_delay",))],
)
def test_how_long_a_message_takes_is_no_effect(
    rig: Rig, record: Maker, delay: float, is_stamped: bool, effects: tuple[str, ...]
) -> None:
    """Up to a sample; a table, whose channels share their stamps, leaves nothing open."""
    recording = replace(record({"command_delay.delay": delay}), one_clock=not is_stamped)
    diagnosis = JointDiagnosis(rig, 0, [recording]).run()
    assert diagnosis.effects == effects
    if not effects:
        assert diagnosis.verdict == "none"
    elif is_stamped:
        # what the log takes is not written into the rig as well
        assert diagnosis.improved is not None
        for muscle in diagnosis.improved.muscles:
            assert muscle.effects["command_delay"]["delay"] == pytest.approx(delay, abs=0.004)


def test_delays_written_apart_for_the_muscles_stay(rig: Rig, record: Maker) -> None:
    recording = replace(record(duration=8.0), one_clock=False)
    slow = replace(rig.muscles[0], effects={"command_delay": {"delay": 0.02}})
    for written, count in ((rig, 1), (rig.with_muscle(slow), 0)):
        nuisances = JointDiagnosis(written, 0, [recording]).fitter.nuisances
        assert sum(nuisance.is_transport for nuisance in nuisances) == count


@needs_numba
def test_what_is_reported_is_fitted_from_the_written_numbers(rig: Rig, record: Maker) -> None:
    """A fit that stands at the ends of the tolerance is freed; one at its best stays."""
    loose = replace(rig, parameter_tolerance=0.02)
    hidden = record({"payload.mass": 0.5, "payload.distance": 0.3})
    engine = JointDiagnosis(loose, 0, [hidden])
    candidates = candidates_for(loose, loose.joints[0])
    payload = next(c for c in candidates if c.effect == "payload")
    ends = [nuisance.free.high for nuisance in engine.fitter.nuisances]
    caught = engine.fitter.fit((payload,), np.array([*ends, 0.3, 0.3]), max_iterations=1)
    score = score_held_out(engine.fitter, engine.folds, caught)
    settled = engine.settled(score)
    assert engine.judge.level(settled) < engine.judge.level(score) - 1.0
    again = engine.settled(settled)
    assert engine.judge.level(again) <= engine.judge.level(settled)


@needs_numba
@pytest.mark.parametrize("mass", [0.5, 4.0])
def test_a_light_and_a_heavy_load_are_found_from_the_starts(
    rig: Rig, record: Maker, mass: float
) -> None:
    """A joint swings so much more slowly with a heavy load that a fit from a light one is lost."""
    hidden = record({"payload.mass": mass, "payload.distance": 0.25}, duration=9.0)
    engine = JointDiagnosis(rig, 0, [hidden])
    nominal = engine.fitter.fit_nominal()
    payload = next(c for c in engine.candidates if c.effect == "payload")
    fits = engine.fitter.fit_all(
        [
            FitTask((payload,), np.concatenate([nominal.result.values, start]), 10)
            for start in payload.starts
        ]
    )
    best = min(fits, key=lambda fit: fit.result.objective)
    assert best.result.values[-2:] == pytest.approx([mass, 0.25], rel=0.02)


@needs_numba
@pytest.mark.long("a whole search, as without a position, which stays")
def test_without_commands_the_valve_stage_is_left_out(rig: Rig, record: Maker) -> None:
    recording = without(record({"coulomb_friction.torque": 0.6}), "valve_commands")
    diagnosis = JointDiagnosis(rig, 0, [recording]).run()
    assert diagnosis.location is not None
    valve = next(s for s in diagnosis.location.stages if s.stage == "valve")
    assert valve.gap_over_floor is None
    assert "coulomb_friction" in diagnosis.effects


@needs_numba
def test_without_a_position_the_pressures_are_still_judged(rig: Rig, record: Maker) -> None:
    recording = without(record({"leakage.conductance": 8e-11}), "joint_states")
    diagnosis = JointDiagnosis(rig, 0, [recording]).run()
    assert "leakage" in diagnosis.effects


@needs_numba
def test_command_line_writes_what_the_contract_asks(
    rig: Rig, record: Maker, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = record({"leakage.conductance": 8e-11})
    table = tmp_path / "recording.csv.gz"
    pd.DataFrame({"time": recording.time, **recording.values}).to_csv(table, index=False)
    save_rig(rig, tmp_path / "rig.yaml")
    out = tmp_path / "out"
    arguments = ["diagnose", str(table), "--rig", str(tmp_path / "rig.yaml"), "--out", str(out)]
    assert main([*arguments, "--no-progress"]) == 0
    answer = json.loads((out / "diagnosis.json").read_text())
    assert answer["verdict"] == "named"
    assert answer["stage"] == "valve"
    assert answer["effects"] == ["leakage"]
    assert answer["candidates"][0][0] == "leakage"
    assert {"indistinguishable", "parameters", "gap", "closed", "next_experiment"} <= set(answer)
    found = answer["parameters"]["leakage"]["conductance.agonist"]
    assert found["low"] <= found["value"] <= found["high"]
    assert found["value"] == pytest.approx(8e-11, rel=0.1)
    improved = load_rig(out / "rig_improved.yaml")
    assert improved.muscles[0].effects["leakage"]["conductance"] == pytest.approx(8e-11, rel=0.1)
    assert (out / "report.html").stat().st_size > 10_000
    assert "leakage" in capsys.readouterr().out


def test_without_an_experiment_none_is_sought(
    rig: Rig, record: Maker, monkeypatch: pytest.MonkeyPatch
) -> None:
    sought: list[object] = []
    monkeypatch.setattr("pam_gap.diagnosis_engine.propose", lambda *given: sought.append(given))
    recording, unknown = record(duration=9.0), SimpleNamespace(verdict="unknown", tried=())
    for wanted in (True, False):
        engine = JointDiagnosis(rig, 0, [recording], DiagnosisOptions(with_experiment=wanted))
        assert engine.proposal(unknown, ()) is None
        assert len(sought) == 1


def test_mistakes_end_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code = main(["diagnose", str(tmp_path / "no.csv"), "--rig", "x.yaml", "--out", str(tmp_path)])
    assert code == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_computed_pulls_are_no_load_cells(rig: Rig, record: Maker) -> None:
    measured = record(duration=6.0, cells=True)
    assert without_computed(measured, rig).values.keys() == measured.values.keys()
    joint = rig.joints[0]
    position = measured.values[f"joint_states.{joint.name}.position"]
    values = dict(measured.values)
    for muscle, sign in zip(joint.muscles, (-1.0, 1.0), strict=True):
        length = rig.muscle(muscle).neutral_length + sign * joint.pulley_radius * position
        pressure = measured.values[f"pressure_states.{muscle}"]
        values[f"muscle_states.{muscle}.effort"] = rig.force_model(muscle).force(pressure, length)
    cleaned = without_computed(replace(measured, values=values), rig)
    assert not any(name.startswith("muscle_states") for name in cleaned.values)
    assert "computed" in cleaned.repairs[-1]
