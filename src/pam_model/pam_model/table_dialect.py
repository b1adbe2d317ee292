"""The dialect of a table of text: encoding, separator and decimal mark.

What a spreadsheet writes depends on the language of the desktop: semicolons and decimal commas,
tabs, a byte order mark, UTF-16, GB 2312, or Windows-1252 (the degree sign in a heading).
"""

from __future__ import annotations

import codecs
import contextlib
import csv
import re
from collections.abc import Sequence
from typing import Final

_COMMA: Final = re.compile(r'"?[-+]?\s*\d+,\d+([eE][-+]?\d+)?"?')
_POINT: Final = re.compile(r'"?[-+]?\s*\d*\.\d+([eE][-+]?\d+)?"?')


def encoding_of(start: bytes) -> str:
    """The encoding of a text: UTF-8, UTF-16 with a byte order mark, GB 2312 or Windows-1252.

    In GB 2312, letters beyond ASCII are pairs of bytes from 0xA1 on. In a text of Windows-1252 they
    nearly always stand alone.

    Parameters
    ----------
    start : bytes
        The text, or its beginning, which may end within a character.

    Raises
    ------
    UnicodeError
        When it is no text in any of these encodings.
    """
    if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    for encoding in ("utf-8-sig", "gb2312", "cp1252"):
        with contextlib.suppress(UnicodeError):
            codecs.getincrementaldecoder(encoding)().decode(start)
            return encoding
    raise UnicodeError("neither text in UTF-8, UTF-16, GB 2312 nor Windows-1252")


def decoded(content: bytes) -> str:
    """The text of a file.

    Raises
    ------
    UnicodeError
        When it is no text in any of these encodings.
    """
    return content.decode(encoding_of(content))


def separator(header: str) -> str:
    """What separates the names in the first line: a semicolon, a tab, a bar or a comma."""
    return next((s for s in (";", "\t", "|") if header.count(s) >= max(header.count(","), 1)), ",")


def decimal_mark(lines: Sequence[str], between: str | None) -> str:
    """The decimal mark of the numbers, "," or ".".

    Parameters
    ----------
    lines : sequence of str
        Some lines below the names.
    between : str or None
        What separates the columns, None for blanks; where that is a comma, only a number in quotes
        has a decimal comma.
    """
    fields = [
        field.strip()
        for line in lines
        for field in (
            next(csv.reader([line], delimiter=between), [])
            if between and '"' in line
            else line.split(between)
        )
    ]
    commas, points = (
        sum(pattern.fullmatch(field) is not None for field in fields)
        for pattern in (_COMMA, _POINT)
    )
    return "," if commas > points else "."
