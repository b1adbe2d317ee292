"""The kinds of board by name: those of this package, and those that others install.

A package adds a kind by an entry point in the group `pam_driver.board_kinds`; its name is what the
rig file says under `boards.<name>.kind`, its value a `MakeKind` (see `protocol`).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.metadata import entry_points
from typing import Final

from pam_driver.boards.pam_board.kind import PamBoardKind
from pam_driver.boards.protocol import MakeKind
from pam_model.errors import PamError

GROUP: Final = "pam_driver.board_kinds"
DEFAULT_KIND: Final = "pam_board"
"""The kind of a board that the rig file only gives a number."""
_OWN: Final[Mapping[str, MakeKind]] = {DEFAULT_KIND: PamBoardKind}


@cache
def board_kinds() -> Mapping[str, MakeKind]:
    """All kinds by name, in alphabetical order.

    Raises
    ------
    PamError
        If an installed kind cannot be loaded, or has the name of another.
    """
    return with_installed(_OWN, GROUP)


def with_installed[T](own: Mapping[str, T], group: str) -> dict[str, T]:
    """`own` and what installed packages add by entry points of a group, by name.

    Raises
    ------
    PamError
        If one cannot be loaded, or has the name of another.
    """
    found = dict(own)
    for entry in entry_points(group=group):
        if entry.name in found:
            raise PamError(f"two kinds of board are called {entry.name}: one of {entry.value}")
        try:
            found[entry.name] = entry.load()
        except Exception as error:  # whatever the import of a foreign package raises
            raise PamError(
                f"the kind of board {entry.name} ({entry.value}) cannot be loaded: {error}"
            ) from error
    return dict(sorted(found.items()))
