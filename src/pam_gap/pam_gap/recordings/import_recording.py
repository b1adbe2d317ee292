"""Reads a recording of any supported format."""

from __future__ import annotations

from pathlib import Path

from pam_gap.recordings.column_map import ColumnMap
from pam_gap.recordings.import_csv import TABLES, is_table, read_table
from pam_gap.recordings.import_rosbag import is_rosbag, read_rosbag
from pam_gap.recordings.recording import Recording, RecordingError, resample


def import_recording(
    path: str | Path, step: float | None = None, column_map: ColumnMap | None = None
) -> Recording:
    """Read a rosbag2 (MCAP, SQLite), CSV, Parquet, NPZ or MAT recording onto an even time grid.

    Parameters
    ----------
    path : str or Path
        A bag's folder or file, a table, or a folder that holds one `recording.*` table.
    step : float, optional
        Step of the grid [s]; default is the period of the fastest channel.

    column_map : ColumnMap, optional
        The columns of the channels, for tables with other names or units; bags need none.

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
        return resample(read_table(place, column_map), step)
    if place.is_dir():
        tables = [child for child in sorted(place.glob("recording*")) if is_table(child)]
        if len(tables) == 1:
            return resample(read_table(tables[0], column_map), step)
    raise RecordingError(
        f"{place}: not a recording; expected a rosbag2 folder, .mcap, .db3 or one of "
        f"{', '.join(TABLES)}"
    )
