"""A pulley that does not run true: its lever arm changes with the angle.

An eccentric or oval pulley has an arm r + e sin(n q - phase). Over the motion of a joint, this is
nearly r times a polynomial of the angle, which needs no phase. The cable of such a pulley is also
wound up further, or less far, where the angle is zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from pam_model.physics.joint_geometry import muscle_length
from pam_model.plant.layout import (
    C_ARM_BEND,
    C_ARM_SLOPE,
    C_MUSCLES,
    C_RADIUS,
    M_ARM,
    M_NEUTRAL,
    N_MUSCLE_CONSTANTS,
)
from pam_model.plant.parameters import Vector as Array


@dataclass(frozen=True, slots=True)
class UnevenPulley:
    """The lever arm r factor (1 + slope q + bend q^2) of a pulley with the stated radius r."""

    factor: float = 1.0  # arm at the angle zero, in stated radii
    slope: float = 0.0  # relative change of the arm [1/rad]
    bend: float = 0.0  # [1/rad^2]
    zero: float = 0.0  # angle [rad] by which the cable is wound up further where the angle is zero

    def apply(self, constants: Array) -> None:
        """Change the constants of plants, shape (lanes, n_constants), in place."""
        constants[:, C_RADIUS] *= self.factor
        constants[:, C_ARM_SLOPE] = self.slope
        constants[:, C_ARM_BEND] = self.bend
        for m in range(C_MUSCLES, constants.shape[1], N_MUSCLE_CONSTANTS):
            constants[:, m + M_NEUTRAL] = muscle_length(
                constants[:, m + M_NEUTRAL],
                constants[:, m + M_ARM],
                constants[:, C_RADIUS],
                self.zero,
            )


ROUND: Final = UnevenPulley()
"""The arm of a round pulley with the stated radius."""
