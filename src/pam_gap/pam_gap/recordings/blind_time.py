"""The time of a recording in which nothing is known of what drives the muscles.

While commands or pressures are missing, a prediction goes on with what was last known. What that
leaves looks like an error of the model until the measurements have corrected it, which takes the
horizon of the predictions. A busy computer or network leaves many such holes, each too short to cut
the recording there. Then the recording can be judged, but not the robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pam_gap.recordings.recording import COMMANDS, GAP_PERIODS, PRESSURES, Mask, Recording, runs
from pam_gap.rules import Rules


def is_blind(recording: Recording, muscles: Sequence[str]) -> Mask:
    """Samples at which a command, or every pressure, is unknown; shape (N,)."""

    def known(prefix: str) -> list[Mask]:
        names = [f"{prefix}{muscle}" for muscle in muscles]
        return [recording.valid[name] for name in names if recording.has(name)]

    blind = np.zeros(recording.time.size, dtype=np.bool_)
    for valid in known(COMMANDS):
        blind |= ~valid
    pressures = known(PRESSURES)
    if pressures:
        blind |= ~np.any(pressures, axis=0)
    return blind


def _longest_bridged(recording: Recording, muscles: Sequence[str], longest_step: float) -> float:
    """Time without a sample that is no hole [s]: slow channels are known now and then only."""
    slowest = recording.sample_time
    for muscle in muscles:
        valid = recording.valid.get(f"{PRESSURES}{muscle}")
        if valid is not None and valid.sum() > 1:
            usual = float(np.median(np.diff(np.flatnonzero(valid))))
            slowest = max(slowest, usual * recording.sample_time)
    return max(longest_step, GAP_PERIODS * slowest)


@dataclass(frozen=True, slots=True)
class BlindTime:
    """How much of one or more recordings is lost in holes."""

    whole: float = 0.0  # time from the first to the last sample [s]
    missing: float = 0.0  # time in holes [s]
    # time in holes, or so soon after one that the prediction is not corrected yet [s]
    spoiled: float = 0.0

    @property
    def missing_share(self) -> float:
        """Share of the time in holes, 0 to 1."""
        return self.missing / max(self.whole, 1e-9)

    @property
    def spoiled_share(self) -> float:
        """Share of the time that tells nothing because of holes, 0 to 1."""
        return self.spoiled / max(self.whole, 1e-9)

    def words(self) -> str:
        """What is missing, as a part of a sentence."""
        return (
            f"for {100.0 * self.missing_share:.0f} % of {self.whole:.3g} s, valve commands or "
            "pressures are missing in gaps"
        )


def blind_time(recordings: Sequence[Recording], muscles: Sequence[str], rules: Rules) -> BlindTime:
    """How much of recordings, or of parts of them, is lost in holes.

    Parameters
    ----------
    recordings : sequence of Recording
        As a diagnosis uses them: cut at long gaps.
    muscles : sequence of str
        Muscles of the joint.
    rules : Rules
        The horizon of the predictions, and the longest time between two samples.
    """
    missing = spoiled = used = 0.0
    whole: dict[str, float] = {}
    for recording in recordings:
        step = recording.sample_time
        after = round(rules.prediction.horizon / step)
        limit = _longest_bridged(recording, muscles, rules.recording.longest_step)
        lost = np.zeros(recording.time.size, dtype=np.bool_)
        for start, stop in runs(is_blind(recording, muscles)):
            if (stop - start) * step > limit:
                missing += (stop - start) * step
                lost[start : stop + after] = True
        spoiled += float(lost.sum()) * step
        used += recording.duration
        share = max(recording.elapsed[1] - recording.elapsed[0], 1e-9)
        source = str(recording.source)
        whole[source] = max(whole.get(source, 0.0), recording.duration / share)
    total = max(sum(whole.values()), used)
    return BlindTime(total, missing + total - used, spoiled + total - used)
