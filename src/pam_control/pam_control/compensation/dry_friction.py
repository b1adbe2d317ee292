"""Feedforward torque that compensates the dry friction of a joint along its reference.

T(qd) = (sum of the friction laws that the rig file names)(qd) tanh(qd/SMOOTHING_SPEED)

The sign is that of the REFERENCE velocity. With the measured velocity, the jump of the friction
would be part of the feedback loop, and delay would turn it into a limit cycle. The jump at a
reversal is smoothed, because a valve cannot jump either. Below the smoothing speed and at rest, the
integrator compensates the friction that is left. The friction laws are defined in the files of the
effects (`pam_model.effects`).

Source: H. Olsson, K. J. Astrom, C. Canudas de Wit, M. Gafvert, P. Lischinsky, "Friction models
and friction compensation", European Journal of Control 4(3), 1998.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from pam_model.effects import TorqueFeedforward, bound, switched_on
from pam_model.effects import slots as slot_kinds
from pam_model.rig import Joint

SMOOTHING_SPEED = 0.03  # rad/s


@dataclass(frozen=True, slots=True)
class DryFriction:
    """All dry friction of one joint.

    Attributes
    ----------
    laws : tuple of callable
        Each gives a magnitude [N m] at a joint velocity [rad/s].
    """

    laws: tuple[Callable[[float], float], ...] = ()

    @classmethod
    def from_joint(cls, joint: Joint) -> DryFriction:
        """Create it from the effects that the rig file names."""
        found = switched_on(slot_kinds.DryFriction, joint.effects, TorqueFeedforward)
        return cls(tuple(bound(slot.law, values) for _, slot, values in found))

    def torque(self, velocity: float) -> float:
        """Friction torque [N m] at a reference velocity [rad/s]."""
        level = 0.0
        for law in self.laws:
            level += law(velocity)
        return level * math.tanh(velocity / SMOOTHING_SPEED) if level else 0.0
