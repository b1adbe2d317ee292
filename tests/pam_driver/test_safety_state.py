"""The table of states and events, walked in every direction."""

from __future__ import annotations

from collections import deque
from pathlib import Path

import pytest

from pam_driver.safety.states import (
    OUTPUTS,
    TRANSITIONS,
    SafetyEvent,
    SafetyState,
    next_state,
    table_as_markdown,
)

AIR = {state for state, output in OUTPUTS.items() if output.enable}


def paths_to_air(start: SafetyState) -> list[tuple[SafetyEvent, ...]]:
    """Shortest sequences of events that first let air move, without repeating a state."""
    found = []
    waiting = deque([(start, (), {start})])
    while waiting:
        state, events, seen = waiting.popleft()
        for event in SafetyEvent:
            target = next_state(state, event)
            if target in AIR:
                found.append((*events, event))
            elif target not in seen:
                waiting.append((target, (*events, event), seen | {target}))
    return found


def test_every_state_reacts_to_every_event() -> None:
    assert set(TRANSITIONS) == set(OUTPUTS) == set(SafetyState)
    for row in TRANSITIONS.values():
        assert set(row) == set(SafetyEvent)


def test_air_moves_in_active_alone() -> None:
    assert {SafetyState.ACTIVE} == AIR


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
        assert state is SafetyState.READY or SafetyEvent.ACTIVATE in path


def test_a_fault_is_left_by_clear_faults_then_activate_then_command() -> None:
    order = [SafetyEvent.CLEAR_FAULTS, SafetyEvent.ACTIVATE, SafetyEvent.COMMAND]
    for path in paths_to_air(SafetyState.FAULT):
        if SafetyEvent.CLEANUP in path:  # the bus was given back and opened anew
            order = [SafetyEvent.CLEANUP, SafetyEvent.CONFIGURE, *order[1:]]
        places = [path.index(event) for event in order]
        assert places == sorted(places)


@pytest.mark.parametrize("state", [SafetyState.READY, SafetyState.ACTIVE])
def test_a_fault_is_latched_wherever_air_may_move(state: SafetyState) -> None:
    assert next_state(state, SafetyEvent.FAULT) is SafetyState.FAULT


@pytest.mark.parametrize("state", SafetyState)
def test_the_boards_are_told_when_air_stops(state: SafetyState) -> None:
    for event in SafetyEvent:
        target = next_state(SafetyState.ACTIVE, event)
        if target is not SafetyState.ACTIVE:
            assert OUTPUTS[target].vent_on_entry


def test_the_documentation_shows_this_table() -> None:
    page = (Path(__file__).parents[2] / "docs/driver.md").read_text()
    assert table_as_markdown() in page
