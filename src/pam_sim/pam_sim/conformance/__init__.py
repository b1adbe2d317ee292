"""The conformance kit: what every kind of board and its simulated twin must do, whatever its bytes.

A package that adds a kind of board runs it in its own tests (docs/new_board.md)::

    from pam_sim.conformance import breaches

    assert breaches(load_rig("two_boards_of_my_kind.yaml")) == {}
"""

from __future__ import annotations

from collections.abc import Callable

from pam_model.rig import Rig
from pam_sim.conformance.bench import BoardBench, ConformanceError
from pam_sim.conformance.checks import CHECKS

__all__ = ["CHECKS", "BoardBench", "ConformanceError", "breaches"]


def breaches(rig: Rig) -> dict[str, str]:
    """What the boards of a rig and their twins do wrong.

    Parameters
    ----------
    rig : Rig
        A rig with at least two boards, all of the kind to check, which is registered with its twin.

    Returns
    -------
    dict of str to str
        For each check that fails: its name and one line that says what is wrong.

    Raises
    ------
    RigError
        If the kind refuses the rig.
    """
    found = {}
    for check in CHECKS:
        try:
            check(BoardBench(rig))
        except ConformanceError as error:
            found[_name(check)] = str(error)
    return found


def _name(check: Callable[[BoardBench], None]) -> str:
    return check.__name__
