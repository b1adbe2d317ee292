"""Turns a long table, with one row for each sample of each signal, into one column per signal.

Databases and loggers of a bus write tables in this way: `time, signal, value`, or with the muscle
in a column: `time, muscle, pressure, command`. A row of the result holds the signals that have
exactly one time, and NaN for the others. Nothing is held or interpolated here: `resample` does so
with the samples of each signal, as with the topics of a bag.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from pam_gap.recordings.cell_numbers import Text, numbers_in, over_midnight
from pam_gap.recordings.name_words import Roles, roles_of
from pam_gap.recordings.recording import Array
from pam_gap.recordings.size_limits import Allowance
from pam_gap.recordings.table_layout import refuse_doubled
from pam_ros.foreign_text import all_shown, shown

_FEWEST: Final = 4.0
"""Rows for each name, on average; with fewer, a column is no name but a remark or a count."""
_OFTEN: Final = 0.1
"""Share of the rows, in the order of time, at which a name changes; a state changes rarely."""
_MOSTLY: Final = 0.9
"""Share of the rows that have a time and a name."""
_ENOUGH: Final = 16
"""Rows of a signal that tell how often something changes."""
_MOST_NUMBERS: Final = 64
"""Numbers that may stand for names; a measurement has more different ones."""


@dataclass(frozen=True, slots=True)
class Wide:
    """A long table with one column per signal."""

    columns: dict[str, Array]  # shape (n,): time columns, and signals; NaN where none has a sample
    texts: dict[str, Text]  # what text is in the signals
    one_clock: bool  # whether every signal has a sample in every row
    remarks: list[str]  # what was not read


def wide_of(frame: Any, decimal: str = ".") -> Wide | None:
    """A long table with one column per signal; None for a table of another kind.

    Parameters
    ----------
    frame : DataFrame
        The table, with text as text.
    decimal : str
        The decimal mark of numbers that are text.

    Raises
    ------
    ValueError
        When one signal has several units, or the columns do not fit into the memory.
    """
    roles = roles_of([str(name) for name in frame.columns])
    if roles is None:
        return None
    times = _times(frame, roles, decimal)
    if not times:
        return None
    stamped = np.all([np.isfinite(column) for column in times.values()], axis=0)
    named = (frame[list(roles.keys)].astype("string").fillna("") != "").any(axis=1).to_numpy(bool)
    if named.sum() < _MOSTLY * stamped.sum():
        return None
    rows = np.flatnonzero(stamped & named)
    order = rows[np.lexsort([column[rows] for column in reversed(list(times.values()))])]
    keys = [name for name in roles.keys if _may_name(frame[name].iloc[order])]
    if not keys or (not roles.values and not _alternates(frame, keys, times, order)):
        return None
    keys += [name for name in roles.rest if _is_part_of_name(frame, name, keys, order)]
    if len(frame[keys].iloc[order].drop_duplicates()) < 2:
        return None
    signals = _signals(frame, keys, roles, order)
    quantities = list(roles.values or [name for name in roles.rest if name not in keys])
    return _spread(frame, order, signals, times, quantities, decimal)


def _times(frame: Any, roles: Roles, decimal: str) -> dict[str, Array]:
    """The times of the rows, in the columns in which most rows have one."""
    read = {name: numbers_in(frame[name], decimal) for name in roles.time}
    counts = {name: int(np.isfinite(values).sum()) for name, (values, _, _) in read.items()}
    is_dated = any(kind == "date" for _, _, kind in read.values())
    return {
        name: over_midnight(values) if kind == "clock" and not is_dated else values
        for name, (values, _, kind) in read.items()
        if counts[name] > _MOSTLY * max(counts.values())
    }


def _may_name(column: Any) -> bool:
    """Whether a column holds names, or few whole numbers in their place."""
    if not column.size or column.nunique() * _FEWEST > column.size:
        return False
    if not pd.api.types.is_numeric_dtype(column.dtype):
        return True
    numbers = column.dropna().unique()
    return bool(numbers.size <= _MOST_NUMBERS and np.all(numbers == np.round(numbers)))


def _changes(column: Any) -> float:
    """The share of rows whose entry differs from that of the row before."""
    codes = pd.factorize(column)[0]
    return float(np.mean(codes[1:] != codes[:-1])) if codes.size > 1 else 0.0


def _alternates(frame: Any, keys: list[str], times: Mapping[str, Array], order: Any) -> bool:
    """Whether the names change from row to row, and numbers among them at one time."""
    if any(pd.api.types.is_numeric_dtype(frame[name].dtype) for name in keys):
        stamps = pd.DataFrame({name: column[order] for name, column in times.items()})
        each = pd.concat([stamps, frame[keys].iloc[order].reset_index(drop=True)], axis=1)
        if each.duplicated().any() or not stamps.duplicated().mean() > _OFTEN:
            return False
    return max(_changes(frame[name].iloc[order]) for name in keys) > _OFTEN


def _is_part_of_name(frame: Any, name: str, keys: list[str], order: Any) -> bool:
    """Whether a text differs between signals of one name, such as a tag of a database."""
    column = frame[name].iloc[order]
    if pd.api.types.is_numeric_dtype(column.dtype) or not _may_name(column):
        return False
    if not numbers_in(column.drop_duplicates().astype("string"), ".")[1]:
        return False
    within = frame[keys].iloc[order].astype("string").fillna("").agg(".".join, axis=1)
    parts = (part for _, part in column.groupby(within.to_numpy()) if part.size >= _ENOUGH)
    return any(_changes(part) > _OFTEN for part in parts)


def _signals(frame: Any, keys: list[str], roles: Roles, order: Any) -> list[str]:
    """The name of the signal of each row, with its unit in brackets."""
    parts = [_words(frame[name].iloc[order], name) for name in keys]
    joined = [".".join(filter(None, row)) for row in zip(*parts, strict=True)]
    if not roles.unit:
        return joined
    units = frame[roles.unit[0]].iloc[order].astype("string").str.strip().fillna("")
    of_signal: dict[str, set[str]] = {}
    for signal, unit in set(zip(joined, units, strict=True)):
        of_signal.setdefault(signal, set()).update({unit} - {""})
    for signal, several in of_signal.items():
        if len(several) > 1:
            raise ValueError(
                f"signal {shown(signal)} has the units {all_shown(sorted(several))}; expected one"
            )
    whole = {name: " ".join((name, *(f"[{unit}]" for unit in own)))
             for name, own in of_signal.items()}  # fmt: skip
    return [whole[name] for name in joined]


def _words(column: Any, name: str) -> list[str]:
    """The entries of a column as words; a number gets the name of the column before it."""
    if pd.api.types.is_numeric_dtype(column.dtype):
        return [f"{name.strip('_')}{number:g}" if pd.notna(number) else "" for number in column]
    return list(column.astype("string").str.strip().fillna(""))


def _spread(
    frame: Any,
    order: Any,
    signals: list[str],
    times: Mapping[str, Array],
    quantities: list[str],
    decimal: str,
) -> Wide:
    """One column per signal and quantity, and one row for each time.

    Samples of one signal with one time get rows of their own, of which `resample` keeps the first.
    """
    stamps = pd.DataFrame({name: column[order] for name, column in times.items()})
    stamps["repeat"] = stamps.assign(signal=signals).groupby([*times, "signal"]).cumcount()
    rows = stamps.groupby([*times, "repeat"], sort=True).ngroup().to_numpy()
    count = int(rows.max()) + 1
    places: Mapping[Hashable, Any] = pd.Series(np.arange(rows.size)).groupby(signals).indices
    left = Allowance()
    columns: dict[str, Array] = {}
    for name, column in times.items():
        columns[name] = np.empty(count)
        columns[name][rows] = column[order]
    texts: dict[str, Text] = {}
    present: set[int] = set()
    for signal, at in places.items():
        read = {}
        for quantity in quantities:
            entries = frame[quantity].iloc[order[at]]
            values, text, _ = numbers_in(entries.infer_objects(), decimal)
            if np.isfinite(values).any() or text is not None:
                read[quantity] = values, text
        numeric = [name for name, (values, _) in read.items() if np.isfinite(values).any()]
        for quantity, (values, text) in read.items():
            if numeric and quantity not in numeric:
                continue  # a remark beside the numbers
            name = _name_of(str(signal), quantity, alone=len(quantities) == 1)
            refuse_doubled([name] * (1 + (name in columns)))
            left.take((count,), 8, f"signal {shown(name)}")
            columns[name] = np.full(count, np.nan)
            columns[name][rows[at]] = values
            if quantity in numeric:
                present.add(int(np.unique(rows[at]).size))
            if text is not None:
                texts[name] = Text(text.count, text.first, int(order[at[text.row - 1]]) + 1)
    lost = len(frame) - order.size
    remarks = [f"{lost} rows have no time or name and are not used"] if lost else []
    return Wide(columns, texts, present == {count}, remarks)


def _name_of(signal: str, quantity: str, *, alone: bool) -> str:
    """The name of a column: that of the signal, with the quantity unless there is only one."""
    if not alone:
        return f"{signal}.{quantity}"
    bracket = re.search(r"[\[(][^\])]+[\])]\s*$", quantity)
    return f"{signal} {bracket[0]}" if bracket and not signal.endswith("]") else signal
