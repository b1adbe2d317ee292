"""Which muscle turns which joint, with which lever arm: the radius that holds, and its sign."""

from __future__ import annotations

from dataclasses import dataclass

from pam_model.effects import adjusted
from pam_model.physics.joint_geometry import SIGNS
from pam_model.rig.types import Rig


@dataclass(frozen=True, slots=True)
class Arm:
    """One muscle at one joint."""

    # joint, muscle: their places in the robot
    joint: int
    muscle: int
    # Torque per pull [m]: positive if the muscle pulls towards positive positions. The length of
    # the muscle's path falls by as much per radian.
    length: float


def arms_of(rig: Rig) -> tuple[Arm, ...]:
    """Every muscle at its joint. The rig file has two muscles on one round pulley at each joint.

    Effects that change the radius are applied.
    """
    places = {name: place for place, name in enumerate(rig.muscle_names)}
    return tuple(
        Arm(
            joint,
            places[name],
            sign * adjusted("joint.pulley_radius", written.pulley_radius, written.effects),
        )
        for joint, written in enumerate(rig.joints)
        for name, sign in zip(written.muscles, SIGNS, strict=True)
    )
