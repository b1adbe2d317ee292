"""Effects that the ideal rig does not have: one file per effect, and their registry."""

from pam_model.effects.declaration import Effect, EffectError
from pam_model.effects.parts import (
    Correction,
    Delay,
    EffectParameter,
    EffectValues,
    Included,
    Inverse,
    Lead,
    Nothing,
    Portrait,
    Range,
    RigScales,
    Scope,
    Search,
    Stage,
    TorqueFeedforward,
)
from pam_model.effects.registry import EFFECTS, active, adjusted, effect_value, filled

__all__ = [
    "EFFECTS",
    "Correction",
    "Delay",
    "Effect",
    "EffectError",
    "EffectParameter",
    "EffectValues",
    "Included",
    "Inverse",
    "Lead",
    "Nothing",
    "Portrait",
    "Range",
    "RigScales",
    "Scope",
    "Search",
    "Stage",
    "TorqueFeedforward",
    "active",
    "adjusted",
    "effect_value",
    "filled",
]
