"""Inverse dynamics: the torque that a joint needs for a motion, by the rigid-body equation.

inertia qdd + viscous_friction qd + gravity_torque sin(q - gravity_angle)

Dry friction depends on the motion before; it comes on top (`history_torque`).

All parameters include the effects that the rig file names, such as a payload.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from pam_control.compensation.dry_friction import DryFriction
from pam_control.references.spline import JointReference
from pam_model.effects import TorqueFeedforward, bound
from pam_model.effects.slots import JointTorque
from pam_model.robot import RobotJoint


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
        Angle at which gravity acts along the limb and makes no torque [rad].
    dry_friction : DryFriction
        All dry friction.
    smooth_torques : tuple of callable
        Other torques [N m] that act on the joint, as functions of position [rad] and velocity
        [rad/s].
    """

    inertia: float
    viscous_friction: float
    gravity_torque: float
    gravity_angle: float
    dry_friction: DryFriction = field(default_factory=DryFriction)
    smooth_torques: tuple[Callable[[float, float], float], ...] = ()

    @classmethod
    def from_joint(cls, joint: RobotJoint) -> InverseDynamics:
        """Create it from a joint of a robot."""
        return cls(
            joint.inertia,
            joint.viscous_friction,
            joint.gravity_torque,
            joint.gravity_angle,
            DryFriction.from_joint(joint),
            tuple(
                bound(slot.law, values)
                for _, slot, values in joint.laws(JointTorque, TorqueFeedforward)
            ),
        )

    def gravity(self, position: float) -> float:
        """Torque [N m] that holds the limb still at `position` [rad]."""
        return self.gravity_torque * math.sin(position - self.gravity_angle)

    def gravity_stiffness(self, position: float) -> float:
        """Derivative of `gravity` [N m/rad]; positive where gravity acts as a restoring spring."""
        return self.gravity_torque * math.cos(position - self.gravity_angle)

    def _added(self, position: float, velocity: float) -> float:
        """Sum of the smooth torques [N m]."""
        added = 0.0
        for law in self.smooth_torques:
            added += law(position, velocity)
        return added

    def static_torque(self, position: float, velocity: float) -> float:
        """Torque [N m] for a measured motion [rad], [rad/s]: no inertia, no friction."""
        return self.gravity(position) - self._added(position, velocity)

    def torque(self, reference: JointReference) -> float:
        """Torque [N m] for the motion `reference`, without dry friction."""
        added = self._added(reference.position, reference.velocity)
        return (
            self.inertia * reference.acceleration
            + self.viscous_friction * reference.velocity
            + self.gravity(reference.position)
            - added
        )
