"""The improved rig file: the rig with the effects found and the re-tuned nominal parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pam_gap.inference.hypothesis import Hypothesis
from pam_model.effects import EFFECTS
from pam_model.plant.joint_muscles import SIDES
from pam_model.plant.parameters import RIG_PLACES, RigPlace
from pam_model.rig import Joint, Muscle, Rig, Valve


def _merged(
    effects: Mapping[str, Mapping[str, float]], effect: str, values: Mapping[str, float]
) -> dict[str, dict[str, float]]:
    result = {name: dict(given) for name, given in effects.items()}
    result[effect] = {**result.get(effect, {}), **values}
    return result


def _changed[Part: (Rig, Joint, Muscle, Valve)](
    part: Part, key: str, value: float, is_factor: bool
) -> Part:
    """A copy of a part of the rig with one number set or multiplied."""
    changes: dict[str, Any] = {key: getattr(part, key) * value if is_factor else value}
    return replace(part, **changes)


def with_number(rig: Rig, joint: str, name: str, value: float, is_factor: bool = False) -> Rig:
    """A copy of the rig with one plant parameter written to its place in the rig file."""
    owner, place = rig.joint(joint), RIG_PLACES[name]
    if place.section == "effect":
        return _with_effect(rig, owner, place, value)
    if place.section == "joint":
        return rig.with_joint(_changed(owner, place.key, value, is_factor))
    if place.side:
        muscle = rig.muscle(owner.muscles[SIDES.index(place.side)])
        if place.section == "valve":
            valve = _changed(muscle.valve, place.key, value, is_factor)
            return rig.with_muscle(replace(muscle, valve=valve))
        return rig.with_muscle(_changed(muscle, place.key, value, is_factor))
    return _changed(rig, place.key, value, is_factor)


def _with_effect(rig: Rig, owner: Joint, place: RigPlace, value: float) -> Rig:
    values = {place.key: value}
    if place.side:
        muscle = rig.muscle(owner.muscles[SIDES.index(place.side)])
        return rig.with_muscle(
            replace(muscle, effects=_merged(muscle.effects, place.effect, values))
        )
    if EFFECTS[place.effect].scope == "joint":
        return rig.with_joint(replace(owner, effects=_merged(owner.effects, place.effect, values)))
    return replace(rig, effects=_merged(rig.effects, place.effect, values))


def improve_rig(
    rig: Rig,
    joint: int,
    hypothesis: Hypothesis,
    targets: list[tuple[str, ...]],
    is_factor: list[bool],
) -> Rig:
    """A rig that simulation, model node and controller can read in place of the written one.

    Parameters
    ----------
    rig : Rig
        The rig as its file describes it.
    joint : int
        Number of the diagnosed joint.
    hypothesis : Hypothesis
        The fitted hypothesis.
    targets, is_factor : list
        Targets of its parameters, from `HypothesisFitter.problem_parts`.
    """
    name = rig.joints[joint].name
    improved = rig
    for group, factor, value in zip(
        targets, is_factor, hypothesis.result.values.tolist(), strict=True
    ):
        for path in group:
            improved = with_number(improved, name, path, float(value), factor)
    return improved
