"""`pam gap fleet`: many recordings diagnosed in parallel, and what changed over weeks.

Each recording is diagnosed (`diagnose_job`). Then the effects that several recordings of a joint
show are fitted on all of them (`tracking`), and steps and slopes are sought (`change_points`).
Every result is kept in a folder as soon as it exists, so that a run can be repeated or resumed.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pam_gap.fleet.diagnose_job import DiagnosisTask, diagnose_job, folder_name, kept_result, key_of
from pam_gap.fleet.fleet_page import write_page
from pam_gap.fleet.follow_all import Followed, follow_all
from pam_gap.fleet.jobs import Job, many_rigs, one_rig
from pam_gap.fleet.recording_time import time_of
from pam_gap.fleet.series import ParameterSeries, Point, as_json, limit_for, make_series, soonest
from pam_gap.fleet.tables import FOLLOWED, found_rows, recording_rows, write_tables
from pam_gap.fleet.workers import cluster, one_line, run_all
from pam_gap.rules import DEFAULT, Rules
from pam_model.command_line import Arguments, Outcome, plain, progress
from pam_model.errors import PamError

DAY = 86400.0  # s
DOCUMENT, PAGE, RESULTS = "fleet.json", "fleet.html", "recordings"


@dataclass(frozen=True, slots=True)
class Settings:
    """What is analysed, and how."""

    # folder, out: folder of the recordings, and for the results
    folder: Path
    out: Path
    # rig, table: rig file of all recordings, or table that names the rig of each; one of them
    rig: Path | None = None
    table: Path | None = None
    workers: int = 1  # processes of the local cluster
    scheduler: str = ""  # address of an existing Dask scheduler; empty for a local cluster
    # "effect.parameter" -> value that counts as too much
    limits: Mapping[str, float] = field(default_factory=dict)
    rules: Rules = DEFAULT  # hand-set constants
    map_path: Path | None = None  # map file for tables with other names or units
    # days of each period in which one recording of each robot is diagnosed in full, while the
    # others are only fitted with the effects that are followed; 0 diagnoses all in full
    full_every: float = 0.0
    show_progress: bool = False  # show a progress bar where standard error is a terminal


def _jobs(settings: Settings) -> list[Job]:
    if settings.table is not None:
        return many_rigs(settings.folder, settings.table)
    if settings.rig is None:
        raise PamError("no rig file given; expected --rig or --rigs")
    return one_rig(settings.folder, settings.rig, [settings.out])


def _failed(task: DiagnosisTask, failure: str) -> dict[str, Any]:
    """The result of a recording that could not be diagnosed for a reason outside of it."""
    when = time_of(task.job.recording, task.job.stated_time)
    return {
        "key": {}, "time": when.seconds, "time_from": when.source, "joints": [], "seconds": 0.0,
        "failure": failure,
    }  # fmt: skip


def _not_diagnosed(task: DiagnosisTask) -> dict[str, Any]:
    """The result of a recording that is only fitted with the effects that are followed."""
    try:
        return _failed(task, "") | {"key": key_of(task)}
    except PamError as error:  # the recording cannot be read
        return _failed(task, one_line(error))


def to_diagnose(
    robots: Sequence[str],
    times: Sequence[float],
    results: Sequence[Mapping[str, Any] | None],
    full_every: float,
) -> list[int]:
    """Numbers of the recordings that are diagnosed in full next.

    They are all without a result, or, with periods, the first without a result of each robot and
    period in which no recording has been diagnosed yet. Periods begin at fixed dates, so that
    later recordings do not change the choice.

    Parameters
    ----------
    robots, times : sequence
        Robot and Unix time [s] of each recording.
    results : sequence of mapping or None
        Results so far; a failed one does not serve its period.
    full_every : float
        Length of a period [days]; 0 for all recordings.
    """
    left = [k for k, result in enumerate(results) if result is None]
    if full_every <= 0.0:
        return left
    periods = [(robots[k], times[k] // (full_every * DAY)) for k in range(len(times))]
    served = {
        periods[k] for k, result in enumerate(results) if result is not None and result["joints"]
    }
    first: dict[tuple[str, float], int] = {}
    for k in sorted(left, key=lambda k: (times[k], k)):
        if periods[k] not in served:
            first.setdefault(periods[k], k)
    return sorted(first.values())


def _kept(task: DiagnosisTask) -> dict[str, Any] | None:
    try:
        return kept_result(task, key_of(task))
    except PamError:  # the recording cannot be read; its diagnosis says so
        return None


def diagnose_all(
    client: Any,
    tasks: Sequence[DiagnosisTask],
    settings: Settings,
    diagnose: Callable[[DiagnosisTask], dict[str, Any]] = diagnose_job,
) -> tuple[list[dict[str, Any]], int]:
    """Diagnose what is not kept; return the results in the order of the tasks, and how many were.

    Parameters
    ----------
    client : distributed.Client
        From `workers.cluster`.
    tasks : sequence of DiagnosisTask
        The recordings.
    settings : Settings
        For the progress bar.
    diagnose : callable
        Diagnoses one task on a worker.
    """
    results: list[dict[str, Any] | None] = [_kept(task) for task in tasks]
    places = [k for k, result in enumerate(results) if result is None]
    with progress(max(len(places), 1), "diagnoses", wanted=settings.show_progress) as bar:
        for done, end in enumerate(run_all(client, diagnose, [tasks[k] for k in places]), start=1):
            place = places[end.number]
            results[place] = end.result or _failed(tasks[place], end.failure)
            bar.show(done)
    return [result for result in results if result is not None], len(places)


def _diagnose_chosen(
    client: Any,
    tasks: Sequence[DiagnosisTask],
    settings: Settings,
    diagnose: Callable[[DiagnosisTask], dict[str, Any]],
) -> tuple[list[dict[str, Any]], int]:
    """The results of all recordings, and how many were diagnosed now."""
    robots = [task.job.robot for task in tasks]
    times = [time_of(task.job.recording, task.job.stated_time).seconds for task in tasks]
    results: list[dict[str, Any] | None] = [_kept(task) for task in tasks]
    new = 0
    while places := to_diagnose(robots, times, results, settings.full_every):
        found, count = diagnose_all(client, [tasks[k] for k in places], settings, diagnose)
        new += count
        for place, result in zip(places, found, strict=True):
            results[place] = result
    return [result or _not_diagnosed(tasks[k]) for k, result in enumerate(results)], new


def _with_failures(
    tasks: Sequence[DiagnosisTask], results: Sequence[dict[str, Any]], followed: Sequence[Followed]
) -> list[dict[str, Any]]:
    """The results; what was only fitted and could not be is a failed recording."""
    reasons = {name: reason for joint in followed for name, reason in joint.failures}
    return [
        result
        if result["joints"] or result["failure"]
        else result | {"failure": reasons.get(task.job.name, "")}
        for task, result in zip(tasks, results, strict=True)
    ]


def _link(task: DiagnosisTask, row: Mapping[str, Any], joints: int) -> str:
    """Address of the report of one joint, from the page of the fleet; empty after a failure."""
    if row["failure"] or not row["joint"]:
        return ""
    folder = f"{RESULTS}/{task.folder.name}"
    return f"{folder}/report.html" if joints == 1 else f"{folder}/{row['joint']}/report.html"


def series_of(followed: Sequence[Followed], limits: Mapping[str, float]) -> list[ParameterSeries]:
    """The series of all magnitudes; parameters that only shape an effect are left out."""
    made: list[ParameterSeries] = []
    for joint in followed:
        points: dict[tuple[str, str], list[Point]] = {}
        units: dict[tuple[str, str], str] = {}
        for name, time, row in joint.rows:
            if row["is_shape"]:
                continue
            which = (str(row["effect"]), str(row["parameter"]))
            units[which] = str(row["unit"])
            points.setdefault(which, []).append(
                Point(name, time, row["value"], row["low"], row["high"])
            )
        made += [
            make_series((joint.robot, joint.joint, *which), units[which], found,
                        limit_for(*which, limits))
            for which, found in points.items()
        ]  # fmt: skip
    return made


def analyse_fleet(
    settings: Settings,
    diagnose: Callable[[DiagnosisTask], dict[str, Any]] = diagnose_job,
) -> dict[str, Any]:
    """Diagnose a fleet, look for changes, and write tables, fleet.json and fleet.html.

    Raises
    ------
    PamError
        For a folder, table, rig file or scheduler that cannot be used.
    """
    jobs = _jobs(settings)
    kept_in = settings.out.resolve() / RESULTS
    tasks = [
        DiagnosisTask(job, kept_in / folder_name(job.name), settings.rules, settings.map_path)
        for job in jobs
    ]
    kept_in.mkdir(parents=True, exist_ok=True)
    for unfinished in kept_in.glob("*.part"):  # of a worker that died
        shutil.rmtree(unfinished, ignore_errors=True)
    with cluster(settings.workers, settings.scheduler) as client:
        results, new = _diagnose_chosen(client, tasks, settings, diagnose)
        followed = follow_all(client, tasks, results, show_progress=settings.show_progress)
    results = _with_failures(tasks, results, followed)
    series = series_of(followed, settings.limits)
    recordings = [
        row | {"link": _link(task, row, len(result["joints"]))}
        for task, result in zip(tasks, results, strict=True)
        for row in recording_rows(task.job.name, task.job.robot, result)
    ]
    parameters = [
        row
        for task, result in zip(tasks, results, strict=True)
        for row in found_rows(task.job.name, task.job.robot, result)
    ]
    parameters += [
        {"recording": name, "robot": f.robot, "joint": f.joint, "time": time, "source": FOLLOWED}
        | {k: row[k] for k in ("effect", "parameter", "value", "low", "high", "unit")}
        for f in followed
        for name, time, row in f.rows
    ]
    write_tables(settings.out, recordings, parameters)
    document: dict[str, Any] = plain(
        {
            "recordings": sorted(recordings, key=lambda row: row["time"]),
            "diagnosed_now": new,
            "followed": [replace(f, rows=()) for f in followed],
            "series": [as_json(s) for s in series],
            "next": [
                {"robot": s.robot, "joint": s.joint, "what": s.name, "weeks": weeks, "aim": aim}
                for s, weeks, aim in soonest(series)
            ],
        }
    )
    (settings.out / DOCUMENT).write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    write_page(document, series, settings.out / PAGE)
    return document


def run(given: Arguments) -> Outcome:
    """Analyse a fleet and print what changed; the command of `pam_gap.__main__`."""
    document = analyse_fleet(
        Settings(
            given.folder, given.out, rig=given.rig, table=given.rigs, workers=given.workers,
            scheduler=given.scheduler, limits=dict(given.limit), map_path=given.map,
            full_every=given.full_every, show_progress=not given.no_progress,
        )
    )  # fmt: skip
    rows = document["recordings"]
    failed = [row for row in rows if row["failure"]]
    names = {row["recording"] for row in rows}
    print(f"{len(names)} recordings, {document['diagnosed_now']} diagnosed now, "
          f"{len(failed)} failed")  # fmt: skip
    for row in failed:
        print(f"{row['recording']}: {row['failure']}")
    sentences = [text for series in document["series"] for text in series["sentences"]]
    for text in sentences:
        print(text)
    print(f"written: {Path(given.out) / PAGE}")
    changed = [t for s in document["series"] if s["changes"] for t in s["sentences"]]
    return Outcome(document, changed + [f"{r['recording']}: {r['failure']}" for r in failed])
