"""Which column of a log is the time, in which unit, and which columns hold the rest of it.

Loggers write a time as one column, or as whole seconds with a fraction or a date in others.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

import numpy as np

from pam_gap.import_log.column_name import WORDS, ColumnName
from pam_gap.recordings.name_words import words_of
from pam_gap.recordings.plausible_units import LONGEST_STEP, SHORTEST_STEP
from pam_gap.recordings.recording import Array
from pam_model.unit_hints import RECORDED, units_that_fit

KIND: Final = 2.0
"""What a word of the kind of a channel counts."""
_FRACTIONS: Final = {
    **dict.fromkeys(("ms", "msec", "msecs", "millis", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "usec", "usecs", "micros", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds"), 1e-9),
}
"""Last words of columns that hold the rest of a time in whole seconds, and their unit [s]."""
_SECONDS: Final = frozenset(["sec", "secs", "seconds"])
_DAY: Final = 86400.0
_EPOCH: Final = (1e9, 2.5e9)
"""Seconds since 1970, from 2001 to 2049."""
_OF_EPOCH: Final = (("", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9))
_LONG_STEP: Final = 3600.0
"""Between two rows [s]; numbers like those of an epoch with longer steps are in another unit."""


def unit_of_time(column: ColumnName, values: Array) -> str:
    """The unit in which a time has the steps of a logger; empty for seconds or an unknown one."""
    if column.words & _SECONDS:
        return ""
    stamps = np.unique(values)
    step = float(np.median(np.diff(stamps))) if stamps.size > 1 else 0.0
    if stamps.size < 0.5 * values.size:  # written with few digits: several rows have one stamp
        step *= stamps.size / values.size
    for unit, factor in _OF_EPOCH:
        low, high = (factor * end for end in _EPOCH)
        if stamps.size and low <= stamps[0] <= stamps[-1] <= high and step <= _LONG_STEP * factor:
            return unit
    if SHORTEST_STEP <= step <= LONGEST_STEP:
        return ""
    fitting = units_that_fit(step, "s", SHORTEST_STEP, LONGEST_STEP, RECORDED)
    return next((unit for unit, factor in fitting if factor < 1.0), "")


def time_score(column: ColumnName, values: Array, is_first: bool) -> float:
    """How well a column fits the time: by its name, or as the first, which rises evenly."""
    named = len(column.words & WORDS["time"])
    values = values[np.isfinite(values)]
    steps = np.diff(values)
    if not column.is_of("s") or (values.size and np.all(values % _DAY == 0.0) and values[-1]):
        return 0.0  # a date alone is no time
    if named:
        return KIND * named + float(np.all(steps >= 0.0))
    if not is_first or steps.size < 2:
        return 0.0
    is_even = bool(np.all(np.abs(steps - steps[0]) <= 0.01 * abs(steps[0])))
    return 0.5 * (is_even and steps[0] > 0.0 and abs(steps[0] - 1.0) > 0.01)  # not row numbers


def rest_of_time(columns: Mapping[str, Array], time: str) -> tuple[tuple[str, float], ...]:
    """The columns that a time in whole seconds lacks: the date, and the fraction of a second."""
    values = columns[time][np.isfinite(columns[time])]
    if np.any(values != np.round(values)) or np.unique(values).size > 0.5 * values.size:
        return ()
    rest = [
        (name, unit) for name, column in columns.items()
        if (unit := _fraction(name, time)) is not None
        and np.nanmin(column) >= 0.0 and np.nanmax(column) * unit < 1.0
    ]  # fmt: skip
    dates = [
        (name, 1.0) for name, column in columns.items()
        if name != time and {"date", "datum"} & set(words_of(name))
        and np.nanmax(column) > 1e3 * _DAY and np.nanmax(values) < 2.0 * _DAY
    ]  # fmt: skip
    return (*dates[:1], *rest[:1]) if rest else ()


def _fraction(name: str, time: str) -> float | None:
    """The unit [s] of a column that holds the fraction of a second of a time; None for others.

    Both have the same words before the unit, as `stamp.sec` and `stamp.nanosec`.
    """
    before, word = _last_word(name)
    return _FRACTIONS.get(word.lower()) if before in ("", _last_word(time)[0]) else None


def _last_word(name: str) -> tuple[str, str]:
    """The last word of a name, and what stands before it."""
    found = re.search(r"[A-Za-z]+\W*$", name)
    if found is None:
        return name, ""
    return name[: found.start()], found[0].strip()
