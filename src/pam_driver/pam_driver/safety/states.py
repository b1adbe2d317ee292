"""What the driver may do, as one table: next state by state and event, and output by state.

The table is data, so that the documentation is generated from it and the tests can check every
entry. A fault always ends `ACTIVE` at once. The way back is: clear faults, then activate, then a
fresh command.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Final, NamedTuple


class SafetyState(Enum):
    """State of the driver; the diagnostics show the value."""

    UNCONFIGURED = "unconfigured"
    VENTED = "vented"
    READY = "ready"
    ACTIVE = "active"
    FAULT = "fault"


class SafetyEvent(Enum):
    """Events that may change the state."""

    CONFIGURE = "configure"
    ACTIVATE = "activate"
    COMMAND = "command"
    DEACTIVATE = "deactivate"
    VENT = "vent"
    FAULT = "fault"
    LATCHED_FAULT = "latched fault"
    CLEAR_FAULTS = "clear faults"
    CLEANUP = "clean up"


class SafetyOutput(NamedTuple):
    """What the driver sends to the boards in a state.

    Attributes
    ----------
    send : bool
        Whether each board receives a valve command in each cycle.
    enable : bool
        The enable bits of that command: whether air may move.
    vent_on_entry : bool
        Whether each board receives the board command `vent` when the state is entered.
    latch : bool
        Whether each board that can keep a fault of the driver is told to keep it.
    meaning : str
        One line for the documentation.
    """

    send: bool
    enable: bool
    vent_on_entry: bool
    latch: bool
    meaning: str


_S = SafetyState
_E = SafetyEvent

OUTPUTS: Final[Mapping[SafetyState, SafetyOutput]] = {
    _S.UNCONFIGURED: SafetyOutput(
        False, False, True, False, "no bus; the boards' watchdogs keep the valves vented"
    ),
    _S.VENTED: SafetyOutput(True, False, True, False, "measuring; all valves vent"),
    _S.READY: SafetyOutput(
        True, False, False, False, "armed; vented until the first fresh command"
    ),
    _S.ACTIVE: SafetyOutput(True, True, False, False, "valves follow the commands"),
    _S.FAULT: SafetyOutput(True, False, True, True, "latched; all valves vent"),
}

TRANSITIONS: Final[Mapping[SafetyState, Mapping[SafetyEvent, SafetyState]]] = {
    _S.UNCONFIGURED: {
        _E.CONFIGURE: _S.VENTED,
        _E.ACTIVATE: _S.UNCONFIGURED,
        _E.COMMAND: _S.UNCONFIGURED,
        _E.DEACTIVATE: _S.UNCONFIGURED,
        _E.VENT: _S.UNCONFIGURED,
        _E.FAULT: _S.UNCONFIGURED,
        _E.LATCHED_FAULT: _S.UNCONFIGURED,
        _E.CLEAR_FAULTS: _S.UNCONFIGURED,
        _E.CLEANUP: _S.UNCONFIGURED,
    },
    _S.VENTED: {
        _E.CONFIGURE: _S.VENTED,
        _E.ACTIVATE: _S.READY,
        _E.COMMAND: _S.VENTED,
        _E.DEACTIVATE: _S.VENTED,
        _E.VENT: _S.VENTED,
        # nothing moves, so no fault is latched; a condition that persists prevents activation
        _E.FAULT: _S.VENTED,
        # told by a board or a person, so it holds even where nothing moves
        _E.LATCHED_FAULT: _S.FAULT,
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
        _E.LATCHED_FAULT: _S.FAULT,
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
        _E.LATCHED_FAULT: _S.FAULT,
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
        _E.LATCHED_FAULT: _S.FAULT,
        _E.CLEAR_FAULTS: _S.VENTED,
        _E.CLEANUP: _S.UNCONFIGURED,
    },
}


def next_state(state: SafetyState, event: SafetyEvent) -> SafetyState:
    """The state after an event, from the table."""
    return TRANSITIONS[state][event]


def table_as_markdown() -> str:
    """The table as docs/driver.md shows it; a dot means that the state does not change."""
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
