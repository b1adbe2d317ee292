"""Reads recordings that are tables: text, also packed, Parquet, and files of arrays."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from pam_gap.recordings.array_files import ARRAYS, read_arrays
from pam_gap.recordings.array_process import APART, read_arrays_apart
from pam_gap.recordings.column_map import ColumnMap
from pam_gap.recordings.name_words import roles_of
from pam_gap.recordings.recording import (
    COMMANDS,
    JOINTS,
    MUSCLES,
    PRESSURES,
    SUPPLY,
    RawRecording,
    RecordingError,
    from_columns,
    is_name,
)
from pam_gap.recordings.size_limits import Allowance
from pam_gap.recordings.text_table import Table, read_text_table
from pam_gap.recordings.unpacked import PACKINGS
from pam_model.errors import Reasons
from pam_model.reading import reading
from pam_ros.foreign_text import all_shown, shown

TEXTS: Final = tuple(
    f"{kind}{packing}"
    for kind in (".csv", ".txt", ".tsv", ".dat", ".lvm", ".asc")
    for packing in ("", *PACKINGS)
)
PARQUET: Final = (".parquet", ".pq")
TABLES: Final = (*TEXTS, *PARQUET, *ARRAYS)
"""Endings of the files that this module reads."""


def is_table(path: Path) -> bool:
    """Whether the file has an ending that this module can read."""
    return path.is_file() and path.name.lower().endswith(TABLES)


def known_channel(name: str) -> bool:
    """Whether the name of a column is a channel of the rig contract."""
    return name == SUPPLY or (
        is_name(name)
        and (
            name.startswith((COMMANDS, PRESSURES))
            or (name.startswith(JOINTS) and name.endswith((".position", ".effort")))
            or (name.startswith(MUSCLES) and name.endswith((".effort", ".position")))
        )
    )


def read_columns(path: Path, rows: int | None = None, names: Sequence[str] = ()) -> Table:
    """All columns of a table as numbers; entries that are no numbers become NaN.

    Parameters
    ----------
    rows : int, optional
        Rows that are read of a table of text; all by default.
    names : sequence of str, optional
        Names of the columns of a table of text that has none.

    Raises
    ------
    RecordingError
        When the file cannot be read.
    """
    with reading(path, "a readable table", RecordingError):
        if names and path.suffix.lower() in (*ARRAYS, *PARQUET):
            raise ValueError("its columns have names; expected no `names` in the map")
        if path.suffix.lower() in ARRAYS:
            read = read_arrays_apart if path.suffix.lower() in APART else read_arrays
            arrays = {name.strip(): _real(array) for name, array in read(path).items()}
            if roles_of(list(arrays)) or any(array.dtype == object for array in arrays.values()):
                return Table.of_frame(pd.DataFrame(arrays))
            return Table(arrays)
        if path.suffix.lower() in PARQUET:
            return Table.of_frame(_parquet(path))
        return read_text_table(path, rows, names)


def _real(array: Any) -> Any:
    if np.iscomplexobj(array):
        raise ValueError("an array of complex numbers")
    return array if array.dtype == object else np.asarray(array, dtype=np.float64)


def _parquet(path: Path) -> Any:
    import pyarrow.parquet as pq  # noqa: PLC0415  (optional)

    about = pq.read_metadata(path)
    left = Allowance()
    left.take((about.num_rows, about.num_columns), 8, "the table")
    for group in range(about.num_row_groups):
        left.take((about.row_group(group).total_byte_size,), 1, f"row group {group}")
    return pd.read_parquet(path)


def read_table(path: Path, column_map: ColumnMap | None = None) -> RawRecording:
    """Read a table with a `time` column [s] and one column per channel of the rig contract.

    Parameters
    ----------
    column_map : ColumnMap, optional
        The columns of the channels, for a table with other names or units.

    Raises
    ------
    RecordingError
        When the file cannot be read, has no usable `time`, holds no channel of the contract, or a
        column that the map names holds no number.
    """
    table = read_columns(path, names=column_map.names if column_map else ())
    remarks = list(table.remarks)
    if column_map is not None:
        reasons = Reasons(RecordingError)
        with reasons.gathered():
            column_map.refuse_missing(path, table.columns)
        with reasons.gathered():
            _refuse_without_numbers(path, table, column_map)
        reasons.refuse()
        mapped = column_map.apply(path, table.columns)
        remarks += [f"{shown(n)}: {_entries(table, n)}" for n in sorted(column_map.columns)
                    if n in table.texts]  # fmt: skip
        time = mapped.pop("time")
        remarks.append(f"read by {column_map.source}")
        return from_columns(path, time, mapped, remarks, one_clock=table.one_clock)
    if "time" not in table.columns:
        raise RecordingError(
            f"{path}: no column 'time' [s]; found {all_shown(table.columns) or 'none'}; "
            "name the columns with --map"
        )
    columns: dict[str, Any] = {}
    for name, values in table.columns.items():
        if name != "time" and not known_channel(name):
            remarks.append(f"{shown(name)}: not a channel of the rig contract, so it is not used")
        elif name != "time" and not np.isfinite(values).any():
            remarks.append(f"{name}: {_without_numbers(table, name)} and is not used")
        else:
            columns[name] = values
            if name in table.texts:
                remarks.append(f"{name}: {_entries(table, name)}")
    time = columns.pop("time")
    if not np.isfinite(time).any():
        raise RecordingError(
            f"{path}: column 'time' {_without_numbers(table, 'time')}; expected seconds"
        )
    if not columns:
        raise RecordingError(f"{path}: no channel of the rig contract except 'time'")
    return from_columns(path, time, columns, remarks, one_clock=table.one_clock)


def _entries(table: Table, name: str) -> str:
    return f"{table.texts[name].count} entries are not numbers but {table.texts[name]}"


def _without_numbers(table: Table, name: str) -> str:
    text = table.texts.get(name)
    return "holds no number" + (f" but {text}" if text else "")


def _refuse_without_numbers(path: Path, table: Table, column_map: ColumnMap) -> None:
    """Refuse a map that names columns without a number, and say what they hold instead."""
    named = [name for name in sorted(column_map.columns) if name in table.columns]
    empty = [name for name in named if not np.isfinite(table.columns[name]).any()]
    if empty:
        told = "; ".join(f"column {shown(n)} {_without_numbers(table, n)}" for n in empty[:3])
        more = f"; {len(empty) - 3} more columns" if len(empty) > 3 else ""
        raise RecordingError(
            f"{path}: {told}{more}; expected numbers, dates or times of day in what "
            f"{column_map.source} names"
        )
