"""Which kinds of fault a campaign brings about."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from difflib import get_close_matches

from pam_check.fault_kinds.device_kinds import FOR_ALL_BOARDS
from pam_check.fault_kinds.fault_kind import FaultKind
from pam_check.fault_kinds.kinds import ALL_KINDS, KINDS
from pam_driver.boards.register import DEFAULT_KIND
from pam_model.errors import PamError


def kinds_for(boards: Collection[str]) -> list[FaultKind]:
    """The kinds that are stated for a rig with these kinds of board.

    Parameters
    ----------
    boards : collection of str
        Names of kinds of board, as the rig file has them.
    """
    if set(boards) <= {DEFAULT_KIND}:
        return list(KINDS)
    return [
        kind
        for kind in ALL_KINDS
        if kind.name in FOR_ALL_BOARDS or not set(kind.boards).isdisjoint(boards)
    ]


def kinds_called(names: Sequence[str] | None, kinds: Sequence[FaultKind]) -> list[FaultKind]:
    """The kinds with these names; all kinds if no names are given.

    Raises
    ------
    PamError
        If no kind has one of the names.
    """
    known = {kind.name: kind for kind in kinds}
    for name in names or ():
        if name not in known:
            close = get_close_matches(name, known, 1)
            hint = f"did you mean {close[0]}?" if close else f"known: {', '.join(known)}"
            raise PamError(f"unknown fault {name!r}; {hint}")
    return [kind for kind in kinds if not names or kind.name in names]
