"""Sensors that repeat one value for seconds are told, and their samples take no part."""

from dataclasses import replace

import numpy as np
import pytest

from pam_gap.diagnose_recordings import usable_parts
from pam_gap.prediction.identifiable import cautions
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.frozen import without_frozen
from pam_gap.recordings.recording import Recording
from pam_model.rig import Rig

from .conftest import Maker

MUSCLES = ("elbow_flexor", "elbow_extensor")
FLEXOR, EXTENSOR = (f"pressure_states.{muscle}" for muscle in MUSCLES)
POSITION = "joint_states.elbow.position"
FROM, TO = 1500, 2250  # samples: 6 to 9 s


def rounded(recording: Recording, name: str, step: float) -> Recording:
    values = np.round(recording.values[name] / step) * step
    return replace(recording, values={**recording.values, name: values})


def frozen(recording: Recording, name: str, start: int = FROM, stop: int = TO) -> Recording:
    values = recording.values[name].copy()
    values[start:stop] = values[start]
    return replace(recording, values={**recording.values, name: values})


def test_a_frozen_encoder_is_told_with_its_times_and_not_compared(rig: Rig, record: Maker) -> None:
    (part,) = usable_parts(rig, 0, [frozen(record(), POSITION)])
    assert not part.valid[POSITION][FROM:TO].any()
    assert part.valid[POSITION][:FROM].all()
    assert part.valid[POSITION][TO:].all()
    (told,) = cautions(PredictionProblem(rig, 0, [part]))[:1]
    assert f"{POSITION} repeats one value from 6 to 9 s" in told


def test_a_coarse_encoder_is_frozen_where_it_jumps_afterwards(record: Maker) -> None:
    """Its noise does not show, so that it repeats its values at rest too."""
    coarse = rounded(record(), POSITION, 2e-3)
    assert without_frozen(coarse, MUSCLES) is coarse
    found = without_frozen(frozen(coarse, POSITION), MUSCLES)
    assert not found.valid[POSITION][FROM:TO].any()


def test_a_coarse_encoder_that_fails_for_good_is_told_from_a_joint_at_rest(record: Maker) -> None:
    coarse = rounded(record(), POSITION, 2e-3)
    middle = int(np.argmin(np.abs(coarse.values[POSITION][1200:1400]))) + 1200
    end = coarse.time.size
    found = without_frozen(frozen(coarse, POSITION, middle, end), MUSCLES)
    assert not found.valid[POSITION][middle + 2 :].any()
    resting = frozen(coarse, POSITION, middle, end)
    values = dict(resting.values)
    for name in (FLEXOR, EXTENSOR):  # the muscles are shut, so that nothing moves the joint
        values[name] = values[name].copy()
        noise = values[name][: end - middle] - np.mean(values[name][: end - middle])
        values[name][middle:] = values[name][middle] + 1e-3 * noise
    resting = replace(resting, values=values)
    assert without_frozen(resting, MUSCLES).valid[POSITION].all()


def test_a_recording_is_cut_where_a_pressure_sensor_is_frozen(rig: Rig, record: Maker) -> None:
    """A muscle whose pressure is not known drifts away, and moves the joint with it."""
    first, second = usable_parts(rig, 0, [frozen(record(), FLEXOR)])
    assert first.duration == pytest.approx(6.0, abs=0.02)
    assert second.duration == pytest.approx(3.5, abs=0.1)
    assert f"{FLEXOR} repeats one value from 6 to 9 s" in first.frozen[0]


@pytest.mark.parametrize("every", [1, 25])
def test_channels_that_are_logged_slowly_or_rest_are_not_frozen(record: Maker, every: int) -> None:
    """A position of 10 Hz in the rows of a faster log repeats every value for 0.1 s."""
    recording = record()
    values = {
        name: np.repeat(series[::every], every)[: series.size]
        for name, series in recording.values.items()
    }
    slow = replace(recording, values=values)
    assert without_frozen(slow, MUSCLES) is slow


def test_a_clipped_pressure_comes_with_a_caution(rig: Rig, record: Maker) -> None:
    recording = record()
    limit = float(np.quantile(recording.values[FLEXOR], 0.8))
    values = {**recording.values, FLEXOR: np.minimum(recording.values[FLEXOR], limit)}
    problem = PredictionProblem(rig, 0, usable_parts(rig, 0, [replace(recording, values=values)]))
    assert any(f"{FLEXOR} stands at the end of its sensor's range" in c for c in cautions(problem))
