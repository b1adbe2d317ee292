"""The driver's states and stop categories as docs/safety_tables.md shows them.

The page is written by `pam check fault-tables docs/safety_tables.md`; a test compares the
two. The diagram is Mermaid text, which code hosts and most Markdown viewers draw.
"""

from __future__ import annotations

import math

from pam_driver.safety.states import OUTPUTS, TRANSITIONS, SafetyState
from pam_driver.safety.stop_categories import STOP_CATEGORIES


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


def categories_as_markdown() -> str:
    """The stop category of every fault, and why."""
    lines = ["| fault | stop category | why |", "|---|---|---|"]
    for kind, category in sorted(
        STOP_CATEGORIES.items(), key=lambda item: (-item[1].number, item[0])
    ):
        number = f"{category.number}"
        if math.isfinite(category.longest):
            number += f", for {category.longest:g} s"
        lines.append(f"| `{kind}` | {number} | {category.reason} |")
    return "\n".join(lines)
