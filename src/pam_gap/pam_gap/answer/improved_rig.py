"""The rig file with what was found in it: effects and re-tuned nominal parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pam_gap.inference.hypothesis import Hypothesis
from pam_model.effects import EFFECTS
from pam_model.rig import Joint, Muscle, Rig


def _merged(
    effects: Mapping[str, Mapping[str, float]], effect: str, values: Mapping[str, float]
) -> dict[str, dict[str, float]]:
    result = {name: dict(given) for name, given in effects.items()}
    result[effect] = {**result.get(effect, {}), **values}
    return result


def _set(rig: Rig, joint: str, path: str, value: float, is_factor: bool) -> Rig:
    """A copy of the rig with one plant parameter written to where a rig file keeps it."""
    owner = rig.joint(joint)
    head, _, rest = path.partition(".")
    if head in ("agonist", "antagonist"):
        muscle: Muscle = rig.muscle(owner.muscles[0 if head == "agonist" else 1])
        first, _, key = rest.partition(".")
        if key and first in EFFECTS:  # dead_volume is a parameter and an effect
            return rig.with_muscle(
                replace(muscle, effects=_merged(muscle.effects, first, {key: value}))
            )
        part: Any = muscle.valve if first == "valve" else muscle
        field = key if first == "valve" else first
        changed = replace(part, **{field: getattr(part, field) * value if is_factor else value})
        return rig.with_muscle(replace(muscle, valve=changed) if first == "valve" else changed)
    if head == "joint":
        changed_joint: Joint = replace(
            owner,
            **{rest: getattr(owner, rest) * value if is_factor else value},  # type: ignore[arg-type]
        )
        return rig.with_joint(changed_joint)
    if head in EFFECTS:
        if EFFECTS[head].scope == "joint":
            return rig.with_joint(
                replace(owner, effects=_merged(owner.effects, head, {rest: value}))
            )
        return replace(rig, effects=_merged(rig.effects, head, {rest: value}))
    return replace(rig, **{head: getattr(rig, head) * value if is_factor else value})  # type: ignore[arg-type]


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
        As written.
    joint : int
        The joint diagnosed.
    hypothesis : Hypothesis
        What was found.
    targets, is_factor : list
        Where its parameters go, as `HypothesisFitter.problem_parts` tells.
    """
    name = rig.joints[joint].name
    improved = rig
    for group, factor, value in zip(
        targets, is_factor, hypothesis.result.values.tolist(), strict=True
    ):
        for path in group:
            improved = _set(improved, name, path, float(value), factor)
    return improved
