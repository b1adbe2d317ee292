"""What the ideal rig leaves out: the effects by name, with parameters, laws and sources."""

from pam_model.effects.registry import (
    EFFECTS,
    Effect,
    EffectParameter,
    EffectValues,
    Scope,
    Stage,
    effect_value,
)

__all__ = [
    "EFFECTS",
    "Effect",
    "EffectParameter",
    "EffectValues",
    "Scope",
    "Stage",
    "effect_value",
]
