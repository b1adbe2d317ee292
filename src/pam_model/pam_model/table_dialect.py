"""The dialect of a table of text: encoding, separator and decimal mark.

What a spreadsheet writes depends on the language of the desktop: semicolons and decimal commas,
tabs, a byte order mark, UTF-16, or Windows-1252 (the degree sign in a heading).
"""

from __future__ import annotations

import codecs
import contextlib
import re
from collections.abc import Sequence
from typing import Final

ENCODINGS: Final = ("utf-8-sig", "utf-16", "cp1252")
"""In the order in which they are tried; each refuses nearly all texts of the ones before it."""
_COMMA: Final = re.compile(r'"?[-+]?\d+,\d+([eE][-+]?\d+)?"?')
_POINT: Final = re.compile(r'"?[-+]?\d*\.\d+([eE][-+]?\d+)?"?')


def decoded(content: bytes) -> str:
    """The text of a file.

    Raises
    ------
    UnicodeError
        When it is no text in any of these encodings.
    """
    marked = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    with contextlib.suppress(UnicodeError):
        return content.decode("utf-16" if marked else "utf-8-sig")
    return content.decode(ENCODINGS[-1])


def separator(header: str) -> str:
    """What separates the names in the first line: a semicolon, a tab or a comma."""
    return next((s for s in (";", "\t") if header.count(s) >= max(header.count(","), 1)), ",")


def decimal_mark(lines: Sequence[str], between: str) -> str:
    """The decimal mark of the numbers, "," or ".".

    Parameters
    ----------
    lines : sequence of str
        Some lines below the names.
    between : str
        What separates the columns; where that is a comma, the decimal mark is a point.
    """
    if between == ",":
        return "."
    fields = [field.strip() for line in lines for field in line.split(between)]
    commas, points = (
        sum(pattern.fullmatch(field) is not None for field in fields)
        for pattern in (_COMMA, _POINT)
    )
    return "," if commas > points else "."
