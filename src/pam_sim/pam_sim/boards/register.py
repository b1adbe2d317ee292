"""The twins of the kinds of board by name: of this package, and of other installed packages.

A package that adds a kind (`pam_driver.boards.register`) adds its twin under the same name in the
entry point group `pam_sim.board_twins`; its value is a `MakeTwin` (see `protocol`).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Final

from pam_driver.boards.register import DEFAULT_KIND, with_installed
from pam_model.errors import PamError
from pam_sim.boards.canopen_twin import CanopenTwins
from pam_sim.boards.mapped_twin import MappedTwins
from pam_sim.boards.pam_board_twin import PamBoardTwins
from pam_sim.boards.protocol import MakeTwin

GROUP: Final = "pam_sim.board_twins"
_OWN: Final[Mapping[str, MakeTwin]] = {
    DEFAULT_KIND: PamBoardTwins,
    "mapped": MappedTwins,
    "canopen": CanopenTwins,
}


@cache
def board_twins() -> Mapping[str, MakeTwin]:
    """All twins by the name of their kind, in alphabetical order.

    Raises
    ------
    PamError
        If an installed twin cannot be loaded, or two have the same name.
    """
    return with_installed(_OWN, GROUP)


def twin_called(kind: str) -> MakeTwin:
    """The twin of a kind.

    Raises
    ------
    PamError
        If the kind has no twin.
    """
    twins = board_twins()
    if kind not in twins:
        raise PamError(f"boards of the kind {kind} cannot be simulated; known: {', '.join(twins)}")
    return twins[kind]
