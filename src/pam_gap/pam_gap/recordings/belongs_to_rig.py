"""Checks by the names of joints and muscles that recordings belong to the rig.

The check comes before any prediction. Otherwise a recording of another rig would be diagnosed for
minutes with a meaningless result.
"""

from __future__ import annotations

from collections.abc import Sequence

from pam_gap.recordings.recording import (
    COMMANDS,
    JOINTS,
    MUSCLES,
    PRESSURES,
    Recording,
    RecordingError,
)
from pam_model.rig import Rig
from pam_ros.foreign_text import MOST

NO_JOINT = "the rig file has no joint, and no bench_muscles; expected one of them to diagnose"


def joints_recorded(rig: Rig, recordings: Sequence[Recording]) -> list[int]:
    """Numbers of the joints whose pressures are in all recordings.

    Raises
    ------
    RecordingError
        When there is none; the message names the recorded muscles and those of the rig file.
    """
    found = [
        number
        for number, joint in enumerate(rig.joints)
        if all(r.has(f"{PRESSURES}{m}") for r in recordings for m in joint.muscles)
    ]
    if not rig.joints:
        raise RecordingError(NO_JOINT)
    if not found:
        pairs = " or ".join(" and ".join(joint.muscles) for joint in rig.joints)
        held = "; ".join(f"{r.source}: {_listed(_named(r, PRESSURES))}" for r in recordings)
        raise RecordingError(
            f"{PRESSURES}<muscle>: expected {pairs}, as in the rig file; recorded are {held}"
        )
    return found


def refuse_no_bench(needed: Sequence[str], recordings: Sequence[Recording]) -> None:
    """Refuse recordings that hold no muscle on a bench, with what is missing.

    Parameters
    ----------
    needed : sequence of str
        Channels that are needed for its first bench muscle; empty if it has none.
    recordings : sequence of Recording
        The recordings.

    Raises
    ------
    RecordingError
        Always.
    """
    if not needed:
        raise RecordingError(NO_JOINT)
    for recording in recordings:
        missing = [name for name in needed if not recording.has(name)]
        if missing:
            raise RecordingError(
                f"{recording.source}: {', '.join(missing)} is not recorded; expected "
                f"{', '.join(needed)} for a muscle on a bench; recorded are "
                f"{_listed(sorted(recording.values))}"
            )
    raise RecordingError(NO_JOINT)


def refuse_other_rig(rig: Rig, joint: int, recordings: Sequence[Recording]) -> None:
    """Refuse recordings that name other joints and muscles than the rig file.

    A channel that is missing altogether is no reason to refuse: the answer states what cannot be
    judged without it.

    Raises
    ------
    RecordingError
        The message names the recording, the channel and the difference.
    """
    entry = rig.joints[joint]
    for recording in recordings:
        for prefix, needed, known in (
            (JOINTS, (entry.name,), rig.joint_names),
            (COMMANDS, entry.muscles, rig.muscle_names),
            (MUSCLES, entry.muscles, rig.muscle_names),
        ):
            recorded = _named(recording, prefix)
            missing = [name for name in needed if name not in recorded]
            strangers = [name for name in recorded if name not in known]
            if missing and strangers:
                raise RecordingError(
                    f"{recording.source}: {prefix}{_listed(missing)} is not recorded, but "
                    f"{prefix}{_listed(strangers)} is, which the rig file does not know; "
                    f"expected the rig file of the recorded robot"
                )


def _named(recording: Recording, prefix: str) -> list[str]:
    """Names of the joints or muscles with a recorded channel, in alphabetical order."""
    return sorted({c.removeprefix(prefix).split(".")[0] for c in recording.values
                   if c.startswith(prefix)})  # fmt: skip


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST} more" if len(names) > MOST else ""
    return (", ".join(names[:MOST]) or "none") + more
