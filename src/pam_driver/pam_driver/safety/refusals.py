"""Why a driver refuses a command or its activation, in one line for the user."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Final

from pam_driver.boards.protocol import Condition
from pam_driver.safety.states import FAULTY, SafetyState

COMMANDABLE: Final = frozenset({SafetyState.READY, SafetyState.ACTIVE})


def against_command(state: SafetyState, computed_at: float, ready_since: float) -> str:
    """Why a valve command is refused in this state; empty if it is not.

    Parameters
    ----------
    state : SafetyState
        State of the driver.
    computed_at, ready_since : float
        When the command was computed and when the driver was activated, monotonic [s].
    """
    if state in FAULTY:
        return "a fault is latched; clear it, then activate"
    if state is SafetyState.CHECKING:
        return "the start-up check tests the valves"
    if state not in COMMANDABLE:
        return f"the driver is {state.value}; activate it first"
    if state is SafetyState.READY and computed_at < ready_since:
        return "computed before the driver was activated"
    return ""


def against_activation(
    state: SafetyState,
    faults: Sequence[Condition],
    missing: Sequence[str],
    conditions: Iterable[Condition],
    not_empty: Callable[[], str],
    not_enabled: str,
) -> str:
    """Why an activation is refused; empty if it is not.

    Parameters
    ----------
    state : SafetyState
        State of the driver.
    faults : sequence of Condition
        The latched faults.
    missing : sequence of str
        Names of boards that do not answer.
    conditions : iterable of Condition
        What is wrong now; looked at only if nothing else is against it.
    not_empty : callable
        Names the muscles that are not empty yet.
    not_enabled : str
        Why no person enables the motion; empty if one does, or none needs to.
    """
    if state in FAULTY:
        return f"faults are latched, call ~/clear_faults: {'; '.join(map(str, faults))}"
    if state is SafetyState.LOWERING:
        return "the joints are being lowered"
    if state is SafetyState.CHECKING:
        return "the start-up check tests the valves"
    if missing:
        return f"no answer from {', '.join(missing)}: check power, wiring and board numbers"
    wrong = "; ".join(str(one) for one in conditions if one.kind != "board_restarted")
    if not wrong and state is SafetyState.VENTING:
        return f"not all muscles are empty yet: {not_empty()}"
    return "; ".join(filter(None, (wrong, not_enabled)))
