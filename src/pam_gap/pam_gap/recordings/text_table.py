"""Reads tables of text as laboratory programs write them, with any usual separator, packed or not.

The first lines tell the layout. A column of text may hold numbers with their sign apart, dates,
which become seconds since 1970 (UTC where no zone is given), or times of day, which become seconds
since midnight.
"""

from __future__ import annotations

import codecs
import re
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from pam_gap.recordings.recording import Array
from pam_gap.recordings.table_layout import find_layout, refuse_doubled
from pam_gap.recordings.unpacked import open_unpacked
from pam_model.table_dialect import encoding_of
from pam_ros.foreign_text import shown

_LINES: Final = 200
"""Lines that are looked at."""
_FEWEST_LINES, _ENOUGH = 4, 1 << 20
"""So many suffice if they have so many bytes, as with 100,000 columns."""
_LONGEST_LINE: Final = 1 << 24
"""Bytes in which a line must end."""
_TIME_OF_DAY: Final = r"(\d{1,2}):(\d{2}):(\d{2}(?:[.,:]\d+)?)"
_DAY: Final = 86400.0


@dataclass(frozen=True, slots=True)
class Text:
    """The entries of a column that are no numbers.

    Attributes
    ----------
    count : int
        How many there are.
    first : str
        The first of them.
    row : int
        Its row, from 1.
    """

    count: int
    first: str
    row: int

    def __str__(self) -> str:
        return f"text such as {shown(self.first)} in row {self.row}"


@dataclass(slots=True)
class Table:
    """The columns of a table as numbers, and what is to be known of them.

    Attributes
    ----------
    columns : dict of str to ndarray, shape (n,)
        The columns; NaN for what is no number.
    texts : dict of str to Text
        What text is in columns, by name.
    units : dict of str to str
        Units that stand below the names.
    remarks : list of str
        What was not read.
    """

    columns: dict[str, Array]
    texts: dict[str, Text] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)

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


def read_text_table(path: Path, rows: int | None = None) -> Table:
    """A table of text, also packed.

    Parameters
    ----------
    path : Path
        The file; lines that begin with `#` are comments.
    rows : int, optional
        Rows that are read; all by default.

    Raises
    ------
    ValueError
        When it is no text, has no names or one name for two columns; OSError and others when it
        cannot be read, for a caller within `reading`.
    """
    lines, encoding = _head(path)
    layout = find_layout(lines)
    refuse_doubled(layout.names)
    with open_unpacked(path) as file, warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", pd.errors.ParserWarning)
        frame: Any = pd.read_csv(
            file, header=None, names=range(len(layout.names)), skiprows=layout.first,
            sep=layout.between or r"\s+", decimal=layout.decimal, comment="#",
            encoding=encoding, encoding_errors="replace", skipinitialspace=True, nrows=rows,
            index_col=False, on_bad_lines="warn", low_memory=False,
        )  # fmt: skip
    # a column without a name is used by nobody
    if not all(layout.names):
        frame = frame.loc[:, [bool(name) for name in layout.names]]
    frame.columns = [name for name in layout.names if name]
    table = Table.of_frame(frame, layout.decimal)
    table.units = layout.units
    long = re.findall(r"Skipping line (\d+): expected", "".join(str(w.message) for w in told))
    if long:
        table.remarks.append(
            f"{path.name}: {len(long)} lines, the first of them line {long[0]}, have more than "
            f"{len(layout.names)} columns and are not used"
        )
    return table


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
    written = text.str.replace(r"^([-+])\s+(?=[\d.,])", r"\1", regex=True)
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


def _times_of_day(text: Any) -> Array:
    """Seconds since midnight; NaN for what is no time of day."""
    parts = text.str.extract(f"^{_TIME_OF_DAY}$")
    hours, minutes, seconds = (
        pd.to_numeric(parts[k].str.replace("[,:]", ".", regex=True), errors="coerce").to_numpy(
            np.float64, na_value=np.nan
        )
        for k in range(3)
    )
    values: Array = 3600.0 * hours + 60.0 * minutes + seconds
    return values


def _over_midnight(values: Array) -> Array:
    """Times of day, where no date says it, as seconds since the midnight before the first row."""
    known = np.flatnonzero(np.isfinite(values))
    midnights = np.diff(values[known]) < -0.5 * _DAY
    values[known[1:]] += _DAY * np.cumsum(midnights)
    return values


def _dates(text: Any) -> Array:
    """Seconds since 1970 of dates by ISO 8601, or with slashes or points; NaN for other text."""
    iso = text.str.replace(
        r"^(\d{4})[/.-](\d{1,2})[/.-](\d{1,2})(?=\D|$)",
        lambda m: f"{m[1]}-{m[2]:>02}-{m[3]:>02}", regex=True,
    ).str.replace(
        r"^(\d{1,2})\.(\d{1,2})\.(\d{4})(?=\D|$)",
        lambda m: f"{m[3]}-{m[2]:>02}-{m[1]:>02}", regex=True,
    ).str.replace(r"(:\d\d:\d\d)[,:](?=\d)", r"\1.", regex=True)  # fmt: skip
    return _since_1970(pd.to_datetime(iso, errors="coerce", utc=True, format="ISO8601"))


def _since_1970(dates: Any) -> Array:
    since: Any = (dates - pd.Timestamp(0, tz="UTC")) / pd.Timedelta(seconds=1)
    seconds: Array = since.to_numpy(dtype=np.float64, na_value=np.nan)
    return seconds
