"""The link of a joint as a uniform slender rod, for formats that describe rigid bodies.

A robot describes each joint by its inertia and gravity torque, not by the shape of its link. The
rod is the one that has exactly these two (I = m L^2 / 3, gravity_torque = m g L / 2), or a rod
about its centre if there is no gravity torque. It turns about the y axis; z points up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pam_model.robot.robot import RobotJoint

STANDARD_GRAVITY = 9.80665  # m/s^2
BALANCED_LENGTH = 0.2  # m, of a rod whose length follows from nothing
_SLENDER = 0.05  # diameter over length of the drawn rod


@dataclass(frozen=True, slots=True)
class EquivalentRod:
    """The uniform slender rod with a joint's inertia and gravity torque."""

    mass: float  # [kg]
    length: float  # [m]
    centre: float  # distance of its centre from the joint's axis [m]; 0 or half of the length
    # rotation of the rod about the y axis [rad] at position 0; 0: it hangs straight down
    pitch: float

    @classmethod
    def of(cls, joint: RobotJoint) -> EquivalentRod:
        """The rod of a joint."""
        # With gravity_torque > 0 the rod hangs straight down at the position gravity_angle.
        pitch = -joint.gravity_angle + (math.pi if joint.gravity_torque < 0.0 else 0.0)
        if joint.gravity_torque == 0.0:
            mass = 12.0 * joint.inertia / BALANCED_LENGTH**2
            return cls(mass, BALANCED_LENGTH, 0.0, pitch)
        gravity = abs(joint.gravity_torque)
        length = 1.5 * joint.inertia * STANDARD_GRAVITY / gravity
        return cls(2.0 * gravity / (STANDARD_GRAVITY * length), length, 0.5 * length, pitch)

    @property
    def down(self) -> tuple[float, float, float]:
        """Direction from the axis along the rod, at position 0."""
        return -math.sin(self.pitch), 0.0, -math.cos(self.pitch)

    @property
    def radius(self) -> float:
        """Of the drawn rod [m]."""
        return 0.5 * _SLENDER * self.length

    @property
    def inertia_across(self) -> float:
        """M L^2 / 12, about the centre and across the rod [kg m^2]."""
        return self.mass * self.length**2 / 12.0

    @property
    def inertia_along(self) -> float:
        """About the rod itself [kg m^2]; the joint does not feel it."""
        return 0.5 * self.mass * self.radius**2
