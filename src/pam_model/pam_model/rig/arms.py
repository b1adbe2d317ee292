"""Which muscle turns which joint, with which lever arm: the radius that holds, and its sign."""

from __future__ import annotations

from dataclasses import dataclass

from pam_model.effects import adjusted
from pam_model.physics.joint_geometry import SIGNS
from pam_model.rig.types import Joint, Rig


@dataclass(frozen=True, slots=True)
class Arm:
    """One muscle at one joint."""

    # joint, muscle: their places in the robot
    joint: int
    muscle: int
    # Torque per pull [m]: positive if the muscle pulls towards positive positions. The length of
    # the muscle's path falls by as much per radian.
    length: float


def arm_lengths(joint: Joint, radius: float | None = None) -> list[float]:
    """Torque per pull [m] of the muscles of a joint, in its order.

    Both are on one round pulley, which effects of the joint may change. Another radius than the
    written one may be given [m].
    """
    written = joint.pulley_radius if radius is None else radius
    adjusted_radius = adjusted("joint.pulley_radius", written, joint.effects)
    return [sign * adjusted_radius for sign in SIGNS]


def arms_of(rig: Rig) -> tuple[Arm, ...]:
    """Every muscle at its joint."""
    places = {name: place for place, name in enumerate(rig.muscle_names)}
    return tuple(
        Arm(place, places[name], length)
        for place, joint in enumerate(rig.joints)
        for name, length in zip(joint.muscles, arm_lengths(joint), strict=True)
    )
