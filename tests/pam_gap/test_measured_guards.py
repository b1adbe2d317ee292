"""What measured data must not give: an answer from a second, from kPa, or from a joint at rest.

The data are those of tests/data/closed_pair, two real muscles that are shut and pushed by a motor.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pam_gap
from pam_gap.diagnosis_engine import JointDiagnosis
from pam_gap.recordings.column_map import ColumnMap, MappedColumn
from pam_gap.recordings.import_recording import import_recording
from pam_gap.recordings.recording import LOCKED, SHUT, Recording, RecordingError
from pam_model.rig import Rig, load_rig

DATA = Path(__file__).parents[1] / "data" / "closed_pair"
RADIUS = 0.006875


def measured(pressure_factor: float = 1e3) -> Recording:
    """The recording, with its pressures multiplied by this factor; 1000 is right."""
    columns = {
        "pressure_states.muscle_1": MappedColumn("pressure_1_kPa", pressure_factor),
        "pressure_states.muscle_2": MappedColumn("pressure_2_kPa", pressure_factor),
        "joint_states.pair.position": MappedColumn("displacement_m", 1.0 / RADIUS),
        "joint_states.pair.effort": MappedColumn("motor_force_N", RADIUS),
    }
    column_map = ColumnMap(Path("map"), columns, MappedColumn("time_s"))
    return replace(
        import_recording(DATA / "recording.csv.gz", column_map=column_map), mounting=SHUT
    )


@pytest.fixture(scope="module")
def pair() -> Rig:
    return load_rig(DATA / "rig.yaml")


def episode(recording: Recording, start: float, seconds: float) -> Recording:
    rows = slice(*(round(t / recording.sample_time) for t in (start, start + seconds)))
    return replace(
        recording,
        time=recording.time[rows] - recording.time[rows][0],
        values={name: values[rows] for name, values in recording.values.items()},
        valid={name: valid[rows] for name, valid in recording.valid.items()},
    )


def test_measured_episodes_of_a_second_are_not_called_free_of_a_gap(pair: Rig) -> None:
    """They were `none`, although nothing of them was compared."""
    recording = measured()
    (answer,) = pam_gap.diagnose([episode(recording, t, 1.3) for t in (0, 2, 4, 6)], pair)
    assert answer.verdict == "not_identifiable"
    assert "0 s of data count" in answer.sentence


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "kPa"), (1e-2, "bar"), (0.1450377, "psi")])
def test_measured_pressures_in_other_units_are_refused(pair: Rig, factor: float, unit: str) -> None:
    with pytest.raises(RecordingError, match=rf"never exceeds .*looks like .*{unit} \(multiply"):
        pam_gap.diagnose(measured(factor), pair)


def test_measured_muscles_at_constant_length_have_no_friction_of_the_joint(pair: Rig) -> None:
    """With a position of one value, "Coulomb friction" closed 100 % of the gap."""
    recording = measured()
    position = "joint_states.pair.position"
    values = {n: v for n, v in recording.values.items() if not n.endswith("effort")}
    values[position] = np.full(recording.time.size, 0.02)
    held = replace(recording, values=values, mounting=LOCKED)
    (answer,) = pam_gap.diagnose(held, pair)
    assert answer.verdict == "not_identifiable"
    assert answer.effects == ()
    assert "No channel can be compared" in answer.sentence
    assert any("treated as locked" in text for text in answer.repairs)


def test_the_hysteresis_of_the_measured_pair_is_a_cause_and_no_background(pair: Rig) -> None:
    """It is as small as on a good rig, but explains many times what a background would leave."""
    engine = JointDiagnosis(pair, 0, [measured()])
    assert engine.effect_search().far_beyond() == {"hysteresis"}
    engine.fitter.drop_background()
    assert engine.fitter.fit_nominal() is engine.fitter.bare
    assert not engine.fitter.fit_nominal().result.amounts.size
