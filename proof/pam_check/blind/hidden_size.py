"""The size at which an effect is hidden from the controller, and why this size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from pam_check.blind.truth_plant import TruthJoint, TruthMuscle


@dataclass(frozen=True, slots=True)
class HiddenSize:
    """One hidden effect, as a change of the true rig."""

    reason: str  # why this size
    # changed fields of the agonist and of the antagonist
    muscles: tuple[Mapping[str, float], Mapping[str, float]] = ({}, {})
    joint: Mapping[str, float] = field(default_factory=dict)  # changed fields of the joint
    # added_to_muscles, added_to_joint: what is added to fields of both muscles, and of the joint
    added_to_muscles: Mapping[str, float] = field(default_factory=dict)
    added_to_joint: Mapping[str, float] = field(default_factory=dict)
    # factors of fields of the joint
    scaled_joint: Mapping[str, float] = field(default_factory=dict)

    def applied(
        self, joint: TruthJoint, muscles: tuple[TruthMuscle, TruthMuscle]
    ) -> tuple[TruthJoint, tuple[TruthMuscle, TruthMuscle]]:
        """The rig with the hidden effect."""
        changed = {
            **self.joint,
            **{name: getattr(joint, name) + more for name, more in self.added_to_joint.items()},
            **{name: getattr(joint, name) * by for name, by in self.scaled_joint.items()},
        }
        first, second = (
            muscle._replace(**{**own, **{n: getattr(muscle, n) + more for n, more in both.items()}})
            for muscle, own, both in zip(
                muscles, self.muscles, (self.added_to_muscles,) * 2, strict=True
            )
        )
        return joint._replace(**changed), (first, second)


CLEAN: Final = HiddenSize("nothing is hidden; the rig matches its rig file")
