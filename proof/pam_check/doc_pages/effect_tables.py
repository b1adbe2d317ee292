"""The tables of effects, generated from the registry."""

from __future__ import annotations

from pam_check.doc_pages.markdown import table
from pam_model.effects import EFFECTS, Effect, EffectParameter


def _parameter(key: str, entry: EffectParameter) -> str:
    numbers = f"{entry.unit}, {entry.neutral:g}, {entry.low:g}, {entry.high:g}"
    return f"`{key}` ({entry.symbol}): {numbers}; {entry.description}"


def _row(effect: Effect) -> tuple[str, ...]:
    parameters = "<br>".join(_parameter(key, entry) for key, entry in effect.parameters.items())
    return f"`{effect.name}`", effect.stage, f"{effect.description}: {effect.law}", parameters


def keys_table(scope: str) -> str:
    """The keys that a rig file may have at a muscle, a joint or the rig."""
    head = ("effect", "stage", "what it is", "parameters: unit, neutral, from, to; meaning")
    return table(head, [_row(effect) for effect in EFFECTS.values() if effect.scope == scope])


def control_table() -> str:
    """What the controller does about each effect."""
    rows = [(f"`{effect.name}`", effect.control.how) for effect in EFFECTS.values()]
    return table(("effect", "what the controller does"), rows)
