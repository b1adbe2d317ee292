"""Cuts a recording where nothing is known about the muscles for a while.

A prediction knows the state of the rig from the commands and the pressures. After a gap in them it
would start from a wrong state, and what that leaves would count as an error of the model. Each part
is therefore predicted as a recording of its own.
"""

from __future__ import annotations

from dataclasses import replace

from pam_gap.recordings.blind_time import is_blind
from pam_gap.recordings.recording import Recording, runs
from pam_gap.rules import DEFAULT
from pam_gap.rules.recording_rules import RecordingRules


def part_of(recording: Recording, start: int, stop: int) -> Recording:
    """The samples of a recording from `start` to before `stop`, as one of its parts."""
    rows, last = slice(start, stop), max(recording.time.size - 1, 1)
    return replace(
        recording,
        time=recording.time[rows] - recording.time[start],
        values={name: value[rows] for name, value in recording.values.items()},
        valid={name: value[rows] for name, value in recording.valid.items()},
        repairs=(),
        elapsed=(start / last, (stop - 1) / last),
    )


def parts(
    recording: Recording, muscles: tuple[str, ...], rules: RecordingRules = DEFAULT.recording
) -> list[Recording]:
    """The parts of a recording between gaps, the longest first; the recording itself without gaps.

    Parameters
    ----------
    recording : Recording
        A recording of the rig.
    muscles : tuple of str
        Muscles of the joint.
    rules : RecordingRules
        How long a gap is bridged, and the shortest part that is used.
    """
    step = recording.sample_time
    gaps = [
        (start, stop)
        for start, stop in runs(is_blind(recording, muscles))
        if (stop - start) * step > rules.longest_gap
    ]
    if not gaps:
        return [recording]
    borders = [0, *(place for gap in gaps for place in gap), recording.time.size]
    pieces = [
        (start, stop)
        for start, stop in zip(borders[::2], borders[1::2], strict=True)
        if (stop - start) * step >= rules.shortest_part
    ]
    if not pieces:
        return [recording]
    pieces.sort(key=lambda piece: piece[0] - piece[1])
    first, *others = (part_of(recording, start, stop) for start, stop in pieces)
    lost = sum(stop - start for start, stop in gaps) * step
    used = sum(stop - start for start, stop in pieces) * step
    note = (
        f"all channels: commands or pressures are missing for {lost:.3g} s in total; the recording "
        f"is cut there, and {len(pieces)} parts of it ({used:.3g} s) are used"
    )
    return [replace(first, repairs=(*recording.repairs, note)), *others]
