"""Torque that overcomes dry friction of a joint while it follows a reference.

T(qd) = (T_c + (T_s - T_c) exp(-(qd/w_s)^2) + T_coulomb) tanh(qd/SMOOTHING_SPEED)

The sign comes from the REFERENCE velocity: a measured one would make the friction's jump part of
the loop, where delay turns it into a limit cycle. The jump at a reversal is rounded, since a
valve cannot jump either; below the rounding speed, and at rest, the integrator does the rest.

Source: H. Olsson, K. J. Astrom, C. Canudas de Wit, M. Gafvert, P. Lischinsky, "Friction models
and friction compensation", European Journal of Control 4(3), 1998.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pam_model.effects import effect_value
from pam_model.rig import Joint

SMOOTHING_SPEED = 0.03  # rad/s


@dataclass(frozen=True, slots=True)
class DryFriction:
    """Coulomb and Stribeck friction of one joint.

    Attributes
    ----------
    coulomb : float
        The same at every speed [N m].
    static, kinetic : float
        Of the Stribeck curve, at rest and at speed [N m].
    stribeck_speed : float
        Over which it falls from one to the other [rad/s].
    """

    coulomb: float = 0.0
    static: float = 0.0
    kinetic: float = 0.0
    stribeck_speed: float = 0.1

    @classmethod
    def from_joint(cls, joint: Joint) -> DryFriction:
        """With the effects that the rig file names."""
        static = effect_value(joint.effects, "stribeck_friction", "static_torque")
        kinetic = effect_value(joint.effects, "stribeck_friction", "torque")
        return cls(
            effect_value(joint.effects, "coulomb_friction", "torque"),
            max(static, kinetic),
            kinetic,
            effect_value(joint.effects, "stribeck_friction", "speed"),
        )

    def torque(self, velocity: float) -> float:
        """What friction takes [N m] at a reference velocity [rad/s]."""
        level = self.coulomb + self.kinetic
        if self.static != self.kinetic:
            share = velocity / self.stribeck_speed
            level += (self.static - self.kinetic) * math.exp(-share * share)
        if level == 0.0:
            return 0.0
        return level * math.tanh(velocity / SMOOTHING_SPEED)
