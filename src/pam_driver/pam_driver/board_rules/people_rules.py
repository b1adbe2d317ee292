"""Rules for people: emergency stop, enabling switch, brake and dump valve."""

from __future__ import annotations

from typing import Final

from pam_driver.board_rules.rule import Rule
from pam_driver.board_rules.tester import (
    DISABLED,
    ENABLED,
    OFF,
    ON,
    BoardTester,
    NotTriedError,
    RuleBrokenError,
    ValveFeed,
)
from pam_driver.boards.pam_board.codec import (
    BoardCode,
    BoardFault,
    BoardState,
    SafetyInput,
    Status,
)

PRESS_STOP: Final = "Press the emergency stop"
RELEASE_STOP: Final = "Release the emergency stop"
HOLD_SWITCH: Final = "Hold the enabling switch"
RELEASE_SWITCH: Final = "Release the enabling switch"
_PATIENCE: Final = 30.0  # s


def _ask(tester: BoardTester, text: str) -> None:
    ask = tester.limits.ask
    if ask is None:
        raise NotTriedError("needs a person: use --person")
    if not ask(text):
        raise NotTriedError(f"not done: {text}")


def _outputs(tester: BoardTester) -> tuple[bool, bool]:
    return tester.status.brake_released, tester.status.dump_closed


def _send_outputs(tester: BoardTester, enable: tuple[bool, bool], wanted: bool) -> None:
    """Valve commands for 0.1 s with both output bits set or clear."""
    tester.wait(0.1 + tester.answer_time, ValveFeed((0.0, 0.0), enable, wanted))


def _brake_and_dump(tester: BoardTester) -> str:
    tester.rest()
    _send_outputs(tester, OFF, wanted=True)
    if any(_outputs(tester)):
        raise RuleBrokenError("an output has current in vented, with its bit set")
    tester.activate()
    _send_outputs(tester, ON, wanted=False)
    if any(_outputs(tester)):
        raise RuleBrokenError("an output has current in active, with its bit clear")
    _send_outputs(tester, ON, wanted=True)
    brake, dump = _outputs(tester)
    tester.expect(BoardState.ACTIVE, after="with both output bits set")
    tester.tell(BoardCode.VENT)
    tester.wait(tester.answer_time)
    if any(_outputs(tester)):
        raise RuleBrokenError("an output still has current after vent")
    if not brake and not dump:
        raise NotTriedError(
            "no output ever had current: the board has neither brake nor dump valve"
        )
    names = [name for name, had in (("brake", brake), ("dump valve", dump)) if had]
    return f"current only in active with its bit set: {' and '.join(names)}"


def _emergency_stop(tester: BoardTester) -> str:
    tester.rest()
    if tester.status.emergency_stop is SafetyInput.NOT_AVAILABLE:
        raise NotTriedError("the board has no emergency stop (EmergencyStop is 3)")
    tester.activate()
    _ask(tester, PRESS_STOP)
    pressed = tester.until(
        lambda: tester.status.emergency_stop is SafetyInput.STOP, _PATIENCE, ENABLED
    )
    if not pressed:
        raise NotTriedError("EmergencyStop stayed at 1, released")
    tester.wait(tester.answer_time, ENABLED)
    fault = BoardFault.EMERGENCY_STOP
    tester.expect(BoardState.FAULT, fault, "after the button was pressed while active")
    tester.tell(BoardCode.CLEAR_FAULTS)
    tester.wait(tester.answer_time)
    tester.expect(BoardState.FAULT, fault, "after clear_faults with the button pressed")
    _ask(tester, RELEASE_STOP)
    if not tester.until(lambda: tester.status.emergency_stop is SafetyInput.PERMIT, _PATIENCE):
        raise NotTriedError("EmergencyStop stayed at 0, pressed")
    tester.wait(0.05, DISABLED)
    tester.wait(0.05, ENABLED)
    tester.expect(BoardState.FAULT, fault, "after the button was released")
    tester.rest()
    return "fault emergency_stop by itself, latched until clear_faults with the button released"


def _enabling_switch(tester: BoardTester) -> str:
    tester.rest()
    if tester.status.enabling_switch is SafetyInput.NOT_AVAILABLE:
        raise NotTriedError("the board has no enabling switch (EnablingSwitch is 3)")
    _ask(tester, HOLD_SWITCH)
    if not tester.until(lambda: tester.status.enabling_switch is SafetyInput.PERMIT, _PATIENCE):
        raise NotTriedError("EnablingSwitch stayed at 0, released")
    tester.activate()
    _ask(tester, RELEASE_SWITCH)
    released = tester.until(
        lambda: tester.status.enabling_switch is SafetyInput.STOP, _PATIENCE, ENABLED
    )
    if not released:
        raise NotTriedError("EnablingSwitch stayed at 1, held")
    tester.wait(tester.answer_time, ENABLED)
    tester.expect(BoardState.VENTED, after="after the switch was released while active")
    _ask(tester, HOLD_SWITCH)
    tester.until(lambda: tester.status.enabling_switch is SafetyInput.PERMIT, _PATIENCE, ENABLED)
    tester.forget()
    tester.wait(0.1, ENABLED)
    if any(status.state is BoardState.ACTIVE for _, status in tester.messages(Status)):
        raise RuleBrokenError("active when the switch was held again, without being armed")
    return "vented by itself when released; not armed when held again"


RULES: Final = (
    Rule(
        "brake_and_dump",
        "12 Outputs",
        "Brake released and dump valve closed only in active, and only with their bits set.",
        "both bits set in vented; clear and set in active; then vent",
        "Switch the outputs with the state, in the same place as the valves.",
        _brake_and_dump,
    ),
    Rule(
        "emergency_stop",
        "10 Emergency stop",
        "A pressed emergency stop is a latched fault of the board, without a command of the host.",
        "commands with set enable bits while a person presses and releases the button",
        "The contact is normally closed: no current means pressed.",
        _emergency_stop,
    ),
    Rule(
        "enabling_switch",
        "11 Enabling switch",
        "A released enabling switch leads from active to vented, and the board has to be armed.",
        "commands with set enable bits while a person releases and holds the switch",
        "The contact is normally open: no current means released.",
        _enabling_switch,
    ),
)
