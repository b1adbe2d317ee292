"""Reads recordings that are tables: CSV, optionally compressed, Parquet, NPZ and MAT."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

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

ARRAYS = (".npz", ".mat")
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
            frame = pd.read_csv(path, comment="#")
    except (OSError, ValueError, EOFError, NotImplementedError, MatReadError) as error:
        raise RecordingError(f"{path}: not a readable table ({error})") from error
    frame.columns = [str(column).strip() for column in frame.columns]
    return frame


def read_arrays(path: Path) -> dict[str, Any]:
    """The numeric arrays of an NPZ or MAT file (up to version 7.2) as columns of equal length.

    A two-dimensional array gives one column for each of its own, named `name.0`, `name.1`, and so
    on. Arrays of other lengths than the longest are left out.

    Raises
    ------
    ValueError
        When it holds no such array.
    NotImplementedError
        For a MAT file of version 7.3, which is an HDF5 file.
    """
    columns: dict[str, Any] = {}
    if path.suffix.lower() == ".npz":
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    else:
        arrays = {n: v for n, v in loadmat(path).items() if not n.startswith("__")}
    for name, array in arrays.items():
        if not np.issubdtype(array.dtype, np.number) or array.ndim not in (1, 2):
            continue
        if array.ndim == 1 or 1 in array.shape:
            columns[name] = array.ravel()
        else:
            tall = array if array.shape[0] >= array.shape[1] else array.T
            columns |= {f"{name}.{k}": tall[:, k] for k in range(tall.shape[1])}
    longest = max((column.size for column in columns.values()), default=0)
    if longest < 2:
        raise ValueError("no array of numbers")
    return {name: column for name, column in columns.items() if column.size == longest}


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
    frame = _frame(path)
    if column_map is not None:
        numbers = {
            name: pd.to_numeric(frame[name], errors="coerce").to_numpy(dtype=np.float64)
            for name in frame.columns
        }
        mapped = column_map.apply(path, numbers)
        return from_columns(path, mapped.pop("time"), mapped, [f"read by {column_map.source}"])
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
        numbers = pd.to_numeric(frame[name], errors="coerce").to_numpy(dtype=np.float64)
        text = int(np.isnan(numbers).sum() - frame[name].isna().sum())
        if text:
            remarks.append(f"{name}: {text} entries are not numbers")
        if not np.isfinite(numbers).any():
            remarks.append(f"{name}: the column holds no number and is not used")
            continue
        columns[name] = numbers
    if "time" not in columns:
        raise RecordingError(f"{path}: column 'time' holds no number; expected seconds")
    time = columns.pop("time")
    if not columns:
        raise RecordingError(f"{path}: no channel of the rig contract beside 'time'")
    return from_columns(path, time, columns, remarks)
