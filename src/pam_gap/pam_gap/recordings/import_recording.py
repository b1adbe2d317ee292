"""Reads a recording of any supported format."""

from __future__ import annotations

from pathlib import Path

from pam_gap.recordings.import_csv import TABLES, is_table, read_table
from pam_gap.recordings.import_rosbag import is_rosbag, read_rosbag
from pam_gap.recordings.recording import Recording, RecordingError, resample


def import_recording(path: str | Path, step: float | None = None) -> Recording:
    """Read a rosbag2 (MCAP, SQLite), CSV or Parquet recording onto a uniform time grid.

    Parameters
    ----------
    path : str or Path
        A bag's folder or file, a table, or a folder that holds one `recording.*` table.
    step : float, optional
        Step of the grid [s]; default is the period of the fastest channel.

    Raises
    ------
    RecordingError
        When the file does not exist, its format is not supported, or it holds too few samples.
    """
    place = Path(path)
    if not place.exists():
        raise RecordingError(f"{place}: no such recording")
    if is_rosbag(place):
        return resample(read_rosbag(place), step)
    if is_table(place):
        return resample(read_table(place), step)
    if place.is_dir():
        tables = [child for child in sorted(place.glob("recording*")) if is_table(child)]
        if len(tables) == 1:
            return resample(read_table(tables[0]), step)
    raise RecordingError(
        f"{place}: not a recording; expected a rosbag2 folder, .mcap, .db3 or one of "
        f"{', '.join(TABLES)}"
    )
