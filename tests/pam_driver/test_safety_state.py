"""The table of states and events, walked in every direction."""

from __future__ import annotations

from collections import deque

import pytest

from pam_driver.safety.states import (
    FAULTY,
    LAMPS,
    OUTPUTS,
    TRANSITIONS,
    SafetyEvent,
    SafetyState,
    next_state,
)

AIR = {state for state, output in OUTPUTS.items() if output.enable}
CHECKED = {SafetyState.CHECKING}  # air moves without a command, in small test pulses
OPEN = {state for state, output in OUTPUTS.items() if output.enable or output.lower}


def paths_to_air(start: SafetyState) -> list[tuple[SafetyEvent, ...]]:
    """Shortest sequences of events that first let air move, without repeating a state."""
    found = []
    waiting = deque([(start, (), {start})])
    while waiting:
        state, events, seen = waiting.popleft()
        for event in SafetyEvent:
            target = next_state(state, event)
            if target in AIR - CHECKED:
                found.append((*events, event))
            elif target not in seen:
                waiting.append((target, (*events, event), seen | {target}))
    return found


def test_every_state_reacts_to_every_event() -> None:
    assert set(TRANSITIONS) == set(OUTPUTS) == set(SafetyState)
    for row in TRANSITIONS.values():
        assert set(row) == set(SafetyEvent)


def test_air_moves_in_active_and_in_the_check_alone() -> None:
    assert {SafetyState.ACTIVE, SafetyState.CHECKING} == AIR


def test_the_lamp_promises_safety_only_where_every_muscle_is_measured_empty() -> None:
    """Green is for `vented` alone, red for every latched fault and for nothing else."""
    assert set(LAMPS) == set(SafetyState)
    assert {state for state, colour in LAMPS.items() if colour == "green"} == {SafetyState.VENTED}
    assert {state for state, colour in LAMPS.items() if colour == "red"} == FAULTY
    assert {LAMPS[state] for state in OPEN} == {"yellow", "red"}


def test_the_check_begins_with_an_activation_and_ends_before_a_command() -> None:
    into = {
        (state, event) for state in SafetyState for event in SafetyEvent
        if next_state(state, event) in CHECKED and state not in CHECKED
    }  # fmt: skip
    assert into == {(SafetyState.VENTED, SafetyEvent.CHECK)}
    assert next_state(SafetyState.CHECKING, SafetyEvent.COMMAND) is SafetyState.CHECKING
    assert next_state(SafetyState.CHECKING, SafetyEvent.CHECKED) is SafetyState.READY


@pytest.mark.parametrize("state", SafetyState)
@pytest.mark.parametrize("event", [SafetyEvent.VENT, SafetyEvent.FAULT, SafetyEvent.DEACTIVATE])
def test_one_event_vents_from_every_state(state: SafetyState, event: SafetyEvent) -> None:
    assert next_state(state, event) not in AIR


@pytest.mark.parametrize("state", SafetyState)
def test_air_needs_activation_then_a_command(state: SafetyState) -> None:
    if state in AIR:
        return
    paths = paths_to_air(state)
    assert paths
    for path in paths:
        assert path[-1] is SafetyEvent.COMMAND
        assert state is SafetyState.READY or {SafetyEvent.ACTIVATE, SafetyEvent.CHECK} & {*path}


def test_a_fault_is_left_by_clear_faults_empty_activate_and_command() -> None:
    order = [
        SafetyEvent.CLEAR_FAULTS,
        SafetyEvent.EMPTY,
        SafetyEvent.ACTIVATE,
        SafetyEvent.COMMAND,
    ]
    for path in paths_to_air(SafetyState.FAULT):
        order[-2] = SafetyEvent.CHECK if SafetyEvent.CHECK in path else SafetyEvent.ACTIVATE
        if SafetyEvent.CLEANUP in path:  # the bus was given back and opened anew
            order[:1] = [SafetyEvent.CLEANUP, SafetyEvent.CONFIGURE]
        places = [path.index(event) for event in order]
        assert places == sorted(places)


@pytest.mark.parametrize("state", [SafetyState.READY, *sorted(OPEN, key=lambda s: s.value)])
def test_a_fault_is_latched_wherever_air_may_move(state: SafetyState) -> None:
    assert next_state(state, SafetyEvent.FAULT) is SafetyState.FAULT
    if state not in CHECKED | {SafetyState.READY}:
        assert next_state(state, SafetyEvent.FAULT_LOWER) is SafetyState.FAULT_LOWERING


@pytest.mark.parametrize("state", sorted(OPEN, key=lambda s: s.value))
def test_the_boards_are_told_when_air_stops(state: SafetyState) -> None:
    """Lowering still moves air, but only out; every other way out tells the boards to vent."""
    for event in SafetyEvent:
        target = next_state(state, event)
        checked = event is SafetyEvent.CHECKED  # the check ends with valves that vent
        if target is not state and not OUTPUTS[target].lower and not checked:
            assert OUTPUTS[target].vent_on_entry


def test_only_measured_emptiness_leads_to_vented_and_only_vented_to_ready() -> None:
    into = {
        target: {(state, event) for state in SafetyState for event in SafetyEvent
                 if next_state(state, event) is target and state is not target}
        for target in (SafetyState.VENTED, SafetyState.READY)
    }  # fmt: skip
    assert into[SafetyState.VENTED] == {(SafetyState.VENTING, SafetyEvent.EMPTY)}
    assert into[SafetyState.READY] == {
        (SafetyState.VENTED, SafetyEvent.ACTIVATE),
        (SafetyState.CHECKING, SafetyEvent.CHECKED),
    }


@pytest.mark.parametrize("state", [SafetyState.LOWERING, SafetyState.FAULT_LOWERING])
def test_lowering_ends_vented_and_never_lets_air_in_again(state: SafetyState) -> None:
    assert OUTPUTS[state].lower and not OUTPUTS[state].enable
    for event in (SafetyEvent.LOWERED, SafetyEvent.VENT, SafetyEvent.FAULT):
        output = OUTPUTS[next_state(state, event)]
        assert not output.enable and not output.lower
    for event in (SafetyEvent.ACTIVATE, SafetyEvent.COMMAND, SafetyEvent.CLEAR_FAULTS):
        assert next_state(state, event) is state


def test_a_blocked_exhaust_is_latched() -> None:
    assert next_state(SafetyState.VENTING, SafetyEvent.EXHAUST_BLOCKED) is SafetyState.FAULT
