"""Recordings that hold too little get no name, but the reason and what is missing."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import pam_gap
from pam_gap.__main__ import main
from pam_gap.answer.diagnosis import Diagnosis
from pam_gap.inference.candidates import candidates_for
from pam_gap.inference.excitation import excitation
from pam_gap.prediction.gap_figures import noise_level
from pam_gap.prediction.identifiable import (
    cautions,
    counted_seconds,
    small_motion,
    what_is_missing,
)
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import Recording
from pam_gap.recordings.saturation import without_saturated
from pam_model.rig import Rig, save_rig

from .conftest import Maker

FLEXOR = "pressure_states.elbow_flexor"


def cut(recording: Recording, seconds: float) -> Recording:
    rows = round(seconds / recording.sample_time)
    return replace(
        recording,
        time=recording.time[:rows],
        values={name: values[:rows] for name, values in recording.values.items()},
        valid={name: valid[:rows] for name, valid in recording.valid.items()},
    )


@pytest.fixture(scope="module")
def rubbing(record: Maker) -> Recording:
    """An effect that is easily named in twelve seconds."""
    return record({"coulomb_friction.torque": 0.6})


@pytest.mark.parametrize("seconds", [1.3, 3.0, 6.0])
def test_a_few_seconds_are_never_named_and_never_none(
    rig: Rig, rubbing: Recording, seconds: float
) -> None:
    """3 s were `named` without a warning; 1.3 s, of which nothing counts, were `none`."""
    (answer,) = pam_gap.diagnose(cut(rubbing, seconds), rig)
    assert answer.verdict == "not_identifiable"
    assert answer.effects == ()
    assert "Too short" in answer.sentence
    assert "at least 6 s" in answer.missing[0]
    assert "record" in answer.next_experiment.lower()


def test_many_episodes_of_which_nothing_counts_are_still_too_short(
    rig: Rig, rubbing: Recording
) -> None:
    (answer,) = pam_gap.diagnose([cut(rubbing, 1.3)] * 8, rig)
    assert answer.verdict == "not_identifiable"
    assert "0 s of data count" in answer.sentence
    assert "The first 1.5 s of every recording never count" in answer.sentence


def test_an_answer_from_little_data_says_so(rig: Rig, rubbing: Recording) -> None:
    (caution,) = cautions(PredictionProblem(rig, 0, [rubbing]))
    assert "Only 11 s of data count" in caution
    doubled = PredictionProblem(rig, 0, [rubbing, rubbing])
    assert cautions(doubled) == ()


def test_an_answer_without_a_cause_from_a_small_motion_says_so(
    rig: Rig, rubbing: Recording
) -> None:
    """A load of 0.5 kg was hidden in a motion of +-0.3 rad, and the answer was `none`."""
    lower, upper = rig.joints[0].position_limits
    position = rubbing.values["joint_states.elbow.position"]
    for share in (0.3, 0.7):
        swing = share * (upper - lower) / np.ptp(position)
        values = {**rubbing.values, "joint_states.elbow.position": swing * position}
        found = small_motion(PredictionProblem(rig, 0, [replace(rubbing, values=values)]))
        assert found == () if share > 0.5 else "30 % of its range" in found[0]


def test_a_recording_in_which_nothing_changes_is_too_still(rig: Rig, rubbing: Recording) -> None:
    noise = np.random.default_rng(4).standard_normal((rubbing.time.size, 5))
    size = (1e-3, 1e-3, 150.0, 150.0, 1.5e-4)
    values = {
        name: given[0] + noise[:, i] * size[i]
        for i, (name, given) in enumerate(rubbing.values.items())
    }
    (answer,) = pam_gap.diagnose(replace(rubbing, values=values), rig)
    assert answer.verdict == "not_identifiable"
    assert "Too still" in answer.sentence


def test_a_slow_log_is_refused_with_its_rate(rig: Rig, rubbing: Recording) -> None:
    slow = replace(rubbing, sample_time=0.05, time=np.arange(rubbing.time.size) * 0.05)
    (text,) = what_is_missing(PredictionProblem(rig, 0, [slow]))
    assert "20 samples per second" in text
    assert "25 Hz" in text


@pytest.mark.parametrize(("limit", "verdict"), [(1.6e5, "not_identifiable"), (2.6e5, "")])
def test_clipped_samples_are_not_fitted_and_too_many_are_said(
    rig: Rig, rubbing: Recording, limit: float, verdict: str
) -> None:
    given = {n: np.minimum(v, limit) if n == FLEXOR else v for n, v in rubbing.values.items()}
    found = without_saturated(replace(rubbing, values=given))
    at_limit = given[FLEXOR] == limit
    assert found.saturated[FLEXOR] == pytest.approx(at_limit.mean(), abs=0.05)
    assert not found.valid[FLEXOR][at_limit].all()
    assert "the end of the sensor's range" in found.repairs[-1]
    missing = what_is_missing(PredictionProblem(rig, 0, [found]))
    assert bool(missing) == bool(verdict)
    assert all("Saturated" in text for text in missing)


def test_a_resting_or_empty_channel_is_not_taken_for_clipped(rubbing: Recording) -> None:
    step = 0.01
    values = dict(rubbing.values)
    values[FLEXOR] = np.maximum(values[FLEXOR] - 1.5e5, 0.0)  # empty for a while
    name = "joint_states.elbow.position"
    values[name] = np.round(np.clip(values[name], -0.05, 0.05) / step) * step  # a coarse encoder
    recording = replace(rubbing, values=values)
    assert without_saturated(recording) is recording


def test_a_peak_that_is_reached_once_is_not_taken_for_clipped(rubbing: Recording) -> None:
    values = dict(rubbing.values)
    top = int(np.argmax(values[FLEXOR]))
    values[FLEXOR] = values[FLEXOR].copy()
    values[FLEXOR][max(top - 9, 0) : top + 9] = values[FLEXOR][top]  # 0.07 s
    recording = replace(rubbing, values=values)
    assert without_saturated(recording) is recording


def test_seconds_are_counted_by_channel_without_gaps(rig: Rig, rubbing: Recording) -> None:
    valid = dict(rubbing.valid)
    valid[FLEXOR] = valid[FLEXOR].copy()
    valid[FLEXOR][: rubbing.time.size // 2] = False
    seconds = counted_seconds(PredictionProblem(rig, 0, [replace(rubbing, valid=valid)]))
    assert seconds[1] == pytest.approx(11.0, abs=0.1)
    assert seconds[0] == pytest.approx(6.25, abs=0.1)
    assert seconds[3] == 0.0


def test_effects_that_a_motion_does_not_excite_are_known(rig: Rig, record: Maker) -> None:
    moving, held = record(), record({"joint.inertia": 1e9, "joint.viscous_friction": 1e11})
    candidates = candidates_for(rig, rig.joints[0])
    shown = []
    for recording in (moving, held):
        problem = PredictionProblem(rig, 0, [replace(recording, mounting="locked")])
        if recording is moving:
            problem = PredictionProblem(rig, 0, [recording])
        floor = noise_level(problem, problem.base.values)
        shown.append(excitation(problem, candidates, floor))
    for effect in ("coulomb_friction", "payload", "viscous_friction"):
        assert shown[0][effect] > 3.0
        assert shown[1][effect] < 1.0
    assert shown[1]["leakage"] > 1.0


def test_what_is_missing_is_written_to_the_files(
    rig: Rig, rubbing: Recording, tmp_path: Path
) -> None:
    short = cut(rubbing, 3.0)
    pd.DataFrame({"time": short.time, **short.values}).to_csv(tmp_path / "r.csv", index=False)
    save_rig(rig, tmp_path / "rig.yaml")
    out = tmp_path / "out"
    arguments = ["diagnose", str(tmp_path / "r.csv"), "--rig", str(tmp_path / "rig.yaml")]
    assert main([*arguments, "--out", str(out), "--check"]) == 1
    answer = json.loads((out / "diagnosis.json").read_text())
    assert answer["verdict"] == "not_identifiable"
    assert "Too short" in answer["missing"][0]
    assert "Too short" in (out / "report.html").read_text()
    assert not (out / "rig_improved.yaml").exists()


def test_without_anything_to_compare_the_missing_channels_are_named(
    rig: Rig, rubbing: Recording
) -> None:
    keep = {n: v for n, v in rubbing.values.items() if n.startswith("pressure")}
    answers: list[Diagnosis] = pam_gap.diagnose(replace(rubbing, values=keep), rig)
    assert answers[0].verdict == "not_identifiable"
    assert "valve commands" in answers[0].sentence


def test_a_log_that_skips_commands_is_told(rig: Rig, rubbing: Recording) -> None:
    """Every tenth row of a log with a quick loop: what was commanded between them is lost."""
    waving = 0.1 * np.sin(2.0 * np.pi * 2.0 * rubbing.time)
    commands = {name: waving for name in rubbing.values if name.startswith("valve_commands.")}
    quick = replace(rubbing, values=rubbing.values | commands)
    full = PredictionProblem(rig, 0, [quick])
    assert not any("row to row" in text for text in cautions(full))
    rows = slice(None, None, 10)
    sparse = replace(
        quick,
        time=quick.time[rows],
        sample_time=10.0 * quick.sample_time,
        values={name: values[rows] for name, values in quick.values.items()},
        valid={name: valid[rows] for name, valid in quick.valid.items()},
    )
    (told,) = [text for text in cautions(PredictionProblem(rig, 0, [sparse])) if "row to" in text]
    assert "Log every command" in told
    bag = PredictionProblem(rig, 0, [replace(sparse, one_clock=False)])
    assert not any("row to row" in text for text in cautions(bag))


def test_commands_that_are_logged_more_slowly_than_measurements_are_told(
    rig: Rig, rubbing: Recording
) -> None:
    names = [name for name in rubbing.values if name.startswith("valve_commands.")]
    rows = np.arange(rubbing.time.size)
    wave = 0.1 * np.sin(2.0 * np.pi * 0.7 * rubbing.time)

    def told(rows: np.ndarray) -> list[str]:
        changed = replace(rubbing, values=rubbing.values | dict.fromkeys(names, wave[rows]))
        found = cautions(PredictionProblem(rig, 0, [changed]))
        return [text for text in found if "more slowly" in text or "change every" in text]

    every = round(0.1 / rubbing.sample_time)
    (text,) = told(rows // every * every)
    assert "change every 0.1 s only" in text
    assert told(rows) == []
    assert told(rows // 4 * 4) == []  # a loop of a usual rate
    steps = np.sort(np.random.default_rng(2).choice(rows, 60, replace=False))
    assert told(steps[np.maximum(np.searchsorted(steps, rows, side="right") - 1, 0)]) == []
