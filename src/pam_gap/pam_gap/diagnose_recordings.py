"""From recordings in memory to a diagnosis, without files: what a script or a notebook calls."""

from __future__ import annotations

import os
from collections.abc import Sequence

from pam_gap.answer.diagnosis import Diagnosis
from pam_gap.answer.sentences import verdict_sentence
from pam_gap.diagnosis_engine import JointDiagnosis
from pam_gap.inference.search import Progress, silent
from pam_gap.recordings.belongs_to_rig import joints_recorded, refuse_other_rig
from pam_gap.recordings.computed_channels import without_computed
from pam_gap.recordings.noise_floor import noise_floor
from pam_gap.recordings.recording import COMMANDS, JOINTS, SHUT, Recording, RecordingError
from pam_gap.rules import DEFAULT, Rules
from pam_gap.rules.recording_rules import RecordingRules
from pam_model.errors import PamError
from pam_model.rig import Rig


class UnknownJointError(PamError):
    """A joint that the rig does not have."""


def diagnose(
    recordings: Recording | Sequence[Recording],
    rig: Rig,
    *,
    joint: str | None = None,
    threads: int = 0,
    progress: Progress = silent,
    rules: Rules = DEFAULT,
) -> list[Diagnosis]:
    """Find what a rig does beside its description, from recordings of it; nothing is written.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        Of one rig, from `import_recording`. `Recording.mounting` tells how the joint was mounted.
    rig : Rig
        What its owner believes, from `load_rig`.
    joint : str, optional
        Only this one; default every joint that the recordings hold.
    threads : int
        Simulations run at once; 0 for as many as there are processors, at most 4.
    progress : callable
        Told what is being done and the share done, 0 to 1.
    rules : Rules
        Hand-set constants of the diagnosis.

    Returns
    -------
    list of Diagnosis
        One for each joint: verdict, effects, parameters with intervals, how far the gap closes on
        data that took no part in the fit, and the improved rig where something was found.

    Raises
    ------
    RecordingError
        For recordings that are not of this rig, or that hold too little of it.
    UnknownJointError
        For a joint that the rig does not have.
    """
    given = [recordings] if isinstance(recordings, Recording) else list(recordings)
    read = [without_computed(recording, rig, rules.recording) for recording in given]
    return [
        diagnose_joint(rig, number, read, threads=threads, progress=progress, rules=rules)[1]
        for number in joints_to_diagnose(rig, read, joint)
    ]


def joints_to_diagnose(
    rig: Rig, recordings: Sequence[Recording], joint: str | None = None
) -> list[int]:
    """The numbers of the joints that recordings hold, or of the one that is asked for.

    Raises
    ------
    RecordingError
        When there is no recording, or the recordings are not of this rig.
    UnknownJointError
        For a joint that the rig does not have.
    """
    if not recordings:
        raise RecordingError("no recording given; expected at least one")
    numbers = joints_recorded(rig, recordings)
    if joint is not None:
        if joint not in rig.joint_names:
            raise UnknownJointError(f"no joint {joint!r}; it has {', '.join(rig.joint_names)}")
        numbers = [number for number in numbers if rig.joint_names[number] == joint]
        if not numbers:
            raise RecordingError(
                f"joint {joint!r}: the recordings hold no pressures of its muscles"
            )
    for number in numbers:
        refuse_other_rig(rig, number, recordings)
    return numbers


def diagnose_joint(
    rig: Rig,
    number: int,
    recordings: Sequence[Recording],
    *,
    threads: int = 0,
    progress: Progress = silent,
    rules: Rules = DEFAULT,
) -> tuple[JointDiagnosis, Diagnosis]:
    """Diagnose the joint of this number; the engine with all it has tried, and the answer.

    Parameters
    ----------
    rig : Rig
        As written.
    number : int
        Of the joint, from `joints_to_diagnose`.
    recordings : sequence of Recording
        Without computed channels.
    threads, progress, rules
        As of `diagnose`.
    """
    workers = threads if threads > 0 else min(os.cpu_count() or 1, 4)
    engine = JointDiagnosis(
        rig, number, recordings, rules=rules, threads=workers, progress=progress
    )
    diagnosis = engine.run()
    diagnosis.repairs = tuple(f"{r.source.name}: {text}" for r in recordings for text in r.repairs)
    diagnosis.left_out = tuple(
        dict.fromkeys(
            note for r in recordings for note in what_is_missing(rig, number, r, rules.recording)
        )
    )
    diagnosis.sentence = verdict_sentence(diagnosis)
    return engine, diagnosis


def what_is_missing(
    rig: Rig, joint: int, recording: Recording, rules: RecordingRules = DEFAULT.recording
) -> list[str]:
    """What the channels a recording lacks leave undecided, in words."""
    entry = rig.joints[joint]
    notes = []
    for name, consequence in (
        (f"{JOINTS}{entry.name}.position",
         "joint and sensing effects on the position cannot be judged"),
        *((f"valve_commands.{m}", "the valve stage cannot be judged") for m in entry.muscles),
        *((f"muscle_states.{m}.effort",
           "no load cell: force effects and joint effects are told apart by the motion alone")
          for m in entry.muscles),
    ):  # fmt: skip
        shut_valve = recording.mounting == SHUT and name.startswith(COMMANDS)
        if not recording.has(name) and not shut_valve:
            notes.append(f"{name}: not recorded; {consequence}")
    notes += [
        f"{name}: filtered before it was recorded; its noise cannot be seen and is "
        f"taken as {100 * rules.smoothed_share:g} % of its span"
        for name, noise in noise_floor(recording, rules).items()
        if noise.is_smoothed
    ]
    return notes
