"""Why a driver refuses a command or an activation, to the word."""

from __future__ import annotations

import pytest

from pam_driver.boards.protocol import Condition
from pam_driver.safety.refusals import against_activation, against_command
from pam_driver.safety.states import SafetyState

HOT = Condition("board_fault", "board 0", "too hot")
WEAK = Condition("supply_low", "supply", "too low")
RESTARTED = Condition("board_restarted", "board 1", "has restarted")
NOT_HELD = "the enabling switch is released"


@pytest.mark.parametrize(
    ("state", "computed_at", "reason"),
    [
        (SafetyState.FAULT, 9.0, "a fault is latched; clear it, then activate"),
        (SafetyState.FAULT_LOWERING, 9.0, "a fault is latched; clear it, then activate"),
        (SafetyState.CHECKING, 9.0, "the start-up check tests the valves"),
        (SafetyState.VENTED, 9.0, "the driver is vented; activate it first"),
        (SafetyState.LOWERING, 9.0, "the driver is lowering; activate it first"),
        (SafetyState.READY, 7.5, "computed before the driver was activated"),
        (SafetyState.READY, 8.0, ""),
        (SafetyState.ACTIVE, 7.5, ""),
    ],
)
def test_a_command_is_refused_with_the_reason(
    state: SafetyState, computed_at: float, reason: str
) -> None:
    assert against_command(state, computed_at, ready_since=8.0) == reason


def problem(
    state: SafetyState = SafetyState.VENTED,
    *,
    faults: tuple[Condition, ...] = (),
    missing: tuple[str, ...] = (),
    conditions: tuple[Condition, ...] = (),
    not_enabled: str = "",
) -> str:
    return against_activation(
        state, faults, missing, conditions, lambda: "left, right", not_enabled
    )


def test_an_activation_is_refused_with_the_reason_of_its_state() -> None:
    assert problem() == ""
    for state in (SafetyState.FAULT, SafetyState.FAULT_LOWERING):
        assert problem(state, faults=(HOT, WEAK)) == (
            "faults are latched, call ~/clear_faults: board 0: too hot; supply: too low"
        )
    assert problem(SafetyState.LOWERING) == "the joints are being lowered"
    assert problem(SafetyState.CHECKING) == "the start-up check tests the valves"
    assert problem(SafetyState.VENTING) == "not all muscles are empty yet: left, right"


def test_boards_that_do_not_answer_are_all_named() -> None:
    assert problem(missing=("board 0", "board 4"), conditions=(HOT,)) == (
        "no answer from board 0, board 4: check power, wiring and board numbers"
    )


def test_everything_that_is_wrong_is_named_at_once() -> None:
    assert problem(conditions=(HOT, RESTARTED, WEAK), not_enabled=NOT_HELD) == (
        "board 0: too hot; supply: too low; the enabling switch is released"
    )
    assert problem(SafetyState.VENTING, conditions=(HOT,)) == "board 0: too hot"
    assert problem(conditions=(RESTARTED,), not_enabled=NOT_HELD) == NOT_HELD
    assert problem(conditions=(RESTARTED,)) == ""
