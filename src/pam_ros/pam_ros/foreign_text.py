"""Text that others wrote, made fit for a message: short, quoted, and on one line.

A name in a message, a cell of a table or a line of a maker's file can be of any length and contain
any character. Whoever shows one passes it through `shown`, and formats nothing of it before.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

LONGEST: Final = 64
"""Characters of a foreign text that are shown."""
MOST: Final = 8
"""Foreign texts of a list that are shown."""


def shown(text: str) -> str:
    """Quote a foreign text; a long one is cut, and its length is stated.

    Parameters
    ----------
    text : str
        Text of a message, a file or a network, of any length.

    Returns
    -------
    str
        At most `LONGEST` characters of the text in quotes, control characters escaped.
    """
    if len(text) <= LONGEST:
        return repr(text)
    return f"{text[:LONGEST]!r}... ({len(text)} characters)"


def all_shown(texts: Iterable[str]) -> str:
    """Quote a list of foreign texts, separated by commas; of a long list only the first `MOST`.

    Parameters
    ----------
    texts : iterable of str
        Texts of a message, a file or a network.

    Returns
    -------
    str
        The texts as `shown` quotes them, and how many are left out.
    """
    kept: list[str] = []
    left_out = 0
    for text in texts:
        if len(kept) < MOST:
            kept.append(shown(text))
        else:
            left_out += 1
    return ", ".join(kept) + (f" and {left_out} more" if left_out else "")


def in_one_line(text: str, longest: int = 160) -> str:
    """What a library says of a foreign file, for the brackets of a message: one line, cut.

    Parameters
    ----------
    text : str
        Message of an exception; it may quote the file.
    longest : int
        Characters that are shown.

    Returns
    -------
    str
        The text without line breaks, control characters escaped.
    """
    line = " ".join(text[: 4 * longest].split())
    line = "".join(c if c.isprintable() else repr(c)[1:-1] for c in line)
    return line if len(line) <= longest else f"{line[:longest]}..."
