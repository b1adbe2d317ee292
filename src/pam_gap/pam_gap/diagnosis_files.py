"""`pam gap diagnose RECORDING... --rig RIG --out DIR`: a diagnosis from files to files.

It writes diagnosis.json, report.html and, where an effect was found, rig_improved.yaml, which
simulation, model node and controller can read in place of the rig file. For a verdict of `unknown`
it writes rig_retuned.yaml: the numbers of the rig file changed within their tolerance.
With `--quick` it writes first_look.json alone, which holds no verdict.
"""

from __future__ import annotations

import contextlib
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from threading import Thread

from pam_gap.answer.diagnosis import Diagnosis
from pam_gap.answer.provenance import provenance
from pam_gap.diagnose_recordings import (
    diagnose_subject,
    prepared_subject,
    subjects_to_diagnose,
)
from pam_gap.diagnosis_engine import DiagnosisOptions
from pam_gap.experiments.files import FOLDER
from pam_gap.first_look import first_look
from pam_gap.prediction.bench_joint import bench_muscles
from pam_gap.recordings.column_map import ColumnMap, load_column_map
from pam_gap.recordings.computed_channels import without_computed
from pam_gap.recordings.import_recording import import_recording
from pam_gap.recordings.recording import (
    LOCKED,
    SHUT,
    TURNED_OVER,
    Recording,
    RecordingError,
)
from pam_gap.rules import DEFAULT, Rules, changed
from pam_gap.rules.statement import BY_USER
from pam_model.command_line import Arguments, Outcome, Progress, progress
from pam_model.errors import PamError, Reasons
from pam_model.names import unknown
from pam_model.rig import Rig, load_rig, save_rig

IMPROVED_RIG, RETUNED_RIG = "rig_improved.yaml", "rig_retuned.yaml"
EVIDENCE = "evidence.npz"


def import_as_mounted(
    recordings: Sequence[str | Path],
    rig: Rig,
    mounted: Mapping[str, Sequence[str | Path]] | None = None,
    rules: Rules = DEFAULT,
    column_map: ColumnMap | None = None,
) -> list[Recording]:
    """Read recordings and note the mounting of the joint for each.

    Parameters
    ----------
    recordings : sequence of str or Path
        Recordings with the joint as the rig file describes it.
    rig : Rig
        Their rig.
    mounted : mapping, optional
        Mounting, such as `LOCKED`, -> further recordings.
    rules : Rules
        Hand-set constants of the diagnosis.
    column_map : ColumnMap, optional
        Names the columns of tables.

    Raises
    ------
    RecordingError
        When some of them cannot be read; the message has one line for each.
    """
    read = []
    reasons = Reasons(RecordingError)
    for mounting, paths in {"": recordings, **(mounted or {})}.items():
        for path in paths:
            with reasons.gathered():
                logged = import_recording(path, column_map=column_map)
                used = without_computed(logged, rig, rules.recording)
                read.append(replace(used, mounting=mounting))
    reasons.refuse()
    return read


def to_diagnose(
    recordings: Sequence[str | Path],
    rig_path: str | Path,
    joint: str | None,
    mounted: Mapping[str, Sequence[str | Path]],
    rules: Rules = DEFAULT,
    map_path: str | Path | None = None,
) -> tuple[Rig, list[Recording], list[str]]:
    """The rig, its recordings and the names of what is to be diagnosed, read from files.

    Parameters
    ----------
    recordings, rig_path, joint, rules, map_path
        As in `diagnose_files`.
    mounted : mapping
        As in `import_as_mounted`.

    Raises
    ------
    PamError
        For a rig file or recording that cannot be used.
    """
    rig = load_rig(rig_path)
    known = (*rig.joint_names, *bench_muscles(rig))
    if joint is not None and joint not in known:
        raise PamError(f"{rig_path}: {unknown('joint', joint, known)}")
    column_map = None if map_path is None else load_column_map(map_path)
    read = import_as_mounted(recordings, rig, mounted, rules, column_map)
    return rig, read, subjects_to_diagnose(rig, read, joint)


def subject_folder(out: str | Path, names: Sequence[str], name: str) -> Path:
    """The folder for the results of one joint, which is made: one for each if there are several."""
    place = Path(out)
    folder = place if len(names) == 1 else place / name
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def joint_progress(bar: Progress, name: str) -> Callable[[str, float], None]:
    """A function that shows the joint and the task of the diagnosis on the progress bar."""

    def tell(task: str, share: float) -> None:
        bar.show(share, f"{name}: {task}"[:48].ljust(48))

    return tell


def diagnose_files(
    recordings: Sequence[str | Path],
    rig_path: str | Path,
    out: str | Path,
    *,
    joint: str | None = None,
    threads: int = 0,
    show_progress: bool = True,
    turned_over: Sequence[str | Path] = (),
    locked: Sequence[str | Path] = (),
    shut: Sequence[str | Path] = (),
    rules: Rules = DEFAULT,
    keep_evidence: bool = False,
    command: str = "",
    map_path: str | Path | None = None,
    answer_only: bool = False,
) -> list[Diagnosis]:
    """Diagnose every joint in the recordings, or one, and write the results to `out`.

    Parameters
    ----------
    recordings : sequence of str or Path
        Recordings of one rig.
    rig_path : str or Path
        Rig file of this rig.
    out : str or Path
        Folder for diagnosis.json, report.html and rig_improved.yaml; with several joints, one
        folder in it for each.
    joint : str, optional
        Name of the only joint to diagnose.
    threads : int
        Number of simulations that run in parallel; 0 for one per processor, at most 4.
    show_progress : bool
        Show a progress bar where standard error is a terminal.
    turned_over, locked, shut : sequence of str or Path
        Further recordings with the joint mounted upside down, with the joint locked, or with both
        valves shut all the time (an external torque, `joint_states.<joint>.effort`, moves it).
    rules : Rules
        Hand-set constants of the diagnosis.
    keep_evidence : bool
        Write evidence.npz too, from which the verdict can be decided again with other rules.
    command : str
        The command line, for the record of what the answer was made from.
    map_path : str or Path, optional
        Map file that names the columns of the channels, for tables with other names or units.
    answer_only : bool
        Leave out the report page and the search for the next experiment, which take time.

    Raises
    ------
    PamError
        For a rig file or recording that cannot be used.
    """
    mounted = {TURNED_OVER: turned_over, LOCKED: locked, SHUT: shut}
    rig, read, names = to_diagnose(recordings, rig_path, joint, mounted, rules, map_path)
    origin = provenance(rig_path, [*recordings, *turned_over, *locked, *shut], command)
    answers = []
    if not answer_only:
        Thread(target=_import_report, name="import").start()
    for name in names:
        folder = subject_folder(out, names, name)
        with progress(1.0, name, wanted=show_progress) as bar:
            options = DiagnosisOptions(threads, joint_progress(bar, name), rules, not answer_only)
            engine, diagnosis = diagnose_subject(rig, name, read, options)
        diagnosis = replace(diagnosis, provenance=origin)
        improved_name = ""
        for made, file in ((diagnosis.improved, IMPROVED_RIG), (diagnosis.retuned, RETUNED_RIG)):
            if made is not None:
                improved_name = file
                save_rig(made, folder / file)
        if diagnosis.proposal is not None:
            diagnosis.proposal.write(folder / FOLDER)
        diagnosis.write(folder / "diagnosis.json")
        if keep_evidence and engine.evidence is not None:
            engine.evidence.save(folder / EVIDENCE)
        if not answer_only:
            from pam_gap.answer.report import write_report  # noqa: PLC0415  (see _import_report)

            write_report(folder / "report.html", engine.problem, diagnosis, improved_name)
        answers.append(diagnosis)
    return answers


def _import_report() -> None:
    """Import what draws a report, matplotlib and Bokeh, while the simulations run."""
    with contextlib.suppress(ModuleNotFoundError):  # the report says what is missing
        import bokeh.embed  # noqa: PLC0415
        import bokeh.plotting  # noqa: F401, PLC0415

        import pam_gap.answer.report  # noqa: F401, PLC0415


def _rules(given: Arguments) -> Rules:
    rules = DEFAULT
    if given.material is not None:
        rules = changed("decision.material_share", given.material, rules)
    for name, value in given.belief:
        if name not in BY_USER:
            raise PamError(f"--belief {name}={value:g}: {unknown('belief', name, BY_USER)}")
        rules = changed(f"statement.{name}", value, rules)
    return rules


def run(given: Arguments) -> Outcome:
    """Diagnose and print each joint's verdict; the command of `pam_gap.__main__`."""
    if given.quick:
        return _look(given)
    answers = diagnose_files(
        given.recordings,
        given.rig,
        given.out,
        joint=given.joint,
        threads=given.threads,
        show_progress=not given.no_progress,
        turned_over=given.turned_over,
        locked=given.locked,
        shut=given.shut,
        map_path=given.map,
        command=shlex.join(sys.orig_argv),
        keep_evidence=given.keep_evidence,
        answer_only=given.answer_only,
        rules=_rules(given),
    )
    for answer in answers:
        print(f"{answer.joint}: {answer.sentence}")
    print(f"written: {given.out}")
    return Outcome(
        {"out": given.out, "joints": [answer.to_json() for answer in answers]},
        [f"{a.joint}: verdict {a.verdict}" for a in answers if a.verdict != "none"],
    )


def _look(given: Arguments) -> Outcome:
    """Take a first look at each joint, print it, and write it to `first_look.json`."""
    mounted = {TURNED_OVER: given.turned_over, LOCKED: given.locked, SHUT: given.shut}
    rules = _rules(given)
    rig, read, names = to_diagnose(
        given.recordings, given.rig, given.joint, mounted, rules, given.map
    )
    looks = []
    for name in names:
        with progress(1.0, name, wanted=not given.no_progress) as bar:
            options = DiagnosisOptions(given.threads, joint_progress(bar, name), rules)
            engine = prepared_subject(rig, name, read, options)
            looks.append(replace(first_look(engine), joint=name))
        looks[-1].write(subject_folder(given.out, names, name))
    for look in looks:
        print(look.text())
    print(f"written: {given.out}")
    return Outcome(
        {"out": given.out, "joints": [look.to_json() for look in looks]},
        [f"{look.joint}: a gap that matters" for look in looks if look.effects or look.missing],
    )
