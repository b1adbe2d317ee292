"""The effects that a decision names, and the sets that the data do not distinguish."""

from __future__ import annotations

from collections.abc import Sequence

from pam_gap.inference.decision import Decision, strongest_first
from pam_gap.inference.score import Score


def named_effects[S: Score](
    decision: Decision[S], singles: Sequence[str]
) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """The effects that a decision names, and the sets within which the data do not distinguish."""
    if decision.chosen is None or not decision.is_named:
        return (), ()
    own = strongest_first(decision.chosen.causes, singles)
    others: list[str] = []
    groups: list[tuple[str, ...]] = []
    for rival in decision.rivals:
        missing = [e for e in own if e not in rival.causes]
        new = [e for e in rival.causes if e not in own]
        others += new
        groups.append((*missing, *new))
    return tuple(dict.fromkeys((*own, *others))), merged_groups(groups)


def merged_groups(groups: Sequence[tuple[str, ...]]) -> tuple[tuple[str, ...], ...]:
    """Groups with a common member merged into one."""
    merged: list[list[str]] = []
    for group in groups:
        home = next((m for m in merged if set(m) & set(group)), None)
        if home is None:
            merged.append(list(dict.fromkeys(group)))
        else:
            home += [e for e in group if e not in home]
    return tuple(tuple(group) for group in merged)
