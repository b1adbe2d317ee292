"""A diagnosis from recordings in memory, without files, for scripts and notebooks."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace

from pam_gap.answer.diagnosis import Diagnosis
from pam_gap.answer.sentences import verdict_sentence
from pam_gap.diagnosis_engine import JointDiagnosis
from pam_gap.inference.loose_lengths import (
    as_measured,
    probability_of_lengths,
    shared_probabilities,
)
from pam_gap.inference.search import Progress, silent
from pam_gap.recordings.belongs_to_rig import joints_recorded, refuse_other_rig
from pam_gap.recordings.computed_channels import without_computed
from pam_gap.recordings.frozen import without_frozen
from pam_gap.recordings.noise_floor import noise_floor
from pam_gap.recordings.parts import parts
from pam_gap.recordings.plausible_units import refuse_other_units
from pam_gap.recordings.recording import COMMANDS, JOINTS, SHUT, Recording, RecordingError
from pam_gap.recordings.saturation import without_saturated
from pam_gap.recordings.still_channels import without_still
from pam_gap.rules import DEFAULT, Rules
from pam_gap.rules.recording_rules import RecordingRules
from pam_model.rig import Rig


def diagnose(
    recordings: Recording | Sequence[Recording],
    rig: Rig,
    *,
    joint: str | None = None,
    threads: int = 0,
    progress: Progress = silent,
    rules: Rules = DEFAULT,
) -> list[Diagnosis]:
    """Find where a rig differs from its rig file, from recordings of it; nothing is written.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        Recordings of one rig, from `import_recording`. `Recording.mounting` states the mounting.
    rig : Rig
        The rig as its file describes it, from `load_rig`.
    joint : str, optional
        Name of the only joint to diagnose; default is every joint in the recordings.
    threads : int
        Number of simulations that run in parallel; 0 for one per processor, at most 4.
    progress : callable
        Called with the current task and the completed share, 0 to 1.
    rules : Rules
        Hand-set constants of the diagnosis.

    Returns
    -------
    list of Diagnosis
        One for each joint: verdict, effects, parameters with intervals, how far the gap closes on
        data that were not used for the fit, and the improved rig if an effect was found.

    Raises
    ------
    RecordingError
        For recordings of another rig, or without the necessary channels.
    UnknownNameError
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
    """Numbers of the joints in the recordings, or of the given joint.

    Raises
    ------
    RecordingError
        When there is no recording, or the recordings are of another rig or in other units.
    UnknownNameError
        For a joint that the rig does not have.
    """
    if joint is not None:
        rig.joint(joint)
    if not recordings:
        raise RecordingError("no recording given; expected at least one")
    numbers = joints_recorded(rig, recordings)
    if joint is not None:
        numbers = [number for number in numbers if rig.joint_names[number] == joint]
        if not numbers:
            raise RecordingError(
                f"joint {joint!r}: the recordings hold no pressures of its muscles"
            )
    for number in numbers:
        refuse_other_rig(rig, number, recordings)
        refuse_other_units(rig, number, recordings)
    return numbers


def usable_parts(
    rig: Rig,
    number: int,
    recordings: Sequence[Recording],
    rules: RecordingRules = DEFAULT.recording,
) -> list[Recording]:
    """Recordings as a diagnosis uses them: still, clipped and frozen samples marked, cut at gaps.

    Parameters
    ----------
    rig : Rig
        The rig as its file describes it.
    number : int
        Number of the joint, from `joints_to_diagnose`.
    recordings : sequence of Recording
        Recordings without computed channels.
    rules : RecordingRules
        Constants of the judgement.
    """
    muscles = rig.joints[number].muscles
    return [
        part
        for recording in recordings
        for part in parts(
            without_frozen(
                without_saturated(without_still(recording, rig, number, rules), rules),
                muscles,
                rules,
            ),
            muscles,
            rules,
        )
    ]


def prepared(
    rig: Rig,
    number: int,
    recordings: Sequence[Recording],
    *,
    threads: int = 0,
    progress: Progress = silent,
    rules: Rules = DEFAULT,
    with_experiment: bool = True,
) -> JointDiagnosis:
    """Prepare the diagnosis of the joint with this number; the arguments are `diagnose_joint`'s."""
    return JointDiagnosis(
        rig, number, usable_parts(rig, number, recordings, rules.recording), rules=rules,
        threads=threads if threads > 0 else min(os.cpu_count() or 1, 4), progress=progress,
        with_experiment=with_experiment,
    )  # fmt: skip


def diagnose_joint(
    rig: Rig,
    number: int,
    recordings: Sequence[Recording],
    *,
    threads: int = 0,
    progress: Progress = silent,
    rules: Rules = DEFAULT,
    with_experiment: bool = True,
) -> tuple[JointDiagnosis, Diagnosis]:
    """Diagnose the joint with this number; return the engine with all its trials, and the answer.

    Parameters
    ----------
    rig : Rig
        The rig as its file describes it.
    number : int
        Number of the joint, from `joints_to_diagnose`.
    recordings : sequence of Recording
        Recordings without computed channels.
    threads, progress, rules
        As in `diagnose`.
    with_experiment : bool
        Whether the next experiment is sought.
    """

    def engine_for(given: Rig) -> JointDiagnosis:
        return prepared(
            given, number, recordings, threads=threads, progress=progress, rules=rules,
            with_experiment=with_experiment,
        )  # fmt: skip

    engine = engine_for(rig)
    diagnosis = engine.run()
    if engine.lengths is not None:
        second = engine_for(as_measured(rig, rules.search))
        engine, diagnosis = _likelier(engine, diagnosis, second, second.run())
    used = [data.recording for data in engine.problem.data]
    diagnosis = replace(
        diagnosis,
        repairs=tuple(f"{r.source.name}: {text}" for r in used for text in r.repairs),
        left_out=tuple(
            dict.fromkeys(
                note for r in used for note in what_is_missing(rig, number, r, rules.recording)
            )
        ),
    )
    return engine, replace(diagnosis, sentence=verdict_sentence(diagnosis))


def _likelier(
    loose: JointDiagnosis, answer: Diagnosis, tight: JointDiagnosis, other: Diagnosis
) -> tuple[JointDiagnosis, Diagnosis]:
    """The answer with loose lengths, or the one with lengths as measured if it is likelier.

    Wrong lengths keep their probability in addition to the causes that are named without them.
    """
    if loose.lengths is None or loose.answer is None or tight.answer is None:
        return loose, answer
    if other.verdict not in ("named", "ambiguous"):
        return loose, answer
    share = probability_of_lengths(tight.judge, loose.answer, loose.lengths, tight.answer)
    if share > 0.5:
        return loose, answer
    assumed = tight.rig.length_tolerance or 0.0
    return tight, replace(
        other,
        probabilities=shared_probabilities(other.probabilities, answer.probabilities, share),
        cautions=(*other.cautions, loose.lengths.rival_caution(assumed)),
    )


def what_is_missing(
    rig: Rig, joint: int, recording: Recording, rules: RecordingRules = DEFAULT.recording
) -> list[str]:
    """For each channel that is missing or filtered, what cannot be judged or is assumed."""
    entry = rig.joints[joint]
    notes = []
    for name, consequence in (
        (f"{JOINTS}{entry.name}.position",
         "joint and sensing effects on the position cannot be judged"),
        *((f"valve_commands.{m}", "the valve stage cannot be judged") for m in entry.muscles),
        *((f"muscle_states.{m}.effort",
           "without a load cell, only the motion distinguishes force effects from joint effects")
          for m in entry.muscles),
    ):  # fmt: skip
        shut_valve = recording.mounting == SHUT and name.startswith(COMMANDS)
        if not recording.has(name) and not shut_valve:
            notes.append(f"{name}: not recorded; {consequence}")
    notes += [
        f"{name}: filtered before it was recorded; its noise cannot be estimated and is "
        f"assumed to be {100 * rules.smoothed_share:g} % of its span"
        for name, noise in noise_floor(recording, rules).items()
        if noise.is_smoothed
    ]
    return notes
