"""What the driver may do, as one table: next state by state and event, and output by state.

The table is data, so that the documentation is generated from it and the tests can check every
entry. A fault always ends `ACTIVE` at once. The way back is: clear faults, measured empty, then
activate, then a fresh command.

A stop has a category as in IEC 60204-1, section 9.2.2; `stop_categories` says which fault has
which. Category 0 vents at once. Category 1 lowers the joints first (`lowering`), then vents.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Final, NamedTuple


class SafetyState(Enum):
    """State of the driver; the topic and the diagnostics show the value."""

    # of the one object that each member is: Enum's own hash is a call of Python in every look-up
    __hash__ = object.__hash__

    UNCONFIGURED = "unconfigured"
    VENTING = "venting"
    VENTED = "vented"
    CHECKING = "checking"
    READY = "ready"
    ACTIVE = "active"
    LOWERING = "lowering"
    FAULT_LOWERING = "fault_lowering"
    FAULT = "fault"


class SafetyEvent(Enum):
    """Events that may change the state."""

    __hash__ = object.__hash__  # as of `SafetyState`

    CONFIGURE = "configure"
    EMPTY = "all muscles empty"
    NOT_EMPTY = "a muscle not empty"
    EXHAUST_BLOCKED = "exhaust blocked"
    CHECK = "activate with start-up check"
    CHECKED = "start-up check passed"
    ACTIVATE = "activate"
    COMMAND = "command"
    DEACTIVATE = "deactivate"
    VENT = "vent"
    LOWERED = "lowered"
    FAULT_LOWER = "fault of category 1"
    FAULT = "fault of category 0"
    LATCHED_FAULT = "latched fault"
    CLEAR_FAULTS = "clear faults"
    CLEANUP = "clean up"


class SafetyOutput(NamedTuple):
    """What the driver sends to the boards in a state."""

    send: bool  # whether each board receives a valve command in each cycle
    enable: bool  # whether the valves follow the commands, so that air may enter a muscle
    # whether the driver itself lowers the joints: the enable bits are set, but no set point lets
    # air into a muscle
    lower: bool
    # whether each board receives the board command `vent` when the state is entered
    vent_on_entry: bool
    latch: bool  # whether each board that can keep a fault of the driver is asked to keep it
    meaning: str  # one line for the documentation


_S = SafetyState

OUTPUTS: Final[Mapping[SafetyState, SafetyOutput]] = {
    _S.UNCONFIGURED: SafetyOutput(
        False, False, False, True, False, "no bus; the boards' watchdogs keep the valves vented"
    ),
    _S.VENTING: SafetyOutput(
        True, False, False, True, False, "all valves vent; a muscle is not measured empty yet"
    ),
    _S.VENTED: SafetyOutput(
        True, False, False, False, False, "all valves vent; every muscle is measured empty"
    ),
    _S.CHECKING: SafetyOutput(
        True, True, False, False, False, "a small test pulse on each valve; no command is taken"
    ),
    _S.READY: SafetyOutput(
        True, False, False, False, False, "armed; vented until the first fresh command"
    ),
    _S.ACTIVE: SafetyOutput(True, True, False, False, False, "valves follow the commands"),
    _S.LOWERING: SafetyOutput(
        True, False, True, False, False, "air leaves the muscles so that the joints sink slowly"
    ),
    _S.FAULT_LOWERING: SafetyOutput(
        True,
        False,
        True,
        False,
        False,
        "as lowering, after a fault of category 1, which is latched",
    ),
    _S.FAULT: SafetyOutput(True, False, False, True, True, "latched; all valves vent"),
}


def _row(state: SafetyState, **changes: SafetyState) -> Mapping[SafetyEvent, SafetyState]:
    """The next states from `state`; an event that is not named changes nothing."""
    return {event: changes.get(event.name, state) for event in SafetyEvent}


TRANSITIONS: Final[Mapping[SafetyState, Mapping[SafetyEvent, SafetyState]]] = {
    _S.UNCONFIGURED: _row(_S.UNCONFIGURED, CONFIGURE=_S.VENTING),
    # Nothing moves while vented or venting, so no fault is latched; a condition that persists
    # prevents activation. An exhaust that is blocked is latched: the air has to be let out by hand.
    # What a board or a person has latched holds in every state.
    _S.VENTING: _row(
        _S.VENTING,
        EMPTY=_S.VENTED,
        EXHAUST_BLOCKED=_S.FAULT,
        LATCHED_FAULT=_S.FAULT,
        CLEANUP=_S.UNCONFIGURED,
    ),
    _S.VENTED: _row(
        _S.VENTED,
        NOT_EMPTY=_S.VENTING,
        CHECK=_S.CHECKING,
        ACTIVATE=_S.READY,
        LATCHED_FAULT=_S.FAULT,
        CLEANUP=_S.UNCONFIGURED,
    ),
    _S.CHECKING: _row(
        _S.CHECKING,
        CHECKED=_S.READY,
        DEACTIVATE=_S.VENTING,
        VENT=_S.VENTING,
        FAULT_LOWER=_S.FAULT,
        FAULT=_S.FAULT,
        LATCHED_FAULT=_S.FAULT,
        CLEANUP=_S.UNCONFIGURED,
    ),
    _S.READY: _row(
        _S.READY,
        COMMAND=_S.ACTIVE,
        DEACTIVATE=_S.VENTING,
        VENT=_S.VENTING,
        FAULT_LOWER=_S.FAULT,
        FAULT=_S.FAULT,
        LATCHED_FAULT=_S.FAULT,
        CLEANUP=_S.UNCONFIGURED,
    ),
    _S.ACTIVE: _row(
        _S.ACTIVE,
        DEACTIVATE=_S.LOWERING,
        VENT=_S.LOWERING,
        FAULT_LOWER=_S.FAULT_LOWERING,
        FAULT=_S.FAULT,
        LATCHED_FAULT=_S.FAULT,
        CLEANUP=_S.UNCONFIGURED,
    ),
    # A second call of vent is for someone who cannot wait for the end of the lowering.
    _S.LOWERING: _row(
        _S.LOWERING,
        LOWERED=_S.VENTING,
        VENT=_S.VENTING,
        FAULT_LOWER=_S.FAULT_LOWERING,
        FAULT=_S.FAULT,
        LATCHED_FAULT=_S.FAULT,
        CLEANUP=_S.UNCONFIGURED,
    ),
    _S.FAULT_LOWERING: _row(
        _S.FAULT_LOWERING,
        LOWERED=_S.FAULT,
        VENT=_S.FAULT,
        FAULT=_S.FAULT,
        LATCHED_FAULT=_S.FAULT,
        CLEANUP=_S.UNCONFIGURED,
    ),
    _S.FAULT: _row(_S.FAULT, CLEAR_FAULTS=_S.VENTING, CLEANUP=_S.UNCONFIGURED),
}


FAULTY: Final = frozenset({_S.FAULT, _S.FAULT_LOWERING})
"""States in which a fault is latched."""
MOVING: Final = frozenset({_S.CHECKING, _S.READY, _S.ACTIVE})
"""States of an active driver."""


LAMPS: Final[Mapping[SafetyState, str]] = {
    _S.UNCONFIGURED: "off",
    _S.VENTING: "yellow",
    _S.VENTED: "green",
    _S.CHECKING: "yellow",
    _S.READY: "yellow",
    _S.ACTIVE: "yellow",
    _S.LOWERING: "yellow",
    _S.FAULT_LOWERING: "red",
    _S.FAULT: "red",
}
"""Colour of the operator's lamp, after IEC 60073.

Red: a fault is latched. Yellow: caution, the joints move or may move, or a muscle still holds air.
Green: every muscle is measured empty. Off: the driver measures nothing, which is no promise.
"""


def next_state(state: SafetyState, event: SafetyEvent) -> SafetyState:
    """The state after an event, from the table."""
    return TRANSITIONS[state][event]
