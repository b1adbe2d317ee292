"""Numbers, dates and times of day in a column of text.

Numbers may have their sign apart or marks between their thousands. Dates become seconds since 1970
(UTC where no zone is given), times of day seconds since midnight.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd

from pam_gap.recordings.recording import Array
from pam_gap.recordings.table_layout import MINUS
from pam_ros.foreign_text import shown

_TIME_OF_DAY: Final = r"(\d{1,2}):(\d{2}):(\d{2}(?:[.,:]\d+)?)(?: ?([aApP])\.?[mM]\.?)?"
_TWO_ORDERS: Final = rf"(\d{{1,2}})([/.])(\d{{1,2}})[/.](\d{{4}})[T ,]+{_TIME_OF_DAY}"
"""A date with the year behind it, which begins with the month or the day."""
_MONTHS: Final = "jan feb mar apr may jun jul aug sep oct nov dec".split()  # noqa: SIM905
"""As Matlab writes them, in `04-Mar-2026 12:00:01`."""
_DAY: Final = 86400.0


@dataclass(frozen=True, slots=True)
class Text:
    """The entries of a column that are no numbers."""

    count: int  # how many there are
    first: str  # the first of them
    row: int  # its row, from 1

    def __str__(self) -> str:
        return f"text such as {shown(self.first)} in row {self.row}"


def numbers_in(column: Any, decimal: str) -> tuple[Array, Text | None, str]:
    """A column as numbers, the entries that are none, and whether it is a "date" or "clock"."""
    kind = column.dtype
    if pd.api.types.is_datetime64_any_dtype(kind):
        return _since_1970(pd.to_datetime(column, utc=True)), None, "date"
    if pd.api.types.is_timedelta64_dtype(kind):
        return (column / pd.Timedelta(seconds=1)).to_numpy(np.float64, na_value=np.nan), None, ""
    if pd.api.types.is_numeric_dtype(kind):
        return column.to_numpy(dtype=np.float64, na_value=np.nan), None, ""
    there = column.notna().to_numpy(dtype=np.bool_)
    text = column.astype("string").str.strip().fillna("")
    text = text.str.replace(r"\s#.*$", "", regex=True).str.strip()  # a remark behind a row
    written = text.str.replace(rf"^[{MINUS}]\s*(?=[\d.,])", "-", regex=True)
    written = written.str.replace(r"^([-+])\s+(?=[\d.,])", r"\1", regex=True)
    written = _ungrouped(written, decimal)
    if decimal != ".":
        written = written.str.replace(decimal, ".", regex=False)
    written = written.str.replace(r"(?<=[\d.])[dD](?=[-+]?\d+$)", "e", regex=True)  # of Fortran
    values: Array = pd.to_numeric(written, errors="coerce").to_numpy(np.float64, na_value=np.nan)
    what = ""
    for kind_of, convert in (("clock", _times_of_day), ("date", _dates)):
        if not np.isfinite(values).any():
            values, what = convert(text), kind_of
    bad = np.flatnonzero(np.isnan(values) & there & (text.str.lower() != "nan").to_numpy(bool))
    if not bad.size:
        return values, None, what
    return values, Text(int(bad.size), str(text.iloc[bad[0]]), int(bad[0]) + 1), what


def _ungrouped(text: Any, decimal: str) -> Any:
    """Numbers without the marks between their thousands, where nothing else can be meant.

    A point or a comma is one only in a column in which the decimal mark follows, as in 1,234.5, or
    in which every number is a whole one with such marks where it is long enough, as 200,104.
    """
    other = "," if decimal == "." else r"\."
    point = re.escape(decimal)
    for mark, least in ((r"['\u2019\u00a0\u202f]", "*"), (other, "+")):
        thousands = rf"[-+]?\d{{1,3}}(?:{mark}\d{{3}})+"
        whole = text.str.fullmatch(rf"(?:[-+]?[1-9]\d{{0,2}}(?:{mark}\d{{3}})+|[-+]?\d{{1,3}}|)")
        marked = text.str.fullmatch(rf"{thousands}(?:{point}\d){least}\d*")
        if marked.any() or (whole.all() and text.str.contains(mark, regex=True).any()):
            grouped = text.str.fullmatch(rf"{thousands}(?:{point}\d*)?").to_numpy(bool)
            text = text.where(~grouped, text.str.replace(mark, "", regex=True))
    return text


def _times_of_day(text: Any) -> Array:
    """Seconds since midnight; NaN for what is no time of day."""
    parts = text.str.extract(f"^{_TIME_OF_DAY}$")
    return _seconds(*(parts[k] for k in range(4)))


def _seconds(hours: Any, minutes: Any, seconds: Any, half: Any) -> Array:
    """Seconds since midnight of the parts of times of day; `half` is a or p of 12 hours, or NA."""
    h, m, s = (
        pd.to_numeric(part.str.replace("[,:]", ".", regex=True), errors="coerce").to_numpy(
            np.float64, na_value=np.nan
        )
        for part in (hours, minutes, seconds)
    )
    letter = half.str.lower().fillna("").to_numpy(dtype=str)
    h = np.where(letter == "", h, h % 12.0 + 12.0 * (letter == "p"))
    values: Array = 3600.0 * h + 60.0 * m + s
    return values


def over_midnight(values: Array) -> Array:
    """Times of day, where no date says it, as seconds since the midnight before the first row."""
    known = np.flatnonzero(np.isfinite(values))
    midnights = np.diff(values[known]) < -0.5 * _DAY
    values[known[1:]] += _DAY * np.cumsum(midnights)
    return values


def _dates(text: Any) -> Array:
    """Seconds since 1970 of dates by ISO 8601, or with slashes or points; NaN for other text."""
    parts = text.str.extract(f"^{_TWO_ORDERS}$")
    if parts[0].notna().any():
        return _dates_of_two_orders(parts)
    named = text.str.replace(
        rf"^(\d{{1,2}})[- ]({'|'.join(_MONTHS)})[a-z]*[- ](\d{{4}})(?=\D|$)",
        lambda m: f"{m[3]}-{_MONTHS.index(m[2].lower()) + 1:>02}-{m[1]:>02}",
        regex=True, flags=re.IGNORECASE,
    )  # fmt: skip
    iso = named.str.replace(
        r"^(\d{4})[/.-](\d{1,2})[/.-](\d{1,2})(?=\D|$)",
        lambda m: f"{m[1]}-{m[2]:>02}-{m[3]:>02}", regex=True,
    ).str.replace(
        r"^(\d{1,2})\.(\d{1,2})\.(\d{4})(?=\D|$)",
        lambda m: f"{m[3]}-{m[2]:>02}-{m[1]:>02}", regex=True,
    ).str.replace(r"(:\d\d:\d\d)[,:](?=\d)", r"\1.", regex=True)  # fmt: skip
    return _since_1970(pd.to_datetime(iso, errors="coerce", utc=True, format="ISO8601"))


def _dates_of_two_orders(parts: Any) -> Array:
    """Seconds since 1970 of dates that begin with the day, as with points, or with the month.

    Of dates with slashes, both are tried; the order in which all are dates and the recording is
    shorter is taken, and the month before the day if both are alike.
    """
    days = []
    for day, month in ((0, 2), (2, 0)):
        iso = parts[3] + "-" + parts[month].str.zfill(2) + "-" + parts[day].str.zfill(2)
        date = pd.to_datetime(iso, errors="coerce", utc=True, format="%Y-%m-%d")
        days.append(_since_1970(date))
    day_first, month_first = days
    lost = [(int(np.isnan(one).sum()), _span(one)) for one in (month_first, day_first)]
    is_day_first = bool((parts[1] == ".").any()) or lost[1] < lost[0]
    date_of = day_first if is_day_first else month_first
    found: Array = date_of + _seconds(*(parts[k] for k in range(4, 8)))
    return found


def _span(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.max() - finite.min()) if finite.size else 0.0


def _since_1970(dates: Any) -> Array:
    since: Any = (dates - pd.Timestamp(0, tz="UTC")) / pd.Timedelta(seconds=1)
    seconds: Array = since.to_numpy(dtype=np.float64, na_value=np.nan)
    return seconds
