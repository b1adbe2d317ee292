"""Torque a joint needs for a motion: the rigid-body equation of the rig, solved for the torque.

inertia qdd + viscous_friction qd + dry friction(qd) + gravity_torque sin(q - gravity_angle)

A payload, a point mass m at l from the axis, adds m l^2 and m g l.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from pam_control.compensation.dry_friction import DryFriction
from pam_control.references.trajectory import JointReference
from pam_model.effects import effect_value
from pam_model.rig import Joint

GRAVITY = 9.80665  # m/s^2


@dataclass(frozen=True, slots=True)
class InverseDynamics:
    """One joint's equation of motion.

    Attributes
    ----------
    inertia : float
        [kg m^2].
    viscous_friction : float
        [N m s/rad].
    gravity_torque : float
        m g l [N m].
    gravity_angle : float
        Where gravity pulls straight along the limb [rad].
    dry_friction : DryFriction
        Coulomb and Stribeck friction.
    """

    inertia: float
    viscous_friction: float
    gravity_torque: float
    gravity_angle: float
    dry_friction: DryFriction = field(default_factory=DryFriction)

    @classmethod
    def from_joint(cls, joint: Joint) -> InverseDynamics:
        """With the numbers of the rig file and the effects that it names."""
        mass = effect_value(joint.effects, "payload", "mass")
        distance = effect_value(joint.effects, "payload", "distance")
        return cls(
            joint.inertia + mass * distance * distance,
            joint.viscous_friction + effect_value(joint.effects, "viscous_friction", "extra"),
            joint.gravity_torque + mass * GRAVITY * distance,
            joint.gravity_angle,
            DryFriction.from_joint(joint),
        )

    def gravity(self, position: float) -> float:
        """Torque [N m] that holds the limb still at `position` [rad]."""
        return self.gravity_torque * math.sin(position - self.gravity_angle)

    def gravity_stiffness(self, position: float) -> float:
        """Slope of `gravity` [N m/rad]; positive where gravity brings the limb back."""
        return self.gravity_torque * math.cos(position - self.gravity_angle)

    def torque(self, reference: JointReference) -> float:
        """Torque [N m] for the motion `reference`."""
        return (
            self.inertia * reference.acceleration
            + self.viscous_friction * reference.velocity
            + self.dry_friction.torque(reference.velocity)
            + self.gravity(reference.position)
        )
