"""Dry friction of a joint, as a torque that is added along its reference.

The contact yields before it slides: the friction follows Dahl's model along the REFERENCE position,

T = (sum of the friction laws that the rig file names)(qd) z,    dz/dq = (1 - sign(qd) z)/q_p

With the measured motion, the jump of the friction at a reversal would be part of the feedback loop,
and delay would turn it into a limit cycle. While the reference slows down, |z| is at most
tanh(|qd|/SMOOTHING_SPEED): otherwise the whole breakaway torque would push a joint past its target
that comes to rest a little late, and it would stick there. The integrator compensates the rest.

Friction that falls with speed drives a joint away from its speed, as a negative damping does: one
that is too fast meets less friction and becomes faster. Therefore the change of the laws from the
planned to the measured speed is compensated. This only undoes what such a friction does to
the loop; it is bounded by the difference of static and sliding friction, and is 0 while the
reference rests. The friction laws are defined in the files of the effects (`pam_model.effects`).

Source: H. Olsson, K. J. Astrom, C. Canudas de Wit, M. Gafvert, P. Lischinsky, "Friction models
and friction compensation", European Journal of Control 4(3), 1998; P. R. Dahl, A solid friction
model, Aerospace Corporation 1968. The two rules at the end of a motion and for the speed are made
here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pam_model.effects import TorqueFeedforward, bound
from pam_model.effects import slots as slot_kinds
from pam_model.physics.dahl import dahl_step
from pam_model.plant.composition import dry_friction
from pam_model.plant.layout import C_FRICTION
from pam_model.robot import RobotJoint

SMOOTHING_SPEED = 0.03  # rad/s
LEAST_PRESLIDING = 5e-4  # rad; the pressures cannot jump as a rigid contact does


@dataclass(frozen=True, slots=True)
class JointFriction:
    """All dry friction of one joint."""

    # each gives a magnitude [N m] at a joint velocity [rad/s]
    laws: tuple[Callable[[float], float], ...] = ()
    presliding: float = LEAST_PRESLIDING  # q_p, of the softest contact [rad]

    @classmethod
    def from_joint(cls, joint: RobotJoint) -> JointFriction:
        """Create it from the effects that the rig file names."""
        found = joint.laws(slot_kinds.DryFriction, TorqueFeedforward)
        yields = [
            dict(zip(effect.parameters, values, strict=True))[slot.presliding]
            for effect, slot, values in found
        ]
        return cls(
            tuple(bound(slot.law, values) for _, slot, values in found),
            max(yields, default=0.0) or LEAST_PRESLIDING,
        )

    def level(self, velocity: float) -> float:
        """Magnitude of the friction [N m] of a joint that slides at a velocity [rad/s]."""
        level = 0.0
        for law in self.laws:
            level += law(velocity)
        return level

    def torque(self, velocity: float) -> float:
        """Friction torque [N m] at a velocity [rad/s], without its memory."""
        return self.level(velocity) * math.tanh(velocity / SMOOTHING_SPEED) if self.laws else 0.0


def friction_change(c: Any, planned: float, measured: float) -> float:
    """Change of the friction torque [N m] from the planned to the measured speed [rad/s].

    `c` are the constants of the joint.
    """
    if c[C_FRICTION] == 0.0:
        return 0.0
    share = math.tanh(planned / SMOOTHING_SPEED)
    return float(share * (dry_friction(c, measured) - dry_friction(c, planned)))


def slipped(
    slip: float, travel: float, velocity: float, acceleration: float, presliding: float
) -> float:
    """The state z [-] after a travel [rad] of the reference that ended with this motion."""
    slip = dahl_step(slip, travel, presliding)
    if velocity * acceleration > 0.0:
        return slip
    most = math.tanh(abs(velocity) / SMOOTHING_SPEED)
    return max(-most, min(most, slip))
