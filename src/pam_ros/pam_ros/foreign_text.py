"""Text that others wrote, made fit for a message: short, quoted, and on one line.

A name in a message, a cell of a table or a line of a maker's file can be of any length and contain
any character. Whoever shows such a text passes it through `shown`, and formats nothing of it
before.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

LONGEST: Final = 64
"""Characters of a foreign text that are shown."""
SENTENCE: Final = 400
"""Characters that are shown of a foreign text that is a whole sentence."""
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


def plain(text: str, longest: int = LONGEST) -> str:
    """Cut a foreign text without quoting it, for a text that stands for itself.

    Parameters
    ----------
    text : str
        Text of a message, a file or a network, of any length.
    longest : int, optional
        Characters that are kept; `SENTENCE` for what another node says in whole sentences.

    Returns
    -------
    str
        The text on one line; what cannot be printed is left as a blank.
    """
    kept = "".join(letter if letter.isprintable() else " " for letter in text[:longest])
    return kept if len(text) <= longest else f"{kept}... ({len(text)} characters)"


def value_shown(value: object) -> str:
    """Show a value of any type that somebody else has set, such as that of a parameter.

    Returns
    -------
    str
        As Python writes it; of a long one only the beginning.
    """
    return shown(value) if isinstance(value, str) else plain(repr(value))
