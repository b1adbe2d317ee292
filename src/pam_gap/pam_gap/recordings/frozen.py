"""Finds times in which a sensor repeated one value although what it measures went on changing.

A bus that loses its frames, a driver that hangs or a loose plug leaves the last value in the log
for seconds. A sensor with noise that shows never repeats a value for long. One without it does at
rest, but then its next value is near: a joint cannot jump. Where no next value follows, the
pressures tell: a change of theirs that moves the joint elsewhere would have moved it there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from pam_gap.recordings.noise_floor import channel_noise
from pam_gap.recordings.recording import COMMANDS, JOINTS, PRESSURES, Array, Mask, Recording
from pam_gap.rules import DEFAULT
from pam_gap.rules.recording_rules import RecordingRules


def runs_of_equal(values: Array) -> list[tuple[int, int]]:
    """First sample of each run of equal values, and the one after its last."""
    edges = np.flatnonzero(np.diff(values)) + 1
    borders = [0, *edges.tolist(), values.size]
    return list(pairwise(borders))


def _longest_change(recording: Recording, muscles: tuple[str, ...], rows: slice) -> float:
    """Span of the difference of the pressures, which moves the joint [Pa]; 0 if not recorded."""
    names = [f"{PRESSURES}{muscle}" for muscle in muscles]
    if len(names) != 2 or not all(recording.has(name) for name in names):
        return 0.0
    known = np.all([recording.valid[name][rows] for name in names], axis=0)
    difference = (recording.values[names[0]] - recording.values[names[1]])[rows][known]
    return float(np.ptp(difference)) if difference.size else 0.0


def _frozen_runs(
    recording: Recording, name: str, muscles: tuple[str, ...], rules: RecordingRules
) -> Iterator[tuple[int, int]]:
    """The runs of one channel in which its sensor was frozen."""
    values, valid = recording.values[name], recording.valid[name]
    runs = runs_of_equal(values)
    usual = float(np.median([stop - start for start, stop in runs]))
    shortest = max(rules.frozen_time / recording.sample_time, rules.frozen_runs * usual)
    long = [(start, stop) for start, stop in runs if stop - start >= shortest]
    alive = valid.copy()
    for start, stop in long:
        alive[start:stop] = False
    if not long or len(long) == len(runs) or alive.sum() < rules.stretch:
        return
    noise = channel_noise(values[alive], rules=rules)
    others = max(stop - start for start, stop in runs if stop - start < shortest)
    is_noisy = not noise.is_smoothed and noise.deviation > noise.resolution
    both = alive[1:] & alive[:-1]
    steps = np.abs(np.diff(values))[both]
    jump = rules.frozen_jump * max(
        float(np.quantile(steps, 0.999)) if steps.size else np.inf,
        noise.deviation,
        noise.resolution,
    )
    ends = (float(values[alive].min()), float(values[alive].max()))
    whole = _longest_change(recording, muscles, slice(None))
    for start, stop in long:
        # Missing samples are interpolated; only true ones tell of a sensor.
        if valid[start:stop].mean() < rules.valid_share:
            continue
        value = float(values[start])
        within = ends[0] < value < ends[1]
        before = abs(float(values[start - 1]) - value) if start > 0 else 0.0
        after = abs(float(values[stop]) - value) if stop < values.size else 0.0
        repeats = is_noisy and stop - start >= rules.frozen_runs * others
        if (repeats and within) or max(before, after) > jump:
            yield start, stop
        elif stop == values.size and within and name.startswith(JOINTS):
            moved = _longest_change(recording, muscles, slice(start, stop))
            if moved > rules.frozen_push * whole > 0.0:
                yield start, stop


def without_frozen(
    recording: Recording, muscles: tuple[str, ...], rules: RecordingRules = DEFAULT.recording
) -> Recording:
    """The recording without the samples of frozen sensors, and what was found for each channel.

    A prediction goes on without a position. Without one of the pressures it drifts away and takes
    the position with it, so that all pressures are unknown there and the recording is cut.
    """
    pressures = [f"{PRESSURES}{m}" for m in muscles if recording.has(f"{PRESSURES}{m}")]
    valid: dict[str, Mask] = {name: known.copy() for name, known in recording.valid.items()}
    told = []
    for name, values in recording.values.items():
        if name.startswith(COMMANDS) or name in recording.silent or values.size < rules.stretch:
            continue
        found = list(_frozen_runs(recording, name, muscles, rules))
        for start, stop in found:
            for channel in pressures if name in pressures else (name,):
                valid[channel][start:stop] = False
        if found:
            step = recording.sample_time
            times = ", ".join(f"{a * step:.4g} to {b * step:.4g} s" for a, b in found[:4])
            more = ", ..." if len(found) > 4 else ""
            told.append(
                f"{name} repeats one value from {times}{more} although what it measures went on "
                "changing, so that its sensor was frozen. This time is not compared. Check the "
                "sensor, its cable and its driver."
            )
    if not told:
        return recording
    return replace(recording, valid=valid, frozen=tuple(told))
