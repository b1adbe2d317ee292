"""Reads tables of text as laboratory programs write them, with any usual separator, packed or not.

The first lines tell the layout. A column of text may hold numbers with their sign apart, dates,
which become seconds since 1970 (UTC where no zone is given), or times of day, which become seconds
since midnight.
"""

from __future__ import annotations

import codecs
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from pam_gap.recordings.recording import Array
from pam_gap.recordings.table_layout import COMMENT, MINUS, find_layout, numbered, refuse_doubled
from pam_gap.recordings.unpacked import open_unpacked
from pam_model.table_dialect import encoding_of
from pam_ros.foreign_text import shown

_LINES: Final = 200
"""Lines that are looked at."""
_FEWEST_LINES, _ENOUGH = 4, 1 << 20
"""So many suffice if they have so many bytes, as with 100,000 columns."""
_LONGEST_LINE: Final = 1 << 24
"""Bytes in which a line must end."""
_TIME_OF_DAY: Final = r"(\d{1,2}):(\d{2}):(\d{2}(?:[.,:]\d+)?)(?: ?([aApP])\.?[mM]\.?)?"
_TWO_ORDERS: Final = rf"(\d{{1,2}})([/.])(\d{{1,2}})[/.](\d{{4}})[T ,]+{_TIME_OF_DAY}"
"""A date with the year behind it, which begins with the month or the day."""
_DAY: Final = 86400.0


@dataclass(frozen=True, slots=True)
class Text:
    """The entries of a column that are no numbers."""

    count: int  # how many there are
    first: str  # the first of them
    row: int  # its row, from 1

    def __str__(self) -> str:
        return f"text such as {shown(self.first)} in row {self.row}"


@dataclass(slots=True)
class Table:
    """The columns of a table as numbers, and what is to be known of them."""

    columns: dict[str, Array]  # shape (n,): the columns; NaN for what is no number
    texts: dict[str, Text] = field(default_factory=dict)  # what text is in columns, by name
    # units that stand below the names, as `bar` or `bar absolute`
    units: dict[str, str] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)  # what was not read

    @classmethod
    def of_frame(cls, frame: Any, decimal: str = ".") -> Table:
        """The columns of a data frame; of two with one name, ValueError is raised."""
        names = [str(name).strip() for name in frame.columns]
        refuse_doubled(names)
        table = cls(dict.fromkeys(names, np.zeros(0)))
        plain = [isinstance(kind, np.dtype) and kind.kind in "biuf" for kind in frame.dtypes]
        numeric = frame if all(plain) else frame.loc[:, plain]
        values = numeric.to_numpy(dtype=np.float64)  # at once: there may be 100,000
        table.columns |= dict(zip(np.array(names, dtype=object)[plain], values.T, strict=True))
        kinds: dict[str, str] = {}
        for place in np.flatnonzero(~np.array(plain, dtype=np.bool_)):
            name = names[place]
            table.columns[name], text, kind = _numbers(frame.iloc[:, place], decimal)
            kinds[name] = kind
            if text is not None:
                table.texts[name] = text
        if "date" not in kinds.values():
            for name in (name for name, kind in kinds.items() if kind == "clock"):
                table.columns[name] = _over_midnight(table.columns[name])
        return table


def _head(path: Path) -> tuple[list[str], str]:
    """The first lines, and the encoding of the file.

    Raises
    ------
    ValueError
        When it is no text, or its lines do not end.
    """
    with open_unpacked(path) as file:
        start = bytearray()
        for number in range(_LINES):
            line = file.readline(_LONGEST_LINE)
            if len(line) == _LONGEST_LINE:
                raise ValueError(f"line {number + 1} has no end within {_LONGEST_LINE} bytes")
            start += line
            if not line or (number > _FEWEST_LINES and len(start) > _ENOUGH):
                break
    encoding = encoding_of(bytes(start))
    text = codecs.getincrementaldecoder(encoding)(errors="replace").decode(bytes(start))
    return re.split(r"\r\n|\n|\r", text), encoding


def read_text_table(path: Path, rows: int | None = None, names: Sequence[str] = ()) -> Table:
    """A table of text, also packed.

    Parameters
    ----------
    path : Path
        The file; lines that begin with `#` or `%` are comments.
    rows : int, optional
        Rows that are read; all by default.
    names : sequence of str, optional
        Names of the columns of a table without names.

    Raises
    ------
    ValueError
        When it is no text, has no names or one name for two columns; OSError and others when it
        cannot be read, for a caller within `reading`.
    """
    lines, encoding = _head(path)
    layout = find_layout(lines, names)
    with open_unpacked(path) as file, warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", pd.errors.ParserWarning)
        frame: Any = pd.read_csv(
            file, header=None, names=range(len(layout.names)), skiprows=layout.first,
            sep=layout.between or r"\s+", decimal=layout.decimal,
            encoding=encoding, encoding_errors="replace", skipinitialspace=True, nrows=rows,
            index_col=False, on_bad_lines="warn", low_memory=False,
        )  # fmt: skip
    frame = _without_comments(frame)
    # a column without a name is used by nobody
    if not all(layout.names):
        frame = frame.loc[:, [bool(name) for name in layout.names]]
    unique = numbered(layout.names)
    frame.columns = [name for name in unique if name]
    table = Table.of_frame(frame, layout.decimal)
    table.units = layout.units
    _leave_out_doubled(table, dict(zip(unique, layout.names, strict=True)))
    long = re.findall(r"Skipping line (\d+): expected", "".join(str(w.message) for w in told))
    if long:
        table.remarks.append(
            f"{path.name}: {len(long)} lines, the first of them line {long[0]}, have more than "
            f"{len(layout.names)} columns and are not used"
        )
    return table


def _leave_out_doubled(table: Table, original: dict[str, str]) -> None:
    """Keep one of two columns with the same name and the same numbers, as a time of each channel.

    `original` has the name that each column has in the file.
    """
    doubled = [name for name in table.columns if name != original[name]]
    for name in doubled:
        first = original[name]
        if not np.array_equal(table.columns[name], table.columns[first], equal_nan=True):
            refuse_doubled([first, first])
        del table.columns[name]
        table.texts.pop(name, None)


def _without_comments(frame: Any) -> Any:
    """The rows that do not begin with a mark of a comment, which words such as 1.#IND contain."""
    first = frame.iloc[:, 0]
    if pd.api.types.is_numeric_dtype(first.dtype):
        return frame
    return frame.loc[~first.astype("string").str.startswith(COMMENT).fillna(False).to_numpy(bool)]


def _numbers(column: Any, decimal: str) -> tuple[Array, Text | None, str]:
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

    A point or a comma is one only in a column in which the decimal mark follows, as in 1,234.5.
    """
    other = "," if decimal == "." else r"\."
    point = re.escape(decimal)
    for mark, least in ((r"['\u2019\u00a0\u202f]", "*"), (other, "+")):
        thousands = rf"[-+]?\d{{1,3}}(?:{mark}\d{{3}})+"
        if text.str.fullmatch(rf"{thousands}(?:{point}\d){least}\d*").any():
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


def _over_midnight(values: Array) -> Array:
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
    iso = text.str.replace(
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
