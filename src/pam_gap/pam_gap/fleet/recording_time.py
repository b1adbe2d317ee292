"""When a recording was made: by its stamps, by the table of rigs, or by the time of its file."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from pam_gap.recordings.broken_bag import beginning, read_bag
from pam_gap.recordings.import_csv import is_table, read_columns
from pam_gap.recordings.import_recording import is_bag
from pam_model.errors import PamError
from pam_ros.foreign_text import shown

EARLIEST = datetime(2000, 1, 1, tzinfo=UTC).timestamp()
"""A stamp before this is no date but the time since some start [s]."""
STAMPS, TABLE, FILE = "stamps", "table", "file"
"""The sources of a time, best first."""


@dataclass(frozen=True, slots=True)
class RecordingTime:
    """When a recording was made."""

    seconds: float  # unix time [s]
    source: str  # `STAMPS`, `TABLE` or `FILE`


def read_date(text: str, where: str) -> float:
    """Unix time [s] of a date or a date with time, ISO 8601; UTC if it names no time zone.

    Raises
    ------
    PamError
        When the text is no date; `where` says where it stands.
    """
    try:
        found = datetime.fromisoformat(text.strip())
    except ValueError:
        expected = "expected ISO 8601, as 2026-03-31"
        raise PamError(f"{where}: {shown(text)} is no date; {expected}") from None
    return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()


def first_stamp(path: Path) -> float | None:
    """The first stamp of a bag or table as Unix time [s]; None if it is no date or unreadable.

    Whatever is wrong with the recording is reported when it is diagnosed.
    """
    try:
        if is_bag(path):
            stamp, _ = read_bag(path, beginning)
        elif is_table(path):
            stamp = float(read_columns(path, rows=1).columns["time"][0])
        else:
            return None
    except (PamError, KeyError, IndexError):
        return None
    return stamp if np.isfinite(stamp) and stamp >= EARLIEST else None


def time_of(path: Path, stated: float | None = None) -> RecordingTime:
    """When a recording was made.

    Parameters
    ----------
    path : Path
        A bag or a table.
    stated : float, optional
        Unix time in the table of rigs, which counts if the stamps are no dates.
    """
    stamp = first_stamp(path)
    if stamp is not None:
        return RecordingTime(stamp, STAMPS)
    if stated is not None:
        return RecordingTime(stated, TABLE)
    files = [p for p in path.rglob("*") if p.is_file()] if path.is_dir() else []
    return RecordingTime(max(p.stat().st_mtime for p in [*files, path]), FILE)
