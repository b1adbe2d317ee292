"""Reads recordings that are tables: CSV, optionally compressed, Parquet, and files of arrays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.io.matlab import MatReadError

from pam_gap.recordings.array_files import ARRAYS, read_arrays
from pam_gap.recordings.column_map import ColumnMap
from pam_gap.recordings.recording import (
    COMMANDS,
    JOINTS,
    MUSCLES,
    PRESSURES,
    SUPPLY,
    RawRecording,
    RecordingError,
    from_columns,
)
from pam_gap.recordings.text_table import numbers, read_text_table, text_in

TABLES = (
    ".csv", ".csv.gz", ".csv.bz2", ".csv.xz", ".csv.zst", ".parquet", ".pq", *ARRAYS,
)  # fmt: skip


def is_table(path: Path) -> bool:
    """Whether the file has an ending that this module can read."""
    return path.is_file() and path.name.lower().endswith(TABLES)


def known_channel(name: str) -> bool:
    """Whether the name of a column is a channel of the rig contract."""
    return name == SUPPLY or (
        name.startswith((COMMANDS, PRESSURES))
        or (name.startswith(JOINTS) and name.endswith((".position", ".effort")))
        or (name.startswith(MUSCLES) and name.endswith((".effort", ".position")))
    )


def read_columns(path: Path) -> dict[str, Any]:
    """All columns of a table as numbers; entries that are no numbers become NaN.

    Raises
    ------
    RecordingError
        When the file cannot be read.
    """
    frame = _frame(path)
    return {name: numbers(frame[name]) for name in frame.columns}


def _frame(path: Path) -> Any:
    """The table as a data frame with stripped names.

    Raises
    ------
    RecordingError
        When the file cannot be read.
    """
    try:
        if path.suffix.lower() in ARRAYS:
            frame: Any = pd.DataFrame(read_arrays(path))
        elif path.suffix.lower() in (".parquet", ".pq"):
            frame = pd.read_parquet(path)
        else:
            frame = read_text_table(path)
    except (OSError, ValueError, EOFError, NotImplementedError, MatReadError) as error:
        reason = " ".join(str(error).split())
        raise RecordingError(f"{path}: not a readable table ({reason})") from error
    frame.columns = [str(column).strip() for column in frame.columns]
    return frame


def read_table(path: Path, column_map: ColumnMap | None = None) -> RawRecording:
    """Read a table with a `time` column [s] and one column per channel of the rig contract.

    Parameters
    ----------
    path : Path
        The table.
    column_map : ColumnMap, optional
        The columns of the channels, for a table with other names or units.

    Raises
    ------
    RecordingError
        When the file cannot be read, has no usable `time`, or holds no channel of the contract.
    """
    if column_map is not None:
        mapped = column_map.apply(path, read_columns(path))
        if not np.isfinite(mapped["time"]).any():
            raise RecordingError(
                f"{path}: the column of the time holds no number; expected seconds, or `unit` in "
                f"{column_map.source}"
            )
        return from_columns(path, mapped.pop("time"), mapped, [f"read by {column_map.source}"])
    frame = _frame(path)
    if "time" not in frame.columns:
        raise RecordingError(
            f"{path}: no column 'time' [s]; found {', '.join(frame.columns[:6]) or 'none'}; "
            "name the columns with --map"
        )
    remarks: list[str] = []
    columns: dict[str, Any] = {}
    for name in frame.columns:
        if name != "time" and not known_channel(name):
            remarks.append(f"{name}: not a channel of the rig contract, so it is not used")
            continue
        values = numbers(frame[name])
        text = int(np.isnan(values).sum() - frame[name].isna().sum())
        if text:
            remarks.append(f"{name}: {text} entries are not numbers")
        if not np.isfinite(values).any():
            remarks.append(f"{name}: the column holds no number and is not used")
            continue
        columns[name] = values
    if "time" not in columns:
        raise RecordingError(
            f"{path}: column 'time' holds no number{text_in(frame['time'])}; expected seconds"
        )
    time = columns.pop("time")
    if not columns:
        raise RecordingError(f"{path}: no channel of the rig contract beside 'time'")
    return from_columns(path, time, columns, remarks)
