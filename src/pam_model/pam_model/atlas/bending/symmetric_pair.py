"""Bending extensile and contractile muscles, and pairs of them: virtual work and force balance.

Guan's BE-PAM and BC-PAM are named without a formula in "A Review of Design and Modeling of
Pneumatic Artificial Muscle". It is published that both methods were used; the equations are
derived here for the geometry of (33)-(37).

Virtual work: M = P dV/d(angle).

Force balance, with S the sum of the tensions of all threads on the free side and beta the bend
(positive where the free side is longer):

- Pressure on the end caps, P pi D_in^2/4, acts at D/2 from the fixed fibre.
- Pressure on the side wall pushes the free side outwards with H = P pi/4 (2 D_in L_c +
  D_in^2 beta/2). The threads balance it: their hoop component is 2 pi n S sin(theta), and their
  axial component, which follows the bend, adds beta S cos(theta). So
  S = H/(2 pi n sin + beta cos).
- The resulting moment about the fixed fibre is M = P pi D_in^2 D/8 - S D cos(theta).
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np

from pam_model.atlas.bending.reinforced_braid import ReinforcedBraid
from pam_model.domain import plain, require
from pam_model.errors import DomainError

Method = Literal["virtual_work", "force_balance"]


def moment_by_virtual_work(braid: ReinforcedBraid, pressure: Any, thread_angle: Any) -> Any:
    """P dV/d(bend) [N m] at gauge pressure [Pa] and free-side thread angle [rad]."""
    return pressure * braid.moment_per_pressure(thread_angle)


def total_thread_tension(braid: ReinforcedBraid, pressure: Any, thread_angle: Any) -> Any:
    """S, the sum of the free side's thread tensions [N], from the radial balance.

    Raises
    ------
    DomainError
        If the bend is so negative that the threads no longer hold the wall.
    """
    bore, bend = braid.bore(thread_angle), braid.bend(thread_angle)
    load = (
        0.25
        * math.pi
        * pressure
        * bore
        * (2.0 * braid.middle_length(thread_angle) + bore * bend / 2.0)
    )
    hold = 2.0 * math.pi * braid.turns * np.sin(thread_angle) + bend * np.cos(thread_angle)
    require("2 pi n sin + bend cos [-]", hold, 0.0, open_low=True, why="bent too far back")
    return plain(load / hold)


def moment_by_force_balance(braid: ReinforcedBraid, pressure: Any, thread_angle: Any) -> Any:
    """Moment of the end-cap pressure minus that of the threads, about the fixed fibre [N m]."""
    bore, diameter = braid.bore(thread_angle), braid.diameter(thread_angle)
    caps = math.pi * pressure * bore**2 * diameter / 8.0
    axial = total_thread_tension(braid, pressure, thread_angle) * np.cos(thread_angle)
    return plain(caps - axial * diameter)


class SymmetricBendingPair:
    """Two equal bending muscles back to back on one spine of constant length.

    At a positive angle, the first muscle's free side lengthens and the second's shortens. An
    extensile pair (thread angle above 54.7356 deg) and a contractile pair differ in the sign of
    the moment.

    Parameters
    ----------
    braid : ReinforcedBraid
        The braid of each muscle; its reinforced side lies on the spine.

    Raises
    ------
    DomainError
        By the methods for an angle at which a free side's thread angle leaves (0, pi/2).
    """

    def __init__(self, braid: ReinforcedBraid) -> None:
        self.braid = braid

    def moment(
        self, pressures: tuple[Any, Any], angle: Any, method: Method = "virtual_work"
    ) -> Any:
        """Moment [N m] towards positive angle [rad] at the two gauge pressures [Pa]."""
        if method not in ("virtual_work", "force_balance"):
            raise DomainError(f"method = {method!r} is neither 'virtual_work' nor 'force_balance'")
        of = moment_by_virtual_work if method == "virtual_work" else moment_by_force_balance
        first, second = (self.braid.thread_angle(sign * angle) for sign in (1.0, -1.0))
        return of(self.braid, pressures[0], first) - of(self.braid, pressures[1], second)

    def stiffness(self, pressures: tuple[Any, Any], angle: Any) -> Any:
        """-dM/d(angle) [N m/rad] at constant pressures; the sum of both muscles."""
        first, second = (self.braid.thread_angle(sign * angle) for sign in (1.0, -1.0))
        slope = self.braid.moment_slope_per_pressure
        return -pressures[0] * slope(first) - pressures[1] * slope(second)
