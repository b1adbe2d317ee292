"""Reads recordings that are tables: CSV, optionally compressed, and Parquet."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

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

TABLES = (".csv", ".csv.gz", ".csv.bz2", ".csv.xz", ".csv.zst", ".parquet", ".pq")


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


def read_table(path: Path) -> RawRecording:
    """Read a table with a `time` column [s] and one column per channel of the rig contract.

    Raises
    ------
    RecordingError
        When the file cannot be read, has no usable `time`, or holds no channel of the contract.
    """
    try:
        frame: Any = (
            pd.read_parquet(path)
            if path.suffix.lower() in (".parquet", ".pq")
            else pd.read_csv(path, comment="#")
        )
    except (OSError, ValueError, EOFError) as error:
        raise RecordingError(f"{path}: not a readable table ({error})") from error
    frame.columns = [str(column).strip() for column in frame.columns]
    if "time" not in frame.columns:
        raise RecordingError(
            f"{path}: no column 'time' [s]; found {', '.join(frame.columns[:6]) or 'none'}"
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
