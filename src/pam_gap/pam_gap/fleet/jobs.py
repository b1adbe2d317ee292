"""The recordings of a fleet with the rig of each: what is to be diagnosed."""

from __future__ import annotations

import io
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from pam_gap.fleet.recording_time import read_date
from pam_gap.recordings.import_csv import TABLES, is_table
from pam_gap.recordings.import_recording import is_bag
from pam_model.errors import PamError
from pam_model.reading import read_text, reading
from pam_model.rig import load_rig
from pam_ros.foreign_text import all_shown, shown

COLUMNS = ("recording", "rig", "robot", "time")


@dataclass(frozen=True, slots=True)
class Job:
    """One recording to be diagnosed."""

    name: str  # path of the recording in the folder of the fleet
    # recording, rig: the recording and its rig file; absolute, so that every worker finds them
    recording: Path
    rig: Path
    # the robot whose joints are tracked over time; recordings of one robot have the same
    robot: str
    stated_time: float | None = None  # unix time that the table of rigs states [s]


def find_recordings(folder: Path, without: Sequence[Path] = ()) -> list[Path]:
    """Bags and tables in a folder and all folders below it, in the order of their names.

    Parameters
    ----------
    folder : Path
        Folder of the fleet.
    without : sequence of Path
        Folders and files that hold no recordings: the results, and the table of rigs.
    """
    left_out = {path.resolve() for path in without}
    found: list[Path] = []
    for place, folders, files in os.walk(folder, followlinks=True):
        here = Path(place)
        if here.resolve() in left_out:
            folders.clear()
        elif (here / "metadata.yaml").is_file():  # a bag; its files are no recordings of their own
            found.append(here)
            folders.clear()
        else:
            paths = (here / name for name in files)
            found += [
                path
                for path in paths
                if (is_bag(path) or is_table(path)) and path.resolve() not in left_out
            ]
    return sorted(found)


def one_rig(folder: Path, rig: Path, without: Sequence[Path] = ()) -> list[Job]:
    """Every recording of a folder, all of one robot.

    Raises
    ------
    PamError
        When there is no recording, or the rig file cannot be used.
    """
    load_rig(rig)
    found = find_recordings(folder, without)
    if not found:
        raise PamError(
            f"{folder}: no recording in this folder; expected rosbag2 folders, .mcap, .db3 or "
            f"{', '.join(TABLES)}"
        )
    return [
        Job(str(path.relative_to(folder)), path.resolve(), rig.resolve(), rig.stem)
        for path in found
    ]


def many_rigs(folder: Path, table: Path) -> list[Job]:
    """The recordings that a table names, with the rig file of each.

    Parameters
    ----------
    folder : Path
        Folder of the fleet, from which the paths of the recordings start.
    table : Path
        CSV with the columns `recording`, `rig` (a path from the folder of the table) and, where
        wanted, `robot` (a name; by default that of the rig file) and `time` (ISO 8601).

    Raises
    ------
    PamError
        For a table, recording or rig file that cannot be used.
    """
    with reading(table, "a readable CSV table"):
        return _many_rigs(folder, table)


def _many_rigs(folder: Path, table: Path) -> list[Job]:
    text = io.StringIO(read_text(table))
    rows = pd.read_csv(text, dtype=str, comment="#", skipinitialspace=True)
    rows.columns = [str(name).strip() for name in rows.columns]
    for column in ("recording", "rig"):
        if column not in rows.columns:
            raise PamError(
                f"{table}: no column {column!r}; found {all_shown(rows.columns)}; expected "
                f"{', '.join(COLUMNS)}, of which robot and time may be left out"
            )
    jobs: list[Job] = []
    checked: set[Path] = set()
    for number, row in enumerate(rows.fillna("").to_dict("records"), start=2):
        where = f"{table}, line {number}"
        entry = {str(key): str(value).strip() for key, value in row.items()}
        recording, rig = folder / entry["recording"], table.parent / entry["rig"]
        if not entry["recording"] or not recording.exists():
            name = shown(entry["recording"])
            raise PamError(f"{where}: recording {name}: there is no such file or folder")
        if not rig.is_file():
            raise PamError(f"{where}: rig {shown(entry['rig'])}: there is no such file")
        if rig not in checked:
            load_rig(rig)
            checked.add(rig)
        time = entry.get("time", "")
        jobs.append(
            Job(
                entry["recording"],
                recording.resolve(),
                rig.resolve(),
                entry.get("robot", "") or rig.stem,
                read_date(time, f"{where}: time") if time else None,
            )
        )
    if not jobs:
        raise PamError(f"{table}: no recording in this table")
    for name, count in Counter(job.name for job in jobs).items():
        if count > 1:
            told = f"recording {shown(name)} appears in several lines; expected one"
            raise PamError(f"{table}: {told}")
    return jobs
