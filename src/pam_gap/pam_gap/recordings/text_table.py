"""Reads tables of text as laboratory programs write them, with any usual separator, packed or not.

The first lines tell the layout, `cell_numbers` reads the cells of text, and `long_table` the tables
with one row for each sample of each signal.
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

from pam_gap.recordings.cell_numbers import Text, numbers_in, over_midnight
from pam_gap.recordings.long_table import wide_of
from pam_gap.recordings.recording import Array
from pam_gap.recordings.table_layout import COMMENT, find_layout, numbered, refuse_doubled
from pam_gap.recordings.unpacked import open_unpacked
from pam_model.table_dialect import encoding_of

_LINES: Final = 200
"""Lines that are looked at."""
_FEWEST_LINES, _ENOUGH = 4, 1 << 20
"""So many suffice if they have so many bytes, as with 100,000 columns."""
_OPEN: Final = re.compile(r'(?:^|[;,\t|])\s*"[^"]*$')
_CLOSED: Final = re.compile(r'[^"]*"\s*(?:[;,\t|]|$)')
"""The end of a line in a quoted cell, and the beginning of the next line."""
_LONGEST_LINE: Final = 1 << 24
"""Bytes in which a line must end."""


@dataclass(slots=True)
class Table:
    """The columns of a table as numbers, and what is to be known of them."""

    columns: dict[str, Array]  # shape (n,): the columns; NaN for what is no number
    texts: dict[str, Text] = field(default_factory=dict)  # what text is in columns, by name
    # units that stand below the names, as `bar` or `bar absolute`
    units: dict[str, str] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)  # what was not read
    one_clock: bool = True  # whether all columns share their times; not in a long table

    @classmethod
    def of_frame(cls, frame: Any, decimal: str = ".") -> Table:
        """The columns of a data frame; of two with one name, ValueError is raised."""
        names = [str(name).strip() for name in frame.columns]
        refuse_doubled(names)
        wide = wide_of(frame.set_axis(names, axis=1), decimal)
        if wide is not None:
            return cls(wide.columns, wide.texts, {}, wide.remarks, wide.one_clock)
        table = cls(dict.fromkeys(names, np.zeros(0)))
        plain = [isinstance(kind, np.dtype) and kind.kind in "biuf" for kind in frame.dtypes]
        numeric = frame if all(plain) else frame.loc[:, plain]
        values = numeric.to_numpy(dtype=np.float64)  # at once: there may be 100,000
        table.columns |= dict(zip(np.array(names, dtype=object)[plain], values.T, strict=True))
        kinds: dict[str, str] = {}
        for place in np.flatnonzero(~np.array(plain, dtype=np.bool_)):
            name = names[place]
            table.columns[name], text, kind = numbers_in(frame.iloc[:, place], decimal)
            kinds[name] = kind
            if text is not None:
                table.texts[name] = text
        if "date" not in kinds.values():
            for name in (name for name, kind in kinds.items() if kind == "clock"):
                table.columns[name] = over_midnight(table.columns[name])
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
    return _with_whole_cells(re.split(r"\r\n|\n|\r", text)), encoding


def _with_whole_cells(lines: list[str]) -> list[str]:
    """The lines, of which two are one where a quoted cell has two lines, as a name and its unit."""
    found: list[str] = []
    for line in lines:
        if found and _OPEN.search(found[-1]) and _CLOSED.match(line):
            found[-1] += f" {line}"
        else:
            found.append(line)
    return found


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
    frame = _without_repeated_names(_without_comments(frame), layout.names)
    # a column without a name is used by nobody
    if not all(layout.names):
        frame = frame.loc[:, [bool(name) for name in layout.names]]
    unique = numbered(layout.names)
    frame.columns = [name for name in unique if name]
    table = Table.of_frame(frame, layout.decimal)
    table.units = {name: unit for name, unit in layout.units.items() if name in table.columns}
    _leave_out_doubled(table, dict(zip(unique, layout.names, strict=True)))
    long = re.findall(r"Skipping line (\d+): expected", "".join(str(w.message) for w in told))
    if long:
        table.remarks.append(
            f"{path.name}: {len(long)} lines, the first of them line {long[0]}, have more than "
            f"{len(layout.names)} columns and are not used"
        )
    return table


def _without_repeated_names(frame: Any, names: Sequence[str]) -> Any:
    """The rows that do not repeat the names, as where files were joined."""
    named = [place for place, name in enumerate(names) if name]
    if any(pd.api.types.is_numeric_dtype(frame.iloc[:, place].dtype) for place in named):
        return frame
    repeated = np.ones(len(frame), dtype=np.bool_)
    for place in named:
        cells = frame.iloc[:, place].astype("string").str.strip().fillna("")
        repeated &= (cells == names[place]).to_numpy(bool)
    return frame.loc[~repeated].infer_objects() if repeated.any() else frame


def _leave_out_doubled(table: Table, original: dict[str, str]) -> None:
    """Keep one of two columns with the same name and the same numbers, as a time of each channel.

    `original` has the name that each column has in the file.
    """
    doubled = [name for name in table.columns if name != original.get(name, name)]
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
