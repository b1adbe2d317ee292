"""The kinds of board by name: those of this package, and those of other installed packages.

A package adds a kind with an entry point in the group `pam_driver.board_kinds`. The rig file gives
its name under `boards.<name>.kind`; its value is a `MakeKind` (see `protocol`).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.metadata import entry_points
from typing import Final

from pam_driver.boards.mapped.kind import MappedKind
from pam_driver.boards.pam_board.kind import PamBoardKind
from pam_driver.boards.protocol import BoardKind, KindOptions, MakeKind
from pam_model.errors import PamError

GROUP: Final = "pam_driver.board_kinds"
DEFAULT_KIND: Final = "pam_board"
"""The kind of a board for which the rig file gives a number only."""


def _canopen(options: KindOptions) -> BoardKind:
    # the library takes a fifth of the time in which a driver without such devices starts
    from pam_driver.boards.canopen.kind import CanopenKind  # noqa: PLC0415

    return CanopenKind(options)


_OWN: Final[Mapping[str, MakeKind]] = {
    DEFAULT_KIND: PamBoardKind,
    "mapped": MappedKind,
    "canopen": _canopen,
}


@cache
def board_kinds() -> Mapping[str, MakeKind]:
    """All kinds by name, in alphabetical order.

    Raises
    ------
    PamError
        If an installed kind cannot be loaded, or two kinds have the same name.
    """
    return with_installed(_OWN, GROUP)


def with_installed[T](own: Mapping[str, T], group: str) -> dict[str, T]:
    """`own` and the entry points that installed packages add to a group, by name.

    Raises
    ------
    PamError
        If an entry point cannot be loaded, or has a name that is already in use.
    """
    found = dict(own)
    for entry in entry_points(group=group):
        if entry.name in found:
            raise PamError(
                f"two kinds of board are called {entry.name}; one of them is {entry.value}"
            )
        try:
            found[entry.name] = entry.load()
        except Exception as error:  # the import of another package may raise anything
            raise PamError(
                f"the kind of board {entry.name} ({entry.value}) cannot be loaded: {error}"
            ) from error
    return dict(sorted(found.items()))
