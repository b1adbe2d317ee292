"""The extensor bending muscle, (33)-(37): one side is reinforced, the other side lengthens.

Source: equations (33)-(37) of "A Review of Design and Modeling of Pneumatic Artificial Muscle"
(EBPAM); the geometry is correct as printed, with (35) and not (36) as the diameter in (37).
Volume, moment and stiffness are derived here (the review has none): V by Pappus' theorem,
M = P dV/d(angle).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from pam_model.atlas.bending.reinforced_braid import ReinforcedBraid
from pam_model.domain import require
from pam_model.muscles.braid import NEUTRAL_ANGLE


@dataclass(frozen=True, slots=True)
class BendingState:
    """A bending muscle at one thread angle: lengths [m], angle [rad], V [m^3], M [N m]."""

    free_length: Any
    fixed_length: Any
    middle_length: Any
    diameter: Any
    bore: Any
    angle: Any
    volume: Any
    moment: Any


class ExtensorBending:
    """Bends away from its reinforced side; the moment about the fixed fibre is positive.

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    largest_angle : float
        theta_max of the reinforced side, and of the straight muscle [rad], above 54.7356 deg.
    wall_thickness : float
        t_c [m].

    Raises
    ------
    DomainError
        For an angle at which the braid does not extend; by the methods for a thread angle outside
        (54.7356 deg, theta_max], where the muscle does not extend freely.
    """

    def __init__(
        self,
        thread_length: float,
        turns: float,
        largest_angle: float,
        wall_thickness: float = 0.0,
    ) -> None:
        require(
            "largest_angle [rad]",
            largest_angle,
            NEUTRAL_ANGLE,
            math.pi / 2,
            open_low=True,
            open_high=True,
            why="a smaller thread angle contracts",
        )
        self.braid = ReinforcedBraid(thread_length, turns, largest_angle, wall_thickness)

    @property
    def angle_bounds(self) -> tuple[float, float]:
        """Bend angle [rad] of the straight muscle, and with the free side at 54.7356 deg."""
        return 0.0, self.braid.bend(NEUTRAL_ANGLE)

    def state(self, pressure: Any, thread_angle: Any) -> BendingState:
        """The quantities of (33)-(37) at gauge pressure [Pa] and free-side thread angle [rad]."""
        self._check(thread_angle)
        braid = self.braid
        return BendingState(
            free_length=braid.free_length(thread_angle),
            fixed_length=braid.fixed_length,
            middle_length=braid.middle_length(thread_angle),
            diameter=braid.diameter(thread_angle),
            bore=braid.bore(thread_angle),
            angle=braid.bend(thread_angle),
            volume=braid.volume(thread_angle),
            moment=pressure * braid.moment_per_pressure(thread_angle),
        )

    def moment(self, pressure: Any, angle: Any) -> Any:
        """M [N m] at gauge pressure [Pa] and bend angle [rad], positive when it bends further."""
        return pressure * self.braid.moment_per_pressure(self._thread_angle(angle))

    def stiffness(self, pressure: Any, angle: Any) -> Any:
        """-dM/d(angle) [N m/rad] at constant pressure, positive when it resists further bending."""
        return -pressure * self.braid.moment_slope_per_pressure(self._thread_angle(angle))

    def volume(self, angle: Any) -> Any:
        """Gas volume [m^3] at a bend angle [rad]."""
        return self.braid.volume(self._thread_angle(angle))

    def _thread_angle(self, angle: Any) -> Any:
        require("angle [rad]", angle, 0.0, why="an extensor bends away from its reinforced side")
        thread_angle = self.braid.thread_angle(angle)
        self._check(thread_angle)
        return thread_angle

    def _check(self, thread_angle: Any) -> None:
        # Allow rounding: thread_angle(bend(x)) is not always exactly x.
        require(
            "thread_angle [rad]",
            thread_angle,
            NEUTRAL_ANGLE * (1.0 - 1e-14),
            self.braid.fixed_angle * (1.0 + 1e-14),
            why="an extensor's free side lies between 54.7356 deg and its reinforced side's angle",
        )
