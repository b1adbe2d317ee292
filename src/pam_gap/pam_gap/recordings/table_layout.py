"""Where names, units and numbers stand in a table of text, and what separates its columns.

Instruments write their settings before the table and the units below the names; numpy writes the
names behind a `#`, Matlab behind a `%`; some programs separate by blanks. The numbers are therefore
found first: the separator is the one with which most lines are rows of equally many numbers, and
the names stand above the first of them.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from pam_gap.recordings.name_words import VALUE_WORD, is_unit_word, names_a_long_table
from pam_model.table_dialect import decimal_mark, separator
from pam_ros.foreign_text import all_shown, shown

_SEPARATORS: Final = (";", "\t", "|", ",", None)
"""In the order in which they are preferred; None stands for blanks."""
_JUDGED: Final = 64
"""Cells of a line that are looked at, so that a line of 100,000 columns costs no more."""
_REMARKS: Final = 3
"""Lines above the rows among which the names are sought."""
_ENOUGH_NAMES: Final = 4
"""Columns that tell a line of names from a setting of the instrument, if it is not the next."""
_LAST: Final = 8
"""Lines at the end that tell how many columns there are."""
_NUMBER: Final = re.compile(
    r"[-+]?\s*(\d+([.,]\d*)?|[.,]\d+)([eEdD][-+]?\d+)?\s*%?"
    r"|[-+]?\d{1,3}((,\d{3})+\.\d+|(\.\d{3})+,\d+|(['\u2019]\d{3})+([.,]\d+)?)"
    r"|(\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4})([T ]+\d{1,2}:\d{2}.*)?"
    r"|\d{1,2}:\d{2}(:\d{2}([.,:]\d+)?)?( ?[aApP][mM])?"
)
"""A number, also with its sign apart or its thousands, a date, or a time of day."""
COMMENT: Final = ("#", "%")
"""What begins a line that is no row."""
_NOTHING: Final = frozenset({"", "nan", "inf", "-inf", "n/a", "na", "null", "none", "-", "#n/a"})
MINUS: Final = "\u2212\u2013"
"""Signs that word processors write in place of a minus."""
_MINUS: Final = str.maketrans(dict.fromkeys(MINUS, "-"))
UNIT_SPELLINGS: Final = {
    "s": "s", "sec": "s", "ms": "ms", "msec": "ms", "us": "us", "usec": "us", "µs": "us",
    "ns": "ns", "pa": "Pa", "bar": "bar", "mbar": "mbar", "hpa": "mbar", "kpa": "kPa",
    "mpa": "MPa", "psi": "psi", "rad": "rad", "mrad": "mrad", "deg": "deg", "°": "deg",
    "degree": "deg", "degrees": "deg", "grad": "deg", "m": "m", "mm": "mm", "cm": "cm", "n": "N",
    "mn": "mN", "kn": "kN", "%": "per cent", "percent": "per cent", "v": "V", "a": "A", "ma": "mA",
    "mv": "mV", "nm": "N m", "hz": "Hz", "-": "-", "1": "-", "°c": "°C", "rpm": "rpm",
    "second": "s", "seconds": "s", "secs": "s", "milliseconds": "ms", "microseconds": "us",
    "nanoseconds": "ns", "pascal": "Pa", "newton": "N", "newtons": "N", "radian": "rad",
    "radians": "rad", "metre": "m", "metres": "m", "meter": "m", "meters": "m", "volt": "V",
    "volts": "V", "gradi": "deg", "grados": "deg", "degrés": "deg", "min": "min", "minutes": "min",
    "h": "h", "hours": "h",
}  # fmt: skip
"""How units are written below or behind the names, without upper case, and the unit."""
_ZERO: Final = re.compile(
    r"(pa|bar|mbar|hpa|kpa|mpa|psi)[ _]?\(?(a|abs|abs\.|absolute|g|gauge|rel|relative)\)?"
)


@dataclass(frozen=True, slots=True)
class TableLayout:
    """How a table of text is to be read."""

    names: tuple[str, ...]  # a name for each column; empty where none is given
    # the units that stand below the names, by name, as `bar` or `bar absolute`
    units: dict[str, str]
    between: str | None  # what separates the columns; None for blanks
    decimal: str  # the decimal mark
    first: int  # number of the line with the first numbers, from 0


Rows = list[tuple[int, list[str]]]


def _cells(line: str, between: str | None) -> list[str]:
    if between is None:
        return line.split()
    if '"' in line:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=between))]
    return [cell.strip() for cell in line.split(between)]


def _share(cells: Sequence[str]) -> float:
    """The share of numbers among the cells of a line that hold something; 0 without any."""
    filled = [cell for cell in cells[:_JUDGED] if cell.lower() not in _NOTHING]
    if not filled:
        return 0.0
    plain = [cell.strip('"').translate(_MINUS) for cell in filled]
    return sum(_NUMBER.fullmatch(cell) is not None for cell in plain) / len(filled)


def _kind(cell: str) -> bool | None:
    """Whether a cell is a number; None if it is empty or a word for nothing."""
    return bool(_share([cell])) if cell.lower() not in _NOTHING else None


def _first_row(rows: Rows) -> tuple[int, float]:
    """Place of the first row of numbers, and how well the lines from there on are rows; -1, 0."""
    widths = [len(cells) for _, cells in rows]
    width = Counter(widths[-_LAST:]).most_common(1)[0][0]
    shares = [_share(cells) if len(cells) == width else 0.0 for _, cells in rows]
    begins = Counter(_kind(cells[0]) for _, cells in rows if len(cells) == width)
    begin = begins.most_common(1)[0][0]
    good = [
        len(cells) == width
        and (share >= 0.5 or (begin is True and share > 0.0))
        and (begin is False or _kind(cells[0]) is not False)
        for (_, cells), share in zip(rows, shares, strict=True)
    ]
    for place, is_row in enumerate(good):
        # a line of the metadata may look like a row, but not the lines below it; where rows begin
        # with a number, such as a time, their other cells may be text, and a word begins no row
        if is_row and all(good[place : place + 3]):
            fitting = [shares[k] for k in range(place, len(rows)) if good[k]]
            alone = 0.5 if width == 1 else 1.0  # "1,2" is one number only where nothing else fits
            return place, alone * len(fitting) * (sum(fitting) / len(fitting)) ** 2
    return -1, 0.0


def unit_spelt(text: str) -> str | None:
    """The unit that a text is, with or without brackets; None for another text.

    What is said of the zero of a pressure, as in `psia` or `bar (g)`, does not belong to the unit.
    """
    plain = _plain(text)
    return UNIT_SPELLINGS.get(plain) or next(iter(_pressure_and_zero(plain)), None)


def is_pressure_with_zero(text: str) -> bool:
    """Whether a text is a unit of pressure with its zero, as `psia` or `bar(g)`."""
    return bool(_pressure_and_zero(_plain(text)))


def is_absolute(text: str) -> bool:
    """Whether a text is the unit of an absolute pressure, as `psia`, `bar(abs)` or `kPa abs`."""
    found = _pressure_and_zero(_plain(text))
    return bool(found) and found[1].startswith("a")


def _plain(text: str) -> str:
    """A unit without its brackets, in lower case."""
    return (
        re.sub(r"^\[(.*)\]$|^\((.*)\)$", r"\1\2", text.strip())
        .strip(" []")
        .lower()
        .removeprefix("in ")
    )


def _pressure_and_zero(plain: str) -> tuple[str, ...]:
    """The unit of a pressure and the word for its zero; empty for another text."""
    match = _ZERO.fullmatch(plain)
    return (UNIT_SPELLINGS[match[1]], match[2]) if match else ()


def _are_units(cells: Sequence[str]) -> bool:
    filled = [cell for cell in cells if cell.strip(" []()") and not is_unit_word(cell)]
    return bool(filled) and all(unit_spelt(cell) for cell in filled)


def find_layout(lines: Sequence[str], given: Sequence[str] = ()) -> TableLayout:
    """Find names, units and numbers of a table in its first lines.

    Parameters
    ----------
    lines : sequence of str
        The first lines of the file, all of them, without line ends.
    given : sequence of str, optional
        Names of the columns of a table without names.

    Raises
    ------
    ValueError
        When there is no line, or none that holds the names of the columns, and none are given; the
        message says which line looks like it. Also when the given ones do not fit.
    """
    told = [(k, line) for k, line in enumerate(lines) if line.strip()]
    body = [(k, line) for k, line in told if not line.lstrip().startswith(COMMENT)]
    if len(body) < (1 if given else 2):
        raise ValueError("it holds no rows below a line of names")
    if long := _long_layout(body):
        return long
    best: tuple[float, int, str | None, Rows] = (0.0, -1, None, [])
    for between in _SEPARATORS:
        rows = [(k, _cells(line, between)) for k, line in body]
        place, quality = _first_row(rows)
        if quality > best[0]:
            best = (quality, place, between, rows)
    _, place, between, rows = best
    if place < 0:  # no numbers: the first line must be the names, and the reader says what is text
        between = separator(body[0][1])
        names = _cells(body[0][1], between)
        return TableLayout(tuple(names), {}, between, ".", body[0][0] + 1)
    first, cells = rows[place]
    names, units = _names_above(rows, body, place)
    if not names:
        above_it = [line for k, line in told if k < first and line.lstrip().startswith(COMMENT)]
        comments = [line.strip("#% ") for line in above_it]
        comment = comments[-1] if comments else ""
        names = _fitted(_cells(comment, between), cells, comment)
    if names and given:
        raise ValueError("its columns have names; expected no `names` in the map")
    if given and len(given) != len(cells):
        raise ValueError(f"it has {len(cells)} columns, and `names` in the map are {len(given)}")
    names = names or list(given)
    if not names:
        raise ValueError(_no_names(first, cells, body, place))
    text = [line for _, line in body[place:]]
    kept = {
        name: f"{unit} absolute" if is_absolute(raw) else unit
        for name, raw in zip(names, units, strict=False)
        if (unit := unit_spelt(raw)) and name
    }
    return TableLayout(tuple(names), kept, between, decimal_mark(text, between), first)


def _long_layout(body: list[tuple[int, str]]) -> TableLayout | None:
    """The layout of a long table, whose rows may hold more text than numbers; None without one."""
    for place, (_, line) in enumerate(body[:-1]):
        for between in filter(None, _SEPARATORS) if VALUE_WORD.search(line) else ():
            names = _cells(line, between)
            if names_a_long_table(names):
                text = [row for _, row in body[place + 1 :]]
                first = body[place + 1][0]
                return TableLayout(tuple(names), {}, between, decimal_mark(text, between), first)
    return None


def _fitted(names: list[str], cells: list[str], line: str) -> list[str]:
    """The names if they fit the cells of the first row; empty if they do not."""
    apart = [part.strip() for part in re.split(r"\s{2,}|\t", line.strip()) if part.strip()]
    for tried in (names, apart):
        found = list(tried)
        while len(found) > len(cells) and not found[-1]:
            found.pop()
        if _share(found) >= 0.5 or not any(found):
            continue
        if len(found) == len(cells):
            return found
        if len(found) == len(cells) - 1:  # a separator at the end of each row, or numbers of rows
            return [*found, ""] if not cells[-1] else ["", *found]
    return []


def _names_above(rows: Rows, body: list[tuple[int, str]], place: int) -> list[list[str]]:
    """The names above the rows that begin at a place, and the units between; empty without.

    A line that says that the rows begin may stand between. Names may be spread over two lines.
    """
    cells = rows[place][1]
    for line in range(place - 1, max(place - 1 - _REMARKS, -1), -1):
        above, units, top = rows[line][1], list[str](), line
        if line < place - 1 and (len(above) != len(cells) or len(cells) < _ENOUGH_NAMES):
            continue
        if line and _are_units(above) and len(rows[line - 1][1]) == len(above):
            units, above, top = above, rows[line - 1][1], line - 1
        names = _fitted(above, cells, "" if units else body[line][1])
        told = [name for name in names if name]
        if len(set(told)) < len(told) and top > 0:
            names = _with_line_above(names, _fitted(rows[top - 1][1], cells, ""))
        if names:
            return [names, units]
    return [[], []]


def _with_line_above(names: list[str], above: list[str]) -> list[str]:
    """Names that are spread over two lines, the upper of which may leave repeated cells empty."""
    if not any(above) or any(map(unit_spelt, above)):
        return names
    left, both = "", []
    for upper, name in zip(above, names, strict=True):
        left = upper or left
        both.append(f"{left} {name}".strip() if name else "")
    return both


def _no_names(first: int, cells: list[str], body: list[tuple[int, str]], place: int) -> str:
    if not place:
        return (
            f"the first line holds numbers; expected the names of the {len(cells)} columns in a "
            "line above them, or in the map, as `names: [...]`"
        )
    number, line = body[place - 1]
    return (
        f"line {first + 1} is the first of {len(cells)} columns of numbers, but line {number + 1} "
        f"above it, {shown(line.strip())}, does not name {len(cells)} columns; expected their names"
    )


def numbered(names: Sequence[str]) -> list[str]:
    """The names, of which those that were there before have a number behind them."""
    seen: Counter[str] = Counter()
    found = []
    for name in names:
        seen[name] += 1
        found.append(f"{name} ({seen[name]})" if name and seen[name] > 1 else name)
    return found


def refuse_doubled(names: Sequence[str]) -> None:
    """Refuse columns with one name.

    Raises
    ------
    ValueError
        The message names them.
    """
    twice = [name for name, count in Counter(filter(None, names)).items() if count > 1]
    if twice:
        which = all_shown(twice)
        raise ValueError(f"two columns are called {which}; expected one name for each column")
