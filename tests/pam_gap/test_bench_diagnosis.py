"""One muscle on a bench, of which pressure, length and force are recorded, is diagnosed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pam_gap.__main__ import main
from pam_gap.answer.diagnosis import Diagnosis
from pam_gap.diagnose_recordings import diagnose
from pam_gap.inference.candidates import SIDES, candidates_for, nuisances_for, ordinary_sizes
from pam_gap.prediction.bench_joint import INVENTED, bench_problem, on_an_invented_joint
from pam_gap.prediction.identifiable import what_is_missing
from pam_gap.recordings.recording import Recording, RecordingError
from pam_model.rig import Rig, load_rig, save_rig
from pam_model.robot import compose

from .conftest import Maker

MUSCLE = "elbow_flexor"
OTHER = "elbow_extensor"


@pytest.fixture(scope="module")
def bench(rig: Rig) -> Rig:
    return replace(rig, joints=(), muscles=(rig.muscle(MUSCLE),))


def as_bench(rig: Rig, made: Recording) -> Recording:
    """The muscle of a joint that moves, as a bench with a moving end records it."""
    joint = rig.joints[0]
    position = made.values[f"joint_states.{joint.name}.position"]
    length = rig.muscle(MUSCLE).neutral_length - joint.pulley_radius * position
    values = {name: made.values[name] for name in made.values if name.split(".")[1] == MUSCLE}
    values[f"muscle_states.{MUSCLE}.position"] = length
    valid = {name: np.ones(length.size, dtype=np.bool_) for name in values}
    return replace(made, values=values, valid=valid)


def held(
    rig: Rig, effects: Mapping[str, Mapping[str, float]], shares: tuple[float, ...]
) -> Recording:
    """Lengths that are held one after another, while the pressure rises and falls slowly."""
    muscle = rig.muscle(MUSCLE)
    true = rig.with_muscle(replace(muscle, effects=effects))
    model = compose(true).muscles[0].force_model
    random = np.random.default_rng(3)
    step, hold = 0.01, 1000
    lengths = np.repeat(shares, hold) * muscle.rest_length
    time = np.arange(lengths.size) * step
    pressure = 2.6e5 * (1.0 - np.cos(2.0 * np.pi * time / (hold * step)))
    force = [max(model.force(p, x), 0.0) for p, x in zip(pressure, lengths, strict=True)]
    values = {
        f"pressure_states.{MUSCLE}": pressure + 150.0 * random.standard_normal(time.size),
        f"muscle_states.{MUSCLE}.position": lengths + 5e-6 * random.standard_normal(time.size),
        f"muscle_states.{MUSCLE}.effort": force + random.standard_normal(time.size),
    }
    valid = {name: np.ones(time.size, dtype=np.bool_) for name in values}
    return Recording(Path("held"), step, time, values, valid, ())


def in_words(answer: Diagnosis) -> str:
    return " ".join([json.dumps(answer.to_json()), *answer.repairs, *answer.left_out])


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, ()),
        (
            {f"{side}.hysteresis.amplitude": 0.06 for side in SIDES},
            ("hysteresis",),
        ),
        ({"agonist.leakage.conductance": 1e-10}, ("leakage",)),
    ],
    ids=["nothing", "hysteresis", "leakage"],
)
def test_the_hidden_effect_of_a_moving_muscle_is_named(
    rig: Rig, bench: Rig, record: Maker, changes: dict[str, float], expected: tuple[str, ...]
) -> None:
    log = as_bench(rig, record(changes, duration=14.0, cells=True))
    (answer,) = diagnose(log, bench, threads=1)
    assert answer.joint == MUSCLE
    assert (answer.verdict, answer.effects) == ("named" if expected else "none", expected)
    assert INVENTED not in in_words(answer)
    assert "antagonist" not in in_words(answer) and "agonist" not in in_words(answer)
    if expected:
        assert answer.improved is not None
        assert answer.improved.muscle_names == (MUSCLE,)
        assert expected[0] in answer.improved.muscle(MUSCLE).effects


@pytest.mark.parametrize(
    "effects",
    [{"end_caps": {"factor": 2.2}}, {"threshold_pressure": {"pressure": 1.1e5}}],
    ids=lambda effects: next(iter(effects)),
)
def test_held_lengths_without_commands_are_enough(
    bench: Rig, effects: dict[str, dict[str, float]]
) -> None:
    ((name, values),) = effects.items()
    ((key, value),) = values.items()
    (answer,) = diagnose(held(bench, effects, (1.0, 0.94, 0.88)), bench, threads=1)
    assert name in answer.effects
    assert answer.parameters[name][key].interval.value == pytest.approx(value, rel=0.1)
    assert any("valve stage cannot be judged" in note for note in answer.left_out)


def test_only_the_measured_muscle_has_candidates_and_numbers(bench: Rig) -> None:
    loose = replace(bench, parameter_tolerance=0.02)
    rig = on_an_invented_joint(loose, MUSCLE)
    joint, sides = rig.joints[0], SIDES[:1]
    targets = [
        path
        for candidate in candidates_for(rig, joint, sides)
        for group in candidate.targets
        for path in group
    ]
    targets += [path for one in nuisances_for(rig, joint, sides=sides) for path in one.targets]
    targets += [path for _, paths, _ in ordinary_sizes(rig, joint, sides) for path in paths]
    assert not [path for path in targets if path.startswith(("antagonist", "joint."))]
    assert any(path.startswith("agonist.") for path in targets)


def test_a_reversed_force_is_told_before_any_search(rig: Rig, bench: Rig, record: Maker) -> None:
    log = as_bench(rig, record(duration=10.0, cells=True))
    force = f"muscle_states.{MUSCLE}.effort"
    turned = replace(log, values={**log.values, force: -log.values[force]})
    (text,) = what_is_missing(bench_problem(on_an_invented_joint(bench, MUSCLE), [turned]))
    assert MUSCLE in text and "the force" in text


def test_a_log_without_length_is_refused_with_what_is_needed(
    rig: Rig, bench: Rig, record: Maker
) -> None:
    log = as_bench(rig, record(duration=4.0, cells=True))
    length = f"muscle_states.{MUSCLE}.position"
    values = {name: value for name, value in log.values.items() if name != length}
    with pytest.raises(RecordingError, match=rf"{length} is not recorded; expected .*{MUSCLE}"):
        diagnose(replace(log, values=values), bench)


def test_from_a_table_to_an_improved_rig_file(
    rig: Rig, bench: Rig, record: Maker, tmp_path: Path
) -> None:
    log = as_bench(rig, record({"agonist.end_caps.factor": 1.12}, duration=14.0, cells=True))
    file, table, out = tmp_path / "rig.yaml", tmp_path / "log.csv", tmp_path / "out"
    save_rig(bench, file)
    pd.DataFrame({"time": log.time, **log.values}).to_csv(table, index=False)
    assert main(["diagnose", str(table), "--rig", str(file), "--out", str(out)]) == 0
    improved = load_rig(out / "rig_improved.yaml")
    assert improved.joints == ()
    assert improved.muscle(MUSCLE).effects["end_caps"]["factor"] == pytest.approx(1.12, abs=0.02)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert f"Diagnosis of {MUSCLE}" in page and INVENTED not in page
