"""The self-bending contraction actuator: a rod fixes one side's length, the other side shortens.

Named without a formula in "A Review of Design and Modeling of Pneumatic Artificial Muscle"
(SBCA); derived here. The rod side keeps the length L_r, and the free side contracts to
L_r (1 - eps), so the angle is eps L_r/D(eps) with D from (35), and M = P dV/d(angle).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pam_model.atlas.bending.reinforced_braid import ReinforcedBraid
from pam_model.domain import plain, require
from pam_model.muscles.braid import NEUTRAL_ANGLE


class ContractionBending:
    """Bends towards its free side.

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    rest_angle : float
        Thread angle of the rod side, and of the straight muscle [rad], below 54.7356 deg.
    wall_thickness : float
        Thickness of bladder and sheath [m].

    Raises
    ------
    DomainError
        For an angle at which the braid does not contract; by the methods for a contraction or a
        bend angle below 0, or if the free side's thread angle would reach 90 deg.
    """

    def __init__(
        self, thread_length: float, turns: float, rest_angle: float, wall_thickness: float = 0.0
    ) -> None:
        require(
            "rest_angle [rad]",
            rest_angle,
            0.0,
            NEUTRAL_ANGLE,
            open_low=True,
            open_high=True,
            why="a larger thread angle extends",
        )
        self.braid = ReinforcedBraid(thread_length, turns, rest_angle, wall_thickness)

    def angle(self, contraction: Any) -> Any:
        """Bend angle eps L_r/D(eps) [rad] at contraction ratio eps of the free side [-]."""
        require("contraction [-]", contraction, 0.0, 1.0, open_high=True)
        cosine = (1.0 - contraction) * math.cos(self.braid.fixed_angle)
        return -self.braid.bend(plain(np.arccos(cosine)))

    def contraction(self, angle: Any) -> Any:
        """Contraction ratio of the free side [-] at a bend angle [rad]."""
        return 1.0 - self.braid.free_length(self._thread_angle(angle)) / self.braid.fixed_length

    def moment(self, pressure: Any, angle: Any) -> Any:
        """M [N m] at gauge pressure [Pa] and bend angle [rad], positive when it bends further."""
        return -pressure * self.braid.moment_per_pressure(self._thread_angle(angle))

    def stiffness(self, pressure: Any, angle: Any) -> Any:
        """-dM/d(angle) [N m/rad] at constant pressure."""
        return -pressure * self.braid.moment_slope_per_pressure(self._thread_angle(angle))

    def volume(self, angle: Any) -> Any:
        """Gas volume [m^3] at a bend angle [rad]."""
        return self.braid.volume(self._thread_angle(angle))

    def _thread_angle(self, angle: Any) -> Any:
        require("angle [rad]", angle, 0.0, why="a contraction actuator bends to its free side")
        return self.braid.thread_angle(-angle)
