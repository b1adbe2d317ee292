"""The driver's table of states drawn as a diagram, for the documentation.

The diagram is Mermaid text, which code hosts and most Markdown viewers draw. docs/safety_tables.md
has the same text, written by `python -m pam_sim fault-tables docs/safety_tables.md`; a test
compares the two.
"""

from __future__ import annotations

from pam_driver.safety.states import OUTPUTS, TRANSITIONS, SafetyState


def diagram_as_mermaid() -> str:
    """Every transition of the table that changes the state; states in which air moves are bold."""
    lines = ["stateDiagram-v2", f"    [*] --> {SafetyState.UNCONFIGURED.value}"]
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
    lines.append(f"    class {','.join(moving)} air")
    return "\n".join(lines)
