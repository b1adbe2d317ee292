"""A braid with one side of constant length: the geometry of (33)-(37) and the work of the gas.

Equations (33)-(37) of "A Review of Design and Modeling of Pneumatic Artificial Muscle", exact for
two concentric arcs; the moment is derived here from virtual work, M = P dV/d(angle).
Ambiguity: (34) and (35) are the diameter of the fibres, which (37) needs; (36) is the diameter of
the gas space and must not be used there. The text calls the two bend radii diameters.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pam_model.domain import plain, require


def arc_from_lengths(fixed_length: Any, free_length: Any, diameter: Any) -> tuple[Any, Any]:
    """(33), (34), (37): bend angle [rad] and curvature of the middle [1/m] of two concentric arcs.

    Parameters
    ----------
    fixed_length, free_length : float or array
        Lengths of the two sides [m]; the angle is positive where the free side is longer.
    diameter : float or array
        Distance between the two sides [m].

    Raises
    ------
    DomainError
        For a length or diameter not above zero.
    """
    require("fixed_length [m]", fixed_length, 0.0, open_low=True)
    require("free_length [m]", free_length, 0.0, open_low=True)
    require("diameter [m]", diameter, 0.0, open_low=True)
    angle = (free_length - fixed_length) / diameter
    return angle, 2.0 * angle / (free_length + fixed_length)


class ReinforcedBraid:
    """A braided tube with one side of constant length; the thread angle of the other side changes.

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    fixed_angle : float
        Thread angle on the side that keeps its length [rad].
    wall_thickness : float
        t_c, thickness of bladder and sheath [m].

    Raises
    ------
    DomainError
        For an impossible geometry; by the methods for an angle outside (0, pi/2) or a closed
        bore.
    """

    def __init__(
        self, thread_length: float, turns: float, fixed_angle: float, wall_thickness: float = 0.0
    ) -> None:
        require("thread_length [m]", thread_length, 0.0, open_low=True)
        require("turns [-]", turns, 0.0, open_low=True)
        require("fixed_angle [rad]", fixed_angle, 0.0, math.pi / 2, open_low=True, open_high=True)
        require("wall_thickness [m]", wall_thickness, 0.0)
        self.thread_length = thread_length
        self.turns = turns
        self.fixed_angle = fixed_angle
        self.wall_thickness = wall_thickness
        self._radius_scale = thread_length / (2.0 * turns * math.pi)

    @property
    def fixed_length(self) -> float:
        """L_o = b cos(fixed angle) [m]."""
        return self.thread_length * math.cos(self.fixed_angle)

    def free_length(self, thread_angle: Any) -> Any:
        """L_n = b cos(theta) [m]."""
        self.check_angle(thread_angle)
        return plain(self.thread_length * np.cos(thread_angle))

    def middle_length(self, thread_angle: Any) -> Any:
        """(33): L_c = (L_o + L_n)/2 [m]."""
        return 0.5 * (self.fixed_length + self.free_length(thread_angle))

    def diameter(self, thread_angle: Any) -> Any:
        """(35): D = b (sin theta + sin fixed)/(2 n pi) [m], the distance between the two sides."""
        self.check_angle(thread_angle)
        return plain(self._radius_scale * (np.sin(thread_angle) + math.sin(self.fixed_angle)))

    def bore(self, thread_angle: Any) -> Any:
        """(36): D_in = D - 2 t_c [m], the diameter of the gas space."""
        bore = self.diameter(thread_angle) - 2.0 * self.wall_thickness
        require("bore D - 2 wall_thickness [m]", bore, 0.0, open_low=True, why="the wall fills it")
        return bore

    def bend(self, thread_angle: Any) -> Any:
        """(37) in closed form: (L_n - L_o)/D = 2 n pi tan((fixed - theta)/2) [rad]; b cancels."""
        self.check_angle(thread_angle)
        return plain(2.0 * math.pi * self.turns * np.tan(0.5 * (self.fixed_angle - thread_angle)))

    def thread_angle(self, bend: Any) -> Any:
        """The free side's thread angle [rad] at a bend angle [rad], the inverse of `bend`."""
        angle = plain(self.fixed_angle - 2.0 * np.arctan(bend / (2.0 * math.pi * self.turns)))
        self.check_angle(angle)
        return angle

    def volume(self, thread_angle: Any) -> Any:
        """Gas volume [m^3]: Pappus' theorem, bore section times middle length."""
        return 0.25 * math.pi * self.bore(thread_angle) ** 2 * self.middle_length(thread_angle)

    def moment_per_pressure(self, thread_angle: Any) -> Any:
        """dV/d(bend) [m^3/rad], positive where the gas lengthens the free side."""
        volume_slope, _, bend_slope, _ = self._slopes(thread_angle)
        return plain(volume_slope / bend_slope)

    def moment_slope_per_pressure(self, thread_angle: Any) -> Any:
        """d2V/d(bend)^2 [m^3/rad^2]."""
        v1, v2, a1, a2 = self._slopes(thread_angle)
        return plain((v2 * a1 - v1 * a2) / a1**3)

    def _slopes(self, thread_angle: Any) -> tuple[Any, Any, Any, Any]:
        """First and second derivatives of the volume and of the bend by the thread angle."""
        bore, middle = self.bore(thread_angle), self.middle_length(thread_angle)
        sine, cosine = np.sin(thread_angle), np.cos(thread_angle)
        bore1, bore2 = self._radius_scale * cosine, -self._radius_scale * sine
        middle1, middle2 = (-0.5 * self.thread_length * f for f in (sine, cosine))
        volume1 = 0.25 * math.pi * (2.0 * bore * bore1 * middle + bore**2 * middle1)
        volume2 = (
            0.25
            * math.pi
            * (
                2.0 * (bore1**2 + bore * bore2) * middle
                + 4.0 * bore * bore1 * middle1
                + bore**2 * middle2
            )
        )
        tangent = np.tan(0.5 * (self.fixed_angle - thread_angle))
        bend1 = -math.pi * self.turns * (1.0 + tangent**2)
        bend2 = math.pi * self.turns * tangent * (1.0 + tangent**2)
        return volume1, volume2, bend1, bend2

    def check_angle(self, thread_angle: Any) -> None:
        """Raise for a thread angle outside (0, pi/2)."""
        require("thread_angle [rad]", thread_angle, 0.0, math.pi / 2, open_low=True, open_high=True)
