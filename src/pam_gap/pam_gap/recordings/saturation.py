"""Finds samples at which a sensor stood at the end of its range, and takes them out.

A clipped sensor repeats its largest or smallest value exactly, although it shows noise elsewhere.
Such samples say only that the true value lies beyond, so that a model must not be fitted to them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pam_gap.recordings.frozen import runs_of_equal
from pam_gap.recordings.noise_floor import channel_noise
from pam_gap.recordings.recording import COMMANDS, PRESSURES, Array, Mask, Recording, runs
from pam_gap.rules import DEFAULT
from pam_gap.rules.recording_rules import RecordingRules


def at_the_end(values: Array, end: float, shortest: int) -> Mask:
    """Samples in runs of at least `shortest` samples that equal `end` exactly."""
    clipped = np.zeros(values.size, dtype=np.bool_)
    for start, stop in runs(values == end):
        clipped[start:stop] = stop - start >= shortest
    return clipped


def _longest_between(values: Array, most: float) -> int:
    """Longest run of equal values between both ends of the range; frozen sensors do not count."""
    low, high = float(values.min()), float(values.max())
    lengths = [
        stop - start for start, stop in runs_of_equal(values) if low < float(values[start]) < high
    ]
    return max((length for length in lengths if length < most), default=0)


def without_saturated(recording: Recording, rules: RecordingRules = DEFAULT.recording) -> Recording:
    """The recording with clipped samples marked as missing, and a remark for each channel."""
    valid = dict(recording.valid)
    shares: dict[str, float] = {}
    notes = []
    for name, values in recording.values.items():
        if name.startswith(COMMANDS) or name in recording.silent or values.size < 2:
            continue
        noise = channel_noise(values, recording.valid[name], rules)
        # At rest, a channel without visible noise repeats its values too.
        if noise.deviation < rules.clipped_noise * noise.resolution or np.ptp(values) <= 0.0:
            continue
        if (
            _longest_between(values, rules.frozen_time / recording.sample_time)
            >= rules.clipped_samples
        ):
            continue  # a coarse encoder at rest
        for end, word in ((float(values.max()), "above"), (float(values.min()), "below")):
            if name.startswith(PRESSURES) and word == "below":
                continue  # an empty muscle; its pressure is known
            clipped = at_the_end(values, end, rules.clipped_samples)
            if clipped.mean() >= rules.clipped_share:
                valid[name] = valid[name] & ~clipped
                shares[name] = shares.get(name, 0.0) + float(clipped.mean())
                notes.append(
                    f"{name}: stands at {end:.6g} for {clipped.sum() * recording.sample_time:.3g} "
                    f"s, the end of the sensor's range; the true value lies {word}, so these "
                    "samples are not compared"
                )
    if not notes:
        return recording
    return replace(recording, valid=valid, saturated=shares, repairs=(*recording.repairs, *notes))
