"""Tables in Markdown, and the places of a page that hold what is generated."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Final

from pam_model.errors import PamError

_PLACE: Final = re.compile(
    r"<!-- (?P<name>[\w ]+): begin -->\n.*?<!-- (?P=name): end -->", re.DOTALL
)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; a | in a cell is escaped."""
    lines = [_row(head), "|---" * len(head) + "|", *map(_row, rows)]
    return "\n".join(lines)


def _row(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def places(page: str) -> list[str]:
    """The names of what a page holds between `<!-- NAME: begin -->` and `<!-- NAME: end -->`."""
    return [found["name"] for found in _PLACE.finditer(page)]


def updated(page: str, parts: Mapping[str, Callable[[], str] | None]) -> str:
    """The page with new text at each of its places.

    Parameters
    ----------
    page : str
        Markdown.
    parts : mapping
        By the name of a place, what makes its text; None leaves it as it is.

    Raises
    ------
    PamError
        If a place has a name that is not known.
    """
    for name in places(page):
        if name not in parts:
            raise PamError(f"nothing is called {name!r}; expected one of {', '.join(parts)}")

    def place(found: re.Match[str]) -> str:
        name = found["name"]
        text = parts[name]
        if text is None:
            return found[0]
        return f"<!-- {name}: begin -->\n\n{text()}\n\n<!-- {name}: end -->"

    return _PLACE.sub(place, page)
