"""Inverse dynamics: the torque that a joint needs for a motion, by the rigid-body equation.

inertia qdd + viscous_friction qd + gravity_torque sin(q - gravity_angle)

Dry friction, which depends on the motion before, is not part of it.

All parameters include the effects that the rig file names, such as a payload.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pam_model.effects import TorqueFeedforward, bound
from pam_model.effects.slots import JointTorque
from pam_model.robot.robot import RobotJoint
from pam_model.views.gravity import gravity_stiffness, gravity_torque

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class InverseDynamics:
    """One joint's equation of motion."""

    joint: RobotJoint
    # other torques [N m] that act on the joint, as functions of position [rad] and velocity [rad/s]
    smooth_torques: tuple[Callable[[float, float], float], ...] = ()

    @classmethod
    def from_joint(cls, joint: RobotJoint) -> InverseDynamics:
        """Create it from a joint of a robot."""
        smooth = joint.laws(JointTorque, TorqueFeedforward)
        return cls(joint, tuple(bound(slot.law, values) for _, slot, values in smooth))

    def gravity(self, position: float) -> float:
        """Torque [N m] that holds the limb still at `position` [rad]."""
        return -gravity_torque(self.joint, position)

    def gravity_stiffness(self, position: float) -> float:
        """Derivative of `gravity` [N m/rad]; positive where gravity acts as a restoring spring."""
        return gravity_stiffness(self.joint, position)

    def _added(self, position: float, velocity: float) -> float:
        """Sum of the smooth torques [N m]."""
        added = 0.0
        for law in self.smooth_torques:
            added += law(position, velocity)
        return added

    def static_torque(self, position: float, velocity: float) -> float:
        """Torque [N m] for a measured motion [rad], [rad/s]: no inertia, no friction."""
        return self.gravity(position) - self._added(position, velocity)

    def moving_torque[Number: (float, Array)](
        self, velocity: Number, acceleration: Number
    ) -> Number:
        """Torque [N m] that inertia and viscous friction take of a motion [rad/s], [rad/s^2]."""
        return self.joint.inertia * acceleration + self.joint.viscous_friction * velocity

    def acceleration(self, torque: float) -> float:
        """Acceleration [rad/s^2] that a torque [N m] gives to the limb alone."""
        return torque / self.joint.inertia

    def torque(self, position: float, velocity: float, acceleration: float) -> float:
        """Torque [N m] for a motion [rad], [rad/s], [rad/s^2]."""
        added = self._added(position, velocity)
        moving = self.moving_torque(velocity, acceleration)
        return moving + self.gravity(position) - added
