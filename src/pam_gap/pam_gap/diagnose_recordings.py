"""A diagnosis from recordings in memory, without files, for scripts and notebooks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from pam_gap.answer.diagnosis import Diagnosis
from pam_gap.answer.sentences import verdict_sentence
from pam_gap.diagnosis_engine import USUAL, DiagnosisOptions, JointDiagnosis
from pam_gap.inference.loose_lengths import (
    as_measured,
    probability_of_lengths,
    shared_probabilities,
)
from pam_gap.prediction.bench_joint import (
    bench_channels,
    bench_muscles,
    bench_muscles_recorded,
    off_the_joint,
    on_an_invented_joint,
    refuse_other_lengths,
)
from pam_gap.recordings.belongs_to_rig import (
    joints_recorded,
    refuse_no_bench,
    refuse_other_rig,
)
from pam_gap.recordings.computed_channels import without_computed
from pam_gap.recordings.frozen import without_frozen
from pam_gap.recordings.noise_floor import noise_floor
from pam_gap.recordings.parts import parts
from pam_gap.recordings.plausible_units import refuse_other_units, refuse_other_units_on_bench
from pam_gap.recordings.recording import (
    COMMANDS,
    JOINTS,
    PRESSURES,
    SHUT,
    Recording,
    RecordingError,
)
from pam_gap.recordings.saturation import without_saturated
from pam_gap.recordings.still_channels import without_still
from pam_gap.rules import DEFAULT, Rules
from pam_gap.rules.recording_rules import RecordingRules
from pam_gap.search.candidate_search import Progress, silent
from pam_model.errors import Reasons
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
        Name of the only joint, or of the only muscle on a bench, to diagnose; default is each of
        them in the recordings.
    threads, progress, rules
        As in `DiagnosisOptions`.

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
    options = DiagnosisOptions(threads, progress, rules)
    return [
        diagnose_subject(rig, name, read, options)[1]
        for name in subjects_to_diagnose(rig, read, joint)
    ]


def subjects_to_diagnose(
    rig: Rig, recordings: Sequence[Recording], name: str | None = None
) -> list[str]:
    """Names of the joints, and of the muscles on a bench, in the recordings; or the given one.

    Raises
    ------
    RecordingError
        When there is no recording, or the recordings are of another rig or in other units.
    UnknownNameError
        For a name that is neither a joint nor a muscle on a bench.
    """
    on_bench = bench_muscles(rig)
    if name is not None and name not in on_bench:
        return [rig.joint_names[k] for k in joints_to_diagnose(rig, recordings, name)]
    if not recordings:
        raise RecordingError("no recording given; expected at least one")
    found = bench_muscles_recorded(rig, recordings)
    if name is not None:
        found = [one for one in found if one == name]
        if not found:
            refuse_no_bench(bench_channels(name), recordings)
    reasons = Reasons(RecordingError)
    for muscle in found:
        with reasons.gathered():
            refuse_other_units_on_bench(rig, muscle, recordings)
            for recording in recordings:
                refuse_other_lengths(rig, muscle, recording)
    reasons.refuse()
    if name is not None or (found and not rig.joints):
        return found
    if not rig.joints:
        refuse_no_bench(bench_channels(on_bench[0]) if on_bench else (), recordings)
    if found and not any(
        recordings[0].has(f"{PRESSURES}{m}") for j in rig.joints for m in j.muscles
    ):
        return found
    return [rig.joint_names[k] for k in joints_to_diagnose(rig, recordings)] + found


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
    wanted = [k for k, name in enumerate(rig.joint_names) if joint in (None, name)]
    numbers: list[int] = []
    reasons = Reasons(RecordingError)
    with reasons.gathered():
        numbers = [number for number in joints_recorded(rig, recordings) if number in wanted]
        if not numbers:
            raise RecordingError(
                f"joint {joint!r}: the recordings hold no pressures of its muscles"
            )
    for number in numbers or wanted:  # without pressures, what else is wrong is still said
        with reasons.gathered():
            if number in numbers:
                refuse_other_rig(rig, number, recordings)
        with reasons.gathered():
            refuse_other_units(rig, number, recordings)
    reasons.refuse()
    return numbers


def usable_parts(
    rig: Rig,
    number: int,
    recordings: Sequence[Recording],
    rules: RecordingRules = DEFAULT.recording,
    muscles: tuple[str, ...] | None = None,
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
    muscles : tuple of str, optional
        Muscles that exist, by default both of the joint.
    """
    muscles = rig.joints[number].muscles if muscles is None else muscles
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


def prepared_subject(
    rig: Rig, name: str, recordings: Sequence[Recording], options: DiagnosisOptions = USUAL
) -> JointDiagnosis:
    """Prepare the diagnosis of a joint or a muscle on a bench, by its name."""
    if name in rig.joint_names:
        return _engine(rig, rig.joint_number(name), recordings, options)
    return _engine(on_an_invented_joint(rig, name), 0, recordings, options, is_bench=True)


def _engine(
    rig: Rig,
    number: int,
    recordings: Sequence[Recording],
    options: DiagnosisOptions,
    *,
    is_bench: bool = False,
) -> JointDiagnosis:
    """The diagnosis of the joint with this number, which may be invented for a bench."""
    muscles = rig.joints[number].muscles[:1] if is_bench else rig.joints[number].muscles
    usable = usable_parts(rig, number, recordings, options.rules.recording, muscles)
    return JointDiagnosis(rig, number, usable, options, is_bench=is_bench)


def diagnose_subject(
    rig: Rig, name: str, recordings: Sequence[Recording], options: DiagnosisOptions = USUAL
) -> tuple[JointDiagnosis, Diagnosis]:
    """Diagnose a joint, or a muscle on a bench, by its name from `subjects_to_diagnose`.

    Parameters
    ----------
    rig : Rig
        The rig as its file describes it.
    recordings : sequence of Recording
        Recordings without computed channels.
    options : DiagnosisOptions
        How.

    Returns
    -------
    JointDiagnosis, Diagnosis
        The engine with all its trials, and the answer.
    """
    is_bench = name not in rig.joint_names
    number = 0 if is_bench else rig.joint_number(name)
    engine, diagnosis = _answered(
        partial(_engine, number=number, recordings=recordings, options=options, is_bench=is_bench),
        on_an_invented_joint(rig, name) if is_bench else rig,
        options.rules,
    )
    used = [data.recording for data in engine.problem.data]
    if not is_bench:
        missing = [note for r in used for note in what_is_missing(rig, number, r)]
    elif engine.problem.has_commands:
        missing = []
    else:
        missing = [f"{COMMANDS}{name}: not recorded; the valve stage cannot be judged"]
    if is_bench:
        improved, retuned = (
            None if found is None else off_the_joint(rig, name, found)
            for found in (diagnosis.improved, diagnosis.retuned)
        )
        diagnosis = replace(diagnosis, joint=name, improved=improved, retuned=retuned)
    return engine, _with_notes(diagnosis, used, missing, options.rules.recording)


def _answered(
    engine_for: Callable[[Rig], JointDiagnosis], rig: Rig, rules: Rules
) -> tuple[JointDiagnosis, Diagnosis]:
    """The answer, with lengths as measured where loose ones explain most of the error."""
    engine = engine_for(rig)
    diagnosis = engine.run()
    if engine.lengths is not None:
        second = engine_for(as_measured(rig, rules.search))
        engine, diagnosis = _likelier(engine, diagnosis, second, second.run())
    return engine, diagnosis


def _with_notes(
    diagnosis: Diagnosis, used: Sequence[Recording], missing: Sequence[str], rules: RecordingRules
) -> Diagnosis:
    """The diagnosis with what was repaired and what is missing in its recordings, in words."""
    notes = [*missing, *(note for r in used for note in filtered_channels(r, rules))]
    diagnosis = replace(
        diagnosis,
        repairs=tuple(f"{r.source.name}: {text}" for r in used for text in r.repairs),
        left_out=tuple(dict.fromkeys(notes)),
    )
    return replace(diagnosis, sentence=verdict_sentence(diagnosis))


def _likelier(
    loose: JointDiagnosis, answer: Diagnosis, tight: JointDiagnosis, other: Diagnosis
) -> tuple[JointDiagnosis, Diagnosis]:
    """The answer with loose lengths, or the one with lengths as measured if it is likelier.

    Wrong lengths keep their probability in addition to the causes that are named without them.
    """
    if loose.lengths is None or loose.evidence is None or tight.evidence is None:
        return loose, answer
    if other.verdict not in ("named", "ambiguous"):
        return loose, answer
    share = probability_of_lengths(tight.evidence, loose.evidence, tight.rules)
    if share > 0.5:
        return loose, answer
    assumed = tight.rig.length_tolerance or 0.0
    return tight, replace(
        other,
        probabilities=shared_probabilities(other.probabilities, answer.probabilities, share),
        cautions=(*other.cautions, loose.lengths.rival_caution(assumed)),
    )


def what_is_missing(rig: Rig, joint: int, recording: Recording) -> list[str]:
    """For each channel that is missing, what cannot be judged."""
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
    return notes


def filtered_channels(recording: Recording, rules: RecordingRules = DEFAULT.recording) -> list[str]:
    """For each channel that was filtered, what is assumed of its noise."""
    return [
        f"{name}: filtered before it was recorded; its noise cannot be estimated and is "
        f"assumed to be {100 * rules.smoothed_share:g} % of its span"
        for name, noise in noise_floor(recording, rules).items()
        if noise.is_smoothed and name not in recording.silent
    ]
