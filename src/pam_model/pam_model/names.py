"""The message about an unknown name: the name that was probably meant, and all known ones."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Final, Never, TypeVar

from pam_model.errors import UnknownNameError
from pam_ros.foreign_text import LONGEST, shown

MOST_LISTED: Final = 40
"""Names that are all listed; of more, only those that are near are."""
_Entry = TypeVar("_Entry")


def unknown(kind: str, name: object, known: Iterable[str]) -> str:
    """One line about an unknown name.

    Parameters
    ----------
    kind : str
        What is looked for, for example "joint".
    known : iterable of str
        The names that exist, of a registry or of a rig file that was checked.
    """
    names = list(known)
    folded = {one.casefold(): one for one in names}
    most = 1 if len(names) <= MOST_LISTED else 5
    close = get_close_matches(str(name)[:LONGEST].casefold(), folded, most)
    text = f"unknown {kind} {shown(str(name))}"
    if close:
        text += f"; did you mean {' or '.join(folded[one] for one in close)}?"
    if len(names) <= MOST_LISTED:
        text += f"{' Known' if close else '; known'}: {', '.join(names) or 'none'}"
    return text


class Named(dict[str, _Entry]):
    """A mapping by name whose error for a missing name lists similar names."""

    def __init__(self, kind: str, entries: Iterable[tuple[str, _Entry]]) -> None:
        super().__init__(entries)
        self._kind = kind

    def __missing__(self, name: object) -> Never:
        raise UnknownNameError(unknown(self._kind, name, self))
