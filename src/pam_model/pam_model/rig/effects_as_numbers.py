"""One spelling of a rig: an effect that only changes written numbers becomes these numbers.

A rig file may state a load as the effect `payload` or in `inertia` and `gravity_torque`. Whoever
reads a file gets the second form, so that both spellings are the same rig to every tool: numbers,
their tolerances, and what a diagnosis or a calibration changes are those that hold.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

from pam_model.effects import EFFECTS, Effect, EffectValues, adjusted
from pam_model.effects.slots import TARGETS, Adjusts
from pam_model.errors import RigError
from pam_model.rig.types import Joint, Muscle, Rig, Valve

_OWNERS: dict[str, type[Joint | Muscle | Valve]] = {"joint": Joint, "valve": Valve, "": Muscle}


def written_number(target: str) -> tuple[type[Joint | Muscle | Valve], str] | None:
    """The class and the field that a rig file states for a target; None if it states none."""
    section, _, key = target.rpartition(".")
    owner = _OWNERS.get(section)
    if owner is None or key not in {one.name for one in fields(owner)}:
        return None
    return owner, key


def only_changes_numbers(effect: Effect) -> bool:
    """Whether an effect does nothing but change numbers that a rig file states."""
    return all(isinstance(slot, Adjusts) and written_number(slot.target) for slot in effect.slots)


def effects_as_numbers(rig: Rig) -> Rig:
    """The same robot with every effect that only changes written numbers as these numbers.

    Parameters
    ----------
    rig : Rig
        As a file states it, or as a program made it.

    Raises
    ------
    RigError
        If an effect leads to a number that a rig file may not have; the text names both.
    """
    joints = tuple(
        replace(one, **_changed(one, one.effects), effects=_rest(one.effects)) for one in rig.joints
    )
    muscles = tuple(
        replace(
            one,
            **_changed(one, one.effects),
            valve=replace(one.valve, **_changed(one.valve, one.effects, f"{one.name}.")),
            effects=_rest(one.effects),
        )
        for one in rig.muscles
    )
    return replace(rig, joints=joints, muscles=muscles)


def number_with_effects(rig: Rig, key: str, value: float) -> float:
    """What a number, or an end of its range, is in the rig that `effects_as_numbers` returns.

    Parameters
    ----------
    rig : Rig
        As a file states it.
    key : str
        Of the number in the rig file, such as "elbow.inertia".
    value : float
        The number in the unit of its key.
    """
    owner, _, rest = key.partition(".")
    if owner in rig.joint_names:
        part: Joint | Muscle = rig.joint(owner)
        target = f"joint.{rest}"
    elif owner in rig.muscle_names:
        part, target = rig.muscle(owner), rest
    else:
        return value
    return adjusted(target, value, _merges(part.effects)) if target in TARGETS else value


def _merges(effects: EffectValues) -> dict[str, Any]:
    return {name: each for name, each in effects.items() if only_changes_numbers(EFFECTS[name])}


def _rest(effects: EffectValues) -> dict[str, Any]:
    return {name: each for name, each in effects.items() if name not in _merges(effects)}


def _changed(
    part: Joint | Muscle | Valve, effects: EffectValues, owner: str = ""
) -> dict[str, Any]:
    """The numbers of a part of the rig after its effects.

    Raises
    ------
    RigError
        For a number out of the bounds of its field.
    """
    merged = _merges(effects)
    changed: dict[str, Any] = {}
    for target in TARGETS:
        found = written_number(target)
        if found is None or found[0] is not type(part):
            continue
        key, written = found[1], getattr(part, found[1])
        value = adjusted(target, written, merged)
        if value == written:
            continue
        changed[key] = value
        only_this: dict[str, Any] = {key: value}
        try:
            replace(part, **only_this)
        except RigError as error:
            by = ", ".join(
                name
                for name in merged
                if any(getattr(slot, "target", "") == target for slot in EFFECTS[name].slots)
            )
            raise RigError(f"{owner}{error}, with the effect {by}") from None
    return changed
