"""What is said of a name that nobody knows: the one that was probably meant, and all there are."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

from pam_ros.foreign_text import shown


def unknown(kind: str, name: object, known: Iterable[str]) -> str:
    """One line about an unknown name.

    Parameters
    ----------
    kind : str
        What is looked for, for example "joint".
    name : object
        The name that was given.
    known : iterable of str
        The names that exist, of a registry or of a rig file that was checked.
    """
    names = list(known)
    folded = {one.casefold(): one for one in names}
    close = get_close_matches(str(name).casefold(), folded, 1, 0.6)
    meant = f", did you mean {folded[close[0]]!r}" if close else ""
    there = ", ".join(names) or "none"
    return f"unknown {kind} {shown(str(name))}{meant}; there are: {there}"
