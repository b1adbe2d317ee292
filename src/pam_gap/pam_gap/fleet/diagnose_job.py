"""Diagnoses one recording of a fleet, on any worker, and keeps the result in a folder.

The folder of a recording holds what `diagnose` writes and, written last, the file `done.json`. Its
key is made of the hashes of recording, rig file and source code, the version of the suite and the
settings. A recording whose key is unchanged is not diagnosed again.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pam_gap
from pam_gap.answer.provenance import source_file, source_hash
from pam_gap.diagnosis_files import diagnose_files
from pam_gap.fleet.jobs import Job
from pam_gap.fleet.recording_time import time_of
from pam_gap.fleet.workers import one_line
from pam_gap.rules import DEFAULT, Rules
from pam_model.command_line import plain
from pam_model.errors import PamError
from pam_model.reading import read_text, reading

DONE = "done.json"


@dataclass(frozen=True, slots=True)
class DiagnosisTask:
    """A job with all that a worker needs."""

    job: Job  # the recording
    folder: Path  # where the results of this recording are kept; absolute
    rules: Rules = DEFAULT  # hand-set constants
    map_path: Path | None = None  # map file for tables with other names or units


def folder_name(name: str) -> str:
    """Name of the folder for a recording, readable and without separators."""
    return re.sub(r"[^A-Za-z0-9._-]+", "_", name.replace(os.sep, "__")).strip(".") or "_"


def key_of(task: DiagnosisTask) -> dict[str, str]:
    """Everything on which the answer depends.

    Raises
    ------
    PamError
        When the recording or the rig file cannot be read.
    """
    column_map = "" if task.map_path is None else source_file(task.map_path).sha256
    return {
        "recording": source_file(task.job.recording).sha256,
        "rig": source_file(task.job.rig).sha256,
        "version": pam_gap.__version__,
        "source": source_hash(),
        "settings": f"{column_map} {task.rules!r}" if task.rules != DEFAULT else column_map,
    }


def kept_result(task: DiagnosisTask, key: Mapping[str, str]) -> dict[str, Any] | None:
    """The kept result of a recording; None if there is none or it was made from something else."""
    place = task.folder / DONE
    try:
        with reading(place, "a kept result"):
            kept = json.loads(read_text(place))
    except PamError:
        return None
    if not isinstance(kept, dict) or kept.get("key") != dict(key):
        return None
    return kept


def diagnose_job(task: DiagnosisTask) -> dict[str, Any]:
    """Diagnose one recording and keep the result; a mistake in the recording is a result, too.

    Returns
    -------
    dict
        `key`, `time`, `time_from`, `seconds`, `joints` (the content of each diagnosis.json) and
        `failure` (empty, or the reason in one line).
    """
    started = time.monotonic()
    key = key_of(task)
    when = time_of(task.job.recording, task.job.stated_time)
    result: dict[str, Any] = {
        "key": key,
        "time": when.seconds,
        "time_from": when.source,
        "joints": [],
        "failure": "",
    }
    work = task.folder.with_name(f"{task.folder.name}.{os.getpid()}.part")
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    try:
        answers = diagnose_files(
            [task.job.recording],
            task.job.rig,
            work,
            threads=1,
            show_progress=False,
            rules=task.rules,
            map_path=task.map_path,
        )
        result["joints"] = [answer.to_json() for answer in answers]
    except PamError as error:
        result["failure"] = one_line(error)
    result["seconds"] = time.monotonic() - started
    document = plain(result)
    (work / DONE).write_text(json.dumps(document) + "\n", encoding="utf-8")
    shutil.rmtree(task.folder, ignore_errors=True)
    work.replace(task.folder)
    found: dict[str, Any] = document
    return found
