"""The driver's states, its stop categories and the faults as docs/safety_tables.md shows them.

The diagram is Mermaid text, which code hosts and most Markdown viewers draw.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from pam_check.doc_pages.markdown import table
from pam_check.fault_kinds.fault_kind import STOPS, FaultKind
from pam_driver.safety.states import LAMPS, OUTPUTS, TRANSITIONS, SafetyEvent, SafetyState
from pam_driver.safety.stop_categories import STOP_CATEGORIES


def diagram_as_mermaid() -> str:
    """Every transition of the table that changes the state; states in which air moves are bold."""
    lines = ["```mermaid", "stateDiagram-v2", f"    [*] --> {SafetyState.UNCONFIGURED.value}"]
    for state, output in OUTPUTS.items():
        lines.append(f"    {state.value} : {state.value}")
        lines.append(f"    {state.value} : {output.meaning.replace(';', ',')}")
    for state, row in TRANSITIONS.items():
        causes: dict[SafetyState, list[str]] = {}
        for event, target in row.items():
            if target is not state:
                causes.setdefault(target, []).append(event.value)
        for target, events in causes.items():
            lines.append(f"    {state.value} --> {target.value} : {', '.join(events)}")
    moving = [state.value for state, output in OUTPUTS.items() if output.enable]
    lines.append("    classDef air stroke-width:4px,font-weight:bold")
    return "\n".join([*lines, f"    class {','.join(moving)} air", "```"])


def _air_in(state: SafetyState) -> str:
    """In which way air may move in a state."""
    output = OUTPUTS[state]
    return "in and out" if output.enable else "only out, slowly" if output.lower else "only out"


def _after(state: SafetyState, event: SafetyEvent) -> str:
    """The cell of an event: the next state, bold where air may enter; a dot for no change."""
    target = TRANSITIONS[state][event]
    name = f"**{target.value}**" if OUTPUTS[target].enable else target.value
    return "." if target is state else name


def states_table() -> str:
    """The next state by state and event."""
    rows = [
        ["*air moves*", *(f"*{_air_in(state)}*" for state in SafetyState)],
        ["*lamp*", *(f"*{LAMPS[state]}*" for state in SafetyState)],
    ]
    for event in SafetyEvent:
        rows.append([event.value, *(_after(state, event) for state in SafetyState)])
    return table(["event", *(f"in {state.value}" for state in SafetyState)], rows)


def categories_table() -> str:
    """The stop category of every fault, and why."""
    rows = []
    for kind, category in sorted(
        STOP_CATEGORIES.items(), key=lambda item: (-item[1].number, item[0])
    ):
        time = f", for {category.longest:g} s" if math.isfinite(category.longest) else ""
        rows.append((f"`{kind}`", f"{category.number}{time}", category.reason))
    return table(("fault", "stop category", "why"), rows)


def faults_table(kinds: Sequence[FaultKind]) -> str:
    """What each fault must lead to, and how fast."""
    rows: list[tuple[str, ...]] = []
    layer = ""
    for kind in kinds:
        if kind.layer != layer:
            layer = kind.layer
            rows.append((f"**{layer}**", "", "", "", ""))
        within = f"{1e3 * kind.bound:.0f} ms" if kind.reaction in STOPS else ""
        rows.append((f"`{kind.name}`", kind.text, kind.reaction.value, within, kind.reason))
    return table(("fault", "what happens", "must follow", "within", "by"), rows)
