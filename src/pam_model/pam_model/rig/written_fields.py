"""How the parts of a rig are written into a rig file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any

from pam_model.effects import EffectValues


def effects_of(effects: EffectValues) -> dict[str, dict[str, float]]:
    """Effects as plain nested mappings."""
    return {effect: dict(values) for effect, values in effects.items()}


def fields_of(part: Any) -> dict[str, Any]:
    """The fields of a part (a dataclass), without its name and without empty fields."""
    tree: dict[str, Any] = {}
    for key in part.__dataclass_fields__:
        value = getattr(part, key)
        if key == "name" or value is None or value == {}:
            continue
        if is_dataclass(value):
            value = fields_of(value)
        elif key == "effects":
            value = effects_of(value)
        elif isinstance(value, Mapping):
            value = dict(value)
        elif isinstance(value, tuple):
            value = list(value)
        tree[key] = value
    return tree
