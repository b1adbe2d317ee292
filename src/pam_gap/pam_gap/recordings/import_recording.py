"""Reads a recording of any supported format."""

from __future__ import annotations

from pathlib import Path

from pam_gap.recordings.bag_columns import read_bag_columns
from pam_gap.recordings.broken_bag import ROSBAG1
from pam_gap.recordings.column_map import ColumnMap
from pam_gap.recordings.import_csv import TABLES, is_table, read_table
from pam_gap.recordings.import_rosbag import is_rosbag, read_rosbag
from pam_gap.recordings.recording import RawRecording, Recording, RecordingError
from pam_gap.recordings.resample import resample


def is_bag(path: Path) -> bool:
    """Whether the path is a rosbag2 or a rosbag1."""
    return is_rosbag(path) or (path.is_file() and path.suffix == ROSBAG1)


def import_recording(
    path: str | Path, step: float | None = None, column_map: ColumnMap | None = None
) -> Recording:
    """Read a bag or a table onto an even time grid.

    Parameters
    ----------
    path : str or Path
        A bag's folder or file (rosbag2 in MCAP or SQLite, rosbag1), a table (CSV, Parquet, NPZ,
        MAT, HDF5, JSON), or a folder that holds one `recording.*` table.
    step : float, optional
        Step of the grid [s]; default is the period of the fastest channel.
    column_map : ColumnMap, optional
        The columns of the channels, for logs with other names or units than the rig contract's.

    Raises
    ------
    RecordingError
        When the file does not exist, its format is not supported, or it holds too few samples.
    """
    return resample(read_raw(Path(path), column_map), step)


def read_raw(place: Path, column_map: ColumnMap | None = None) -> RawRecording:
    """Read a bag or a table as it was logged; parameters and errors as `import_recording`."""
    if not place.exists():
        raise RecordingError(f"{place}: no such recording")
    if is_bag(place):
        if column_map is None:
            return read_rosbag(place)
        columns, remarks = read_bag_columns(place, column_map.columns)
        channels = column_map.apply_to_bag(place, columns)
        return RawRecording(place, channels, [*remarks, f"read by {column_map.source}"])
    if is_table(place):
        return read_table(place, column_map)
    if place.is_dir():
        tables = [child for child in sorted(place.glob("recording*")) if is_table(child)]
        if len(tables) == 1:
            return read_table(tables[0], column_map)
    raise RecordingError(
        f"{place}: not a recording; expected a rosbag2 folder, .mcap, .db3, .bag or one of "
        f"{', '.join(TABLES)}"
    )
