"""Chooses the effects of each joint that are followed, and fits them on all its recordings.

Effects that look alike share the verdicts of single recordings: dry friction is named on one day,
thread friction on the next. Over all recordings only one of them is needed. The candidates are
therefore fitted together, and those that hardly help are removed one by one.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pam_gap.fleet.diagnose_job import DiagnosisTask
from pam_gap.fleet.tracking import TrackTask, effects_to_follow, follow, typical_values
from pam_gap.fleet.workers import run_all
from pam_gap.rules import DEFAULT
from pam_model.command_line import plain, progress
from pam_model.errors import PamError
from pam_model.reading import read_text, reading

RULES = DEFAULT.fleet

Rows = list[dict[str, Any]]


@dataclass(frozen=True, slots=True)
class Followed:
    """The effects of one joint that are fitted on all its recordings."""

    # robot, joint: which joint
    robot: str
    joint: str
    labels: tuple[str, ...]  # the effects
    # recording, time, and a row of `tracking.follow`
    rows: tuple[tuple[str, float, Mapping[str, Any]], ...]
    # recordings on which they cannot be fitted, each with the reason
    failures: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class _Entry:
    """One joint of one recording, with its diagnosis; None if it was not diagnosed."""

    task: DiagnosisTask
    result: Mapping[str, Any]
    joint: str
    answer: Mapping[str, Any] | None

    def fit_of(self, labels: tuple[str, ...], starts: tuple[dict[str, float], ...]) -> TrackTask:
        job = self.task.job
        return TrackTask(
            job.recording, job.rig, self.joint, labels, starts, self.task.rules, self.task.map_path,
        )  # fmt: skip

    def kept_in(self, task: TrackTask) -> Path:
        text = json.dumps([self.result["key"], task.joint, task.labels], sort_keys=True)
        name = hashlib.sha256(text.encode()).hexdigest()[:20]
        return self.task.folder / f"followed_{name}.json"


def _read_rows(path: Path) -> Rows | None:
    try:
        with reading(path, "kept rows"):
            found = json.loads(read_text(path))
    except PamError:
        return None
    return found if isinstance(found, list) else None


def _fit_all(
    client: Any, work: Sequence[tuple[_Entry, TrackTask]], text: str, show_progress: bool
) -> list[Rows | str]:
    """The rows of each fit, or the reason of its failure; what is kept is not fitted again."""
    keeps = [entry.kept_in(task) for entry, task in work]
    ended: list[Rows | str] = [_read_rows(path) or "" for path in keeps]
    left = [k for k, found in enumerate(ended) if not found]
    with progress(max(len(left), 1), text, wanted=show_progress) as bar:
        for done, end in enumerate(run_all(client, follow, [work[k][1] for k in left]), start=1):
            place = left[end.number]
            ended[place] = end.failure or plain(end.result)
            if not end.failure:
                keeps[place].parent.mkdir(parents=True, exist_ok=True)
                keeps[place].write_text(json.dumps(ended[place]) + "\n", encoding="utf-8")
            bar.show(done)
    return ended


def _explained(fits: Sequence[Rows | str]) -> np.ndarray:
    """By how much each fit lowers the level of the error; NaN after a failure."""
    return np.array([np.nan if isinstance(f, str) else f[0]["improvement"] for f in fits])


def share_where_it_helps(together: np.ndarray, without: np.ndarray) -> float:
    """Share that an effect explains of what all do, where it helps most.

    Parameters
    ----------
    together, without : ndarray, shape (recordings,)
        Fall of the error's level with all effects, and without this one; NaN where not fitted.
    """
    known = np.isfinite(together) & np.isfinite(without)
    if not known.any():
        return 0.0
    gain, all_ = (together - without)[known], np.maximum(together[known], 1e-9)
    count = max(1, round(RULES.where_it_helps * gain.size))
    most = np.argsort(gain)[-count:]
    return float(gain[most].sum() / all_[most].sum())


def _answers(entries: Sequence[_Entry]) -> list[Mapping[str, Any]]:
    return [entry.answer for entry in entries if entry.answer is not None]


def _needed(
    client: Any, entries: Sequence[_Entry], labels: tuple[str, ...], show_progress: bool
) -> tuple[str, ...]:
    """The effects without those that the others explain about as well."""
    places = np.unique(
        np.linspace(0, len(entries) - 1, min(RULES.chosen_on, len(entries))).astype(int)
    )
    chosen_on = [entries[k] for k in places]
    answers = _answers(entries)

    def explained(kept: tuple[str, ...]) -> np.ndarray:
        starts = typical_values(answers, kept)
        work = [(entry, entry.fit_of(kept, starts)) for entry in chosen_on]
        return _explained(_fit_all(client, work, "choosing effects", show_progress))

    while len(labels) > 1:
        together = explained(labels)
        shares = {
            label: share_where_it_helps(together, explained(tuple(o for o in labels if o != label)))
            for label in labels
        }
        least = min(labels, key=lambda label: shares[label])
        if shares[least] >= RULES.needed:
            break
        labels = tuple(other for other in labels if other != least)
    return labels


def follow_all(
    client: Any,
    tasks: Sequence[DiagnosisTask],
    results: Sequence[Mapping[str, Any]],
    *,
    show_progress: bool = False,
) -> list[Followed]:
    """Choose the effects of every joint, and fit them on all its recordings.

    Parameters
    ----------
    client : distributed.Client
        From `workers.cluster`.
    tasks, results : sequence
        The recordings and their diagnoses, in the same order.
    show_progress : bool
        Show a progress bar where standard error is a terminal.
    """
    joints: dict[tuple[str, str], list[_Entry]] = {}
    for task, result in zip(tasks, results, strict=True):
        for answer in result["joints"]:
            joint = str(answer["joint"])
            entry = _Entry(task, result, joint, answer)
            joints.setdefault((task.job.robot, joint), []).append(entry)
    for task, result in zip(tasks, results, strict=True):
        if result["joints"] or result.get("failure"):
            continue
        for (robot, joint), entries in joints.items():
            if robot == task.job.robot:
                entries.append(_Entry(task, result, joint, None))
    made = []
    for where, found in joints.items():
        entries = sorted(
            (e for e in found if e.answer is None or e.answer["verdict"] != "not_identifiable"),
            key=lambda e: float(e.result["time"]),
        )
        answers = _answers(entries)
        labels = _needed(client, entries, effects_to_follow(answers), show_progress)
        starts = typical_values(answers, labels)
        work = [(entry, entry.fit_of(labels, starts)) for entry in entries] if labels else []
        fits = _fit_all(client, work, "following", show_progress)
        rows = tuple(
            (entry.task.job.name, float(entry.result["time"]), row)
            for (entry, _), fit in zip(work, fits, strict=True)
            if not isinstance(fit, str)
            for row in fit
        )
        failures = tuple(
            (entry.task.job.name, fit)
            for (entry, _), fit in zip(work, fits, strict=True)
            if isinstance(fit, str)
        )
        made.append(Followed(*where, labels, rows, failures))
    return made
