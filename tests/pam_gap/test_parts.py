"""Gaps and pauses of a log: what is unknown for a while is no error of the model."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pam_gap.diagnose_recordings import usable_parts
from pam_gap.inference.background import ordinary_background
from pam_gap.prediction.channel_order import POSITION
from pam_gap.prediction.fit import mean_squares
from pam_gap.prediction.identifiable import (
    cautions,
    full_of_holes,
    some_holes,
    what_is_missing,
)
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.parts import parts
from pam_gap.recordings.recording import (
    RawChannel,
    RawRecording,
    Recording,
    RecordingError,
    from_columns,
)
from pam_gap.recordings.resample import LONGEST_PAUSE, resample
from pam_model.rig import Rig

from .conftest import Maker

MUSCLES = ("elbow_flexor", "elbow_extensor")


def raw(recording: Recording, time: np.ndarray) -> RawRecording:
    return from_columns(recording.source, time, dict(recording.values))


def without(recording: Recording, *spans: tuple[float, float]) -> Recording:
    """The recording as read from a table in which the rows of these spans are missing."""
    keep = np.ones(recording.time.size, dtype=np.bool_)
    for start, end in spans:
        keep &= (recording.time < start) | (recording.time > end)
    columns = {name: values[keep] for name, values in recording.values.items()}
    return resample(from_columns(recording.source, recording.time[keep], columns))


def test_a_recording_without_gaps_is_one_part(record: Maker) -> None:
    recording = record()
    assert parts(recording, MUSCLES) == [recording]
    short = without(recording, (6.0, 6.2))
    assert parts(short, MUSCLES) == [short]


def test_a_recording_is_cut_at_gaps_and_short_pieces_are_left_out(record: Maker) -> None:
    recording = without(record(), (4.0, 5.0), (6.5, 8.0))
    first, second = parts(recording, MUSCLES)
    assert first.duration == pytest.approx(4.5, abs=0.02)
    assert second.duration == pytest.approx(4.0, abs=0.02)
    assert first.time[0] == second.time[0] == 0.0
    assert "2 parts of it" in first.repairs[-1]
    assert second.repairs == ()
    name = "joint_states.elbow.position"
    assert second.values[name][0] == pytest.approx(record().values[name][0], abs=1e-9)


def test_a_gap_in_the_position_alone_needs_no_cut(record: Maker) -> None:
    recording = record()
    name = "joint_states.elbow.position"
    valid = {**recording.valid, name: (recording.time < 4.0) | (recording.time > 6.0)}
    gapped = replace(recording, valid=valid)
    assert parts(gapped, MUSCLES) == [gapped]


def test_what_happened_in_a_gap_is_no_error_of_the_model(rig: Rig, record: Maker) -> None:
    """After a gap, the state of the rig is unknown as at the start of a recording."""
    gapped = without(record(), (4.0, 6.0))

    def worst(recordings: list[Recording]) -> float:
        problem = PredictionProblem(rig, 0, recordings)
        errors = problem.errors(problem.base.values[None])[0]
        return float(mean_squares(errors, problem.counted)[problem.present].max())

    assert worst([gapped]) > 100.0
    assert worst(usable_parts(rig, 0, [gapped])) < 4.0


def test_a_long_pause_costs_no_time(record: Maker) -> None:
    recording = record()
    time = recording.time + 3600.0 * (recording.time > 6.0)
    read = resample(raw(recording, time))
    assert read.duration == pytest.approx(recording.duration + LONGEST_PAUSE, abs=0.05)
    assert "1 pauses of 3600 s in total, the first at 6 s" in " ".join(read.repairs)
    assert len(parts(read, MUSCLES)) == 2


def test_channels_with_clocks_of_their_own_keep_their_order(record: Maker) -> None:
    recording = record()
    channels = {
        name: RawChannel(recording.time + 3600.0 * (recording.time > 6.0) + 1e-3 * k, values)
        for k, (name, values) in enumerate(recording.values.items())
    }
    read = resample(RawRecording(Path("bag"), channels))
    for name, values in recording.values.items():
        late = read.values[name][read.time > 6.0 + LONGEST_PAUSE + 0.1]
        assert late.std() == pytest.approx(values[recording.time > 6.1].std(), rel=0.05)


def test_a_clock_that_is_set_back_is_refused_and_a_late_message_is_not(record: Maker) -> None:
    recording = record()
    back = recording.time - 0.3 * (recording.time > 6.0)
    with pytest.raises(RecordingError, match="give both parts as two recordings"):
        resample(raw(recording, back))
    late = recording.time.copy()
    late[500:505] -= 0.03
    assert "ran backwards" in " ".join(resample(raw(recording, late)).repairs)


def test_a_part_knows_where_it_lies_in_its_recording(rig: Rig, record: Maker) -> None:
    """A sensor drifts on through a gap; a part of its own would start the drift anew."""
    whole = without(record(), (4.0, 5.0))
    first, second = parts(whole, MUSCLES)
    assert first.elapsed == (pytest.approx(5.0 / 12.5, abs=0.01), pytest.approx(1.0))
    assert second.elapsed == (pytest.approx(0.0), pytest.approx(4.0 / 12.5, abs=0.01))
    problem = PredictionProblem(rig, 0, [first, second])
    background = ordinary_background(problem, problem.base.values)
    drift = background.terms.columns[:, POSITION, -1]
    border = int(problem.offsets[1])
    assert drift[border] == pytest.approx(drift[border - 1] - np.ptp(drift), rel=0.01)
    assert drift[border - 1] == drift.max()
    assert drift[border:].max() < drift[:border].min()


@pytest.mark.parametrize("length", [0.12, 0.6])
def test_a_recording_full_of_holes_is_about_the_recording(
    rig: Rig, record: Maker, length: float
) -> None:
    """It was `unknown` with 100 %, without a word of the holes in which 45 % of its time lay."""
    whole = record()
    spans = [(at, at + length) for at in np.arange(0.4, whole.duration, length / 0.45)]
    problem = PredictionProblem(rig, 0, usable_parts(rig, 0, [without(whole, *spans)]))
    said = what_is_missing(problem)[0]
    assert said.startswith("The recording shows too little to judge the robot: for 4")
    assert "record on a computer without other work" in said


def test_some_holes_are_a_caution_that_comes_first(rig: Rig, record: Maker) -> None:
    holes = without(record(), (4.0, 4.9), (8.0, 8.2))
    problem = PredictionProblem(rig, 0, usable_parts(rig, 0, [holes]))
    assert what_is_missing(problem) == ()
    assert cautions(problem)[0].startswith("The recording has holes: for 9 % of 12.5 s")
    sound = PredictionProblem(rig, 0, usable_parts(rig, 0, [record()]))
    assert not any("holes" in text for text in cautions(sound))


@pytest.mark.parametrize("rate", [25.0, 50.0])
def test_a_slow_pressure_is_no_hole(rig: Rig, record: Maker, rate: float) -> None:
    recording = record()
    every = round(1.0 / (rate * recording.sample_time))
    channels = {
        name: RawChannel(recording.time[::step], values[::step])
        for name, values in recording.values.items()
        for step in [every if "pressure" in name else 1]
    }
    slow = resample(RawRecording(recording.source, channels))
    problem = PredictionProblem(rig, 0, usable_parts(rig, 0, [slow]))
    assert full_of_holes(problem) == ()
    assert some_holes(problem) == ()
