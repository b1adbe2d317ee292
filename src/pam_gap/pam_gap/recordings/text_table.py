"""Reads tables of text as laboratory programs write them: CSV with any usual separator.

The first lines tell the dialect. Stamps may be dates by ISO 8601; they become seconds since 1970
(UTC where no zone is given).
"""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from pam_model.table_dialect import ENCODINGS, decimal_mark, separator

_LINES: Final = 30
"""Lines that are looked at."""
_NO_SEPARATOR: Final = "\x01"


def _first_lines(path: Path) -> tuple[list[str], str]:
    """The first lines that are no comments, and the encoding in which they can be read."""
    for encoding in ENCODINGS:
        try:
            lines = pd.read_csv(
                path, sep=_NO_SEPARATOR, header=None, comment="#", nrows=_LINES, dtype=str,
                quoting=csv.QUOTE_NONE, encoding=encoding,
            )  # fmt: skip
        except UnicodeError:
            continue
        return [str(line).strip() for line in lines[0]], encoding
    raise ValueError("neither text in UTF-8, UTF-16 nor Windows-1252")


def read_text_table(path: Path, rows: int | None = None) -> Any:
    """A table of text, also compressed, as a data frame.

    Parameters
    ----------
    path : Path
        The file; its first line that is no comment (`#`) holds the names of the columns.
    rows : int, optional
        Rows that are read; all by default.

    Raises
    ------
    ValueError
        When it is no text, has no names or one name for two columns, or has lines of different
        lengths; OSError and EOFError when it cannot be read.
    """
    lines, encoding = _first_lines(path)
    between = separator(lines[0])
    names = [name.strip().strip('"') for name in lines[0].split(between)]
    if all(re.fullmatch(r"[-+.,\d]+([eE][-+]?\d+)?", name) for name in names):
        raise ValueError("the first line holds numbers; expected the names of the columns")
    twice = sorted({name for name in names if name and names.count(name) > 1})
    if twice:
        raise ValueError(f"two columns are called {twice[0]!r}; expected one name for each column")
    return pd.read_csv(
        path, comment="#", sep=between, decimal=decimal_mark(lines[1:], between),
        encoding=encoding, skipinitialspace=True, nrows=rows,
    )  # fmt: skip


def numbers(column: Any) -> npt.NDArray[np.float64]:
    """A column as numbers; dates become seconds since 1970, and other text NaN.

    Parameters
    ----------
    column : Series
        A column of a data frame.
    """
    values: npt.NDArray[np.float64] = pd.to_numeric(column, errors="coerce").to_numpy(
        dtype=np.float64
    )
    if np.isfinite(values).any() or pd.api.types.is_numeric_dtype(column.dtype):
        return values
    dates = pd.to_datetime(column, errors="coerce", utc=True, format="ISO8601")
    since: Any = (dates - pd.Timestamp(0, tz="UTC")) / pd.Timedelta(seconds=1)
    seconds: npt.NDArray[np.float64] = since.to_numpy(dtype=np.float64, na_value=np.nan)
    return seconds


def text_in(column: Any) -> str:
    """The first text in a column that holds no number, for a message; empty without any."""
    texts = [str(value) for value in column.dropna().iloc[:1]]
    return f" but text such as {texts[0]!r}" if texts else ""
