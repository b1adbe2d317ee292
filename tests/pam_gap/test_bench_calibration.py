"""The numbers of one muscle on a bench, from logs of its pressure, length and force."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pam_gap.__main__ import main
from pam_gap.calibration.bench import calibrate_bench_muscle
from pam_gap.calibration.calibration import Calibration
from pam_gap.calibration.free_numbers import Said
from pam_gap.recordings.recording import Recording, RecordingError
from pam_model.rig import Rig, load_rig, save_rig
from pam_model.rig.partial import PartialRig

from .conftest import Maker

MUSCLE = "elbow_flexor"
SAID = Said(1.0 / 3.0, 0.05)


@pytest.fixture(scope="module")
def bench(rig: Rig) -> Rig:
    """A rig file of nothing but one muscle."""
    return replace(rig, joints=(), muscles=(rig.muscle(MUSCLE),))


@pytest.fixture(scope="module")
def log(rig: Rig, record: Maker) -> Recording:
    """The muscle of a joint that moves, as a bench with a moving end records it."""
    made = record(duration=14.0, cells=True)
    joint = rig.joints[0]
    position = made.values[f"joint_states.{joint.name}.position"]
    length = rig.muscle(MUSCLE).neutral_length - joint.pulley_radius * position
    values = {name: made.values[name] for name in made.values if name.split(".")[1] == MUSCLE}
    values[f"muscle_states.{MUSCLE}.position"] = length
    valid = {name: np.ones(length.size, dtype=np.bool_) for name in values}
    return replace(made, values=values, valid=valid)


def rough(rig: Rig) -> Rig:
    muscle = rig.muscle(MUSCLE)
    valve = replace(muscle.valve, sonic_conductance=0.8 * muscle.valve.sonic_conductance)
    changed = replace(
        muscle, turns=1.04 * muscle.turns, thread_length=0.98 * muscle.thread_length, valve=valve
    )
    return rig.with_muscle(changed)


@pytest.fixture(scope="module")
def found(bench: Rig, log: Recording) -> Calibration:
    partial = PartialRig(rough(bench))
    return calibrate_bench_muscle(partial, MUSCLE, [log], [log], said=SAID)


def test_thread_turns_and_conductance_are_found(bench: Rig, found: Calibration) -> None:
    assert found.rig is not None
    muscle, true = found.rig.muscle(MUSCLE), bench.muscle(MUSCLE)
    assert muscle.turns == pytest.approx(true.turns, rel=0.015)
    assert muscle.thread_length == pytest.approx(true.thread_length, rel=0.01)
    conductance = muscle.valve.sonic_conductance
    assert conductance == pytest.approx(true.valve.sonic_conductance, rel=0.04)
    assert found.rig.joints == ()


def test_the_prediction_gets_better(found: Calibration) -> None:
    assert {one.channel for one in found.withheld} == {
        f"pressure_states.{MUSCLE}",
        f"muscle_states.{MUSCLE}.effort",
    }
    assert all(one.after < 0.4 * one.before for one in found.withheld)


def test_without_commands_the_force_is_enough(bench: Rig, log: Recording) -> None:
    values = {name: v for name, v in log.values.items() if not name.startswith("valve")}
    partial = PartialRig(rough(bench))
    answer = calibrate_bench_muscle(partial, MUSCLE, [replace(log, values=values)], said=SAID)
    assert answer.rig is not None
    assert not any(".valve." in one.key for one in answer.numbers)
    muscle = answer.rig.muscle(MUSCLE)
    assert muscle.turns == pytest.approx(bench.muscle(MUSCLE).turns, rel=0.02)


def test_three_held_lengths_are_enough(bench: Rig) -> None:
    muscle = bench.muscle(MUSCLE)
    model = bench.force_model(MUSCLE)
    random = np.random.default_rng(1)
    step, hold = 0.005, 1200
    lengths = np.repeat([0.97, 1.0, 1.03], hold) * muscle.neutral_length
    time = np.arange(lengths.size) * step
    pressure = 2.5e5 + 1.5e5 * np.sin(2.0 * np.pi * 0.3 * time)
    force = np.array(
        [model.force(p, x) for p, x in zip(pressure.tolist(), lengths.tolist(), strict=True)]
    )
    values = {
        f"pressure_states.{MUSCLE}": pressure + 150.0 * random.standard_normal(time.size),
        f"muscle_states.{MUSCLE}.position": lengths + 5e-6 * random.standard_normal(time.size),
        f"muscle_states.{MUSCLE}.effort": force + random.standard_normal(time.size),
    }
    valid = {name: np.ones(time.size, dtype=np.bool_) for name in values}
    held = Recording(Path("held"), step, time, values, valid, ())
    partial = PartialRig(rough(bench))
    answer = calibrate_bench_muscle(partial, MUSCLE, [held], said=SAID)
    assert answer.rig is not None
    assert answer.rig.muscle(MUSCLE).turns == pytest.approx(muscle.turns, rel=0.02)


def test_a_reversed_force_is_named(bench: Rig, log: Recording) -> None:
    force = f"muscle_states.{MUSCLE}.effort"
    values = {**log.values, force: -log.values[force]}
    partial = PartialRig(rough(bench))
    answer = calibrate_bench_muscle(partial, MUSCLE, [replace(log, values=values)], said=SAID)
    assert answer.rig is None
    assert "the force" in answer.wiring[0] and MUSCLE in answer.wiring[0]


def test_a_muscle_that_a_machine_stretches_is_wired_rightly(bench: Rig, log: Recording) -> None:
    """Its force rises with the length while the pressure of the shut muscle falls."""
    random, length = np.random.default_rng(4), f"muscle_states.{MUSCLE}.position"
    stretch = log.values[length] - log.values[length].mean()
    noise = random.standard_normal((2, stretch.size))
    values = {
        **log.values,
        f"pressure_states.{MUSCLE}": 3e5 - 4e6 * stretch + 100.0 * noise[0],
        f"muscle_states.{MUSCLE}.effort": 150.0 + 8e3 * stretch + noise[1],
    }
    driven = replace(log, values=values, valid={n: log.valid[n] for n in log.valid if n in values})
    partial = PartialRig(rough(bench))
    assert calibrate_bench_muscle(partial, MUSCLE, [driven], said=SAID).wiring == ()


def test_a_length_in_millimetres_is_refused(bench: Rig, log: Recording) -> None:
    length = f"muscle_states.{MUSCLE}.position"
    values = {**log.values, length: 1e3 * log.values[length]}
    partial = PartialRig(bench)
    with pytest.raises(RecordingError, match=rf"{length} reaches .* expected the length"):
        calibrate_bench_muscle(partial, MUSCLE, [replace(log, values=values)], said=SAID)


def test_from_files_to_a_rig_file(bench: Rig, log: Recording, tmp_path: Path) -> None:
    rig, table, out = tmp_path / "rough.yaml", tmp_path / "log.csv", tmp_path / "out"
    save_rig(rough(bench), rig)
    pd.DataFrame({"time": log.time, **log.values}).to_csv(table, index=False)
    assert main(["calibrate", str(table), "--rig", str(rig), "--out", str(out)]) == 0
    calibrated = load_rig(out / "calibrated.yaml").muscle(MUSCLE)
    assert calibrated.turns == pytest.approx(bench.muscle(MUSCLE).turns, rel=0.02)
    assert MUSCLE in (out / "calibration.html").read_text(encoding="utf-8")


def test_a_log_without_force_is_refused_with_what_is_expected(
    bench: Rig, log: Recording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig, table = tmp_path / "rough.yaml", tmp_path / "log.csv"
    save_rig(bench, rig)
    values = {name: v for name, v in log.values.items() if not name.endswith("effort")}
    pd.DataFrame({"time": log.time, **values}).to_csv(table, index=False)
    out = tmp_path / "out"
    assert main(["calibrate", str(table), "--rig", str(rig), "--out", str(out)]) != 0
    assert f"muscle_states.{MUSCLE}.effort" in capsys.readouterr().err
