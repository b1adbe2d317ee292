"""What the driver may do, as one table: state and event to next state, state to output.

The table is data so that the documentation is drawn from it and the tests walk it. Whatever
happens, a fault leads out of `ACTIVE` at once, and back only by clear faults, then activate, then
a fresh command.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Final, NamedTuple


class SafetyState(Enum):
    """State of the driver; the value is what diagnostics show."""

    UNCONFIGURED = "unconfigured"
    VENTED = "vented"
    READY = "ready"
    ACTIVE = "active"
    FAULT = "fault"


class SafetyEvent(Enum):
    """What can happen to the driver."""

    CONFIGURE = "configure"
    ACTIVATE = "activate"
    COMMAND = "command"
    DEACTIVATE = "deactivate"
    VENT = "vent"
    FAULT = "fault"
    CLEAR_FAULTS = "clear faults"
    CLEANUP = "clean up"


class SafetyOutput(NamedTuple):
    """What boards are told in a state.

    Attributes
    ----------
    send : bool
        A valve command to each board in each cycle.
    enable : bool
        Its enable bits: whether air may move.
    vent_on_entry : bool
        A board command `vent` to each board when the state is entered.
    meaning : str
        One line for the documentation.
    """

    send: bool
    enable: bool
    vent_on_entry: bool
    meaning: str


_S = SafetyState
_E = SafetyEvent

OUTPUTS: Final[Mapping[SafetyState, SafetyOutput]] = {
    _S.UNCONFIGURED: SafetyOutput(
        False, False, True, "no bus; the boards' watchdogs hold the vent"
    ),
    _S.VENTED: SafetyOutput(True, False, True, "measuring; all valves vent"),
    _S.READY: SafetyOutput(True, False, False, "armed; vented until the first fresh command"),
    _S.ACTIVE: SafetyOutput(True, True, False, "valves follow the commands"),
    _S.FAULT: SafetyOutput(True, False, True, "latched; all valves vent"),
}

TRANSITIONS: Final[Mapping[SafetyState, Mapping[SafetyEvent, SafetyState]]] = {
    _S.UNCONFIGURED: {
        _E.CONFIGURE: _S.VENTED,
        _E.ACTIVATE: _S.UNCONFIGURED,
        _E.COMMAND: _S.UNCONFIGURED,
        _E.DEACTIVATE: _S.UNCONFIGURED,
        _E.VENT: _S.UNCONFIGURED,
        _E.FAULT: _S.UNCONFIGURED,
        _E.CLEAR_FAULTS: _S.UNCONFIGURED,
        _E.CLEANUP: _S.UNCONFIGURED,
    },
    _S.VENTED: {
        _E.CONFIGURE: _S.VENTED,
        _E.ACTIVATE: _S.READY,
        _E.COMMAND: _S.VENTED,
        _E.DEACTIVATE: _S.VENTED,
        _E.VENT: _S.VENTED,
        # nothing moves, so nothing is latched; what lasts refuses activation
        _E.FAULT: _S.VENTED,
        _E.CLEAR_FAULTS: _S.VENTED,
        _E.CLEANUP: _S.UNCONFIGURED,
    },
    _S.READY: {
        _E.CONFIGURE: _S.READY,
        _E.ACTIVATE: _S.READY,
        _E.COMMAND: _S.ACTIVE,
        _E.DEACTIVATE: _S.VENTED,
        _E.VENT: _S.VENTED,
        _E.FAULT: _S.FAULT,
        _E.CLEAR_FAULTS: _S.READY,
        _E.CLEANUP: _S.UNCONFIGURED,
    },
    _S.ACTIVE: {
        _E.CONFIGURE: _S.ACTIVE,
        _E.ACTIVATE: _S.ACTIVE,
        _E.COMMAND: _S.ACTIVE,
        _E.DEACTIVATE: _S.VENTED,
        _E.VENT: _S.VENTED,
        _E.FAULT: _S.FAULT,
        _E.CLEAR_FAULTS: _S.ACTIVE,
        _E.CLEANUP: _S.UNCONFIGURED,
    },
    _S.FAULT: {
        _E.CONFIGURE: _S.FAULT,
        _E.ACTIVATE: _S.FAULT,
        _E.COMMAND: _S.FAULT,
        _E.DEACTIVATE: _S.FAULT,
        _E.VENT: _S.FAULT,
        _E.FAULT: _S.FAULT,
        _E.CLEAR_FAULTS: _S.VENTED,
        _E.CLEANUP: _S.UNCONFIGURED,
    },
}


def next_state(state: SafetyState, event: SafetyEvent) -> SafetyState:
    """The state after an event, from the table."""
    return TRANSITIONS[state][event]


def table_as_markdown() -> str:
    """The table as docs/driver.md shows it; a dot means that the state stays."""
    events = list(SafetyEvent)
    lines = [
        "| state | air | " + " | ".join(event.value for event in events) + " |",
        "|---" * (len(events) + 2) + "|",
    ]
    for state, row in TRANSITIONS.items():
        cells = [
            "."
            if row[event] is state
            else f"**{row[event].value}**"
            if row[event] is SafetyState.ACTIVE
            else row[event].value
            for event in events
        ]
        air = "moves" if OUTPUTS[state].enable else "vented"
        lines.append(f"| {state.value} | {air} | " + " | ".join(cells) + " |")
    return "\n".join(lines)
