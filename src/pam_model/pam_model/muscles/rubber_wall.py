"""Mooney-Rivlin rubber that follows a braid: a thin bladder, or a thick wall in layers.

W = C10 (I1 - 3) + C01 (I2 - 3), incompressible; axial stretch x = L/L0, squared hoop stretch y.
A thin bladder on the braid has y = (b^2 - L^2)/(b^2 - L0^2). In a thick wall held by the braid at
its outer face, a layer with rest radius R lies at r^2 = r_o^2 - (R_o^2 - R^2) L0/L.
Derived from energy; named without an equation in "A Review of Design and Modeling of Pneumatic
Artificial Muscle" (Klute and Hannaford). C10 = 118.4 kPa, C01 = 105.7 kPa for latex are general
knowledge, not verified.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from pam_model.errors import DomainError
from pam_model.muscles.braid import braid_diameter, require_length, require_positive
from pam_model.muscles.elementary import all_true, square_root
from pam_model.muscles.force_model import ModelParameter

RUBBER_PARAMETERS = {
    "c10": ModelParameter(118.4e3, "Pa", 0.0, 1e8, "first Mooney-Rivlin constant of the rubber"),
    "c01": ModelParameter(105.7e3, "Pa", 0.0, 1e8, "second Mooney-Rivlin constant of the rubber"),
}
"""Constants of every model with a rubber wall, as rig files name them."""

# With six Gauss-Legendre points the relative error of the energy is 1e-7 for a wall of 0.3 of the
# radius and 1e-5 for one of 0.5, unless the bore is almost closed.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)


class RubberWall:
    """Rubber around the gas of a braided muscle; its force drives it back to its rest length.

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    rest_length : float
        Stress-free length L0 [m].
    c10, c01 : float
        Mooney-Rivlin constants [Pa].
    layers : list of (float, float)
        Rubber volume [m^3] and radius at rest [m] of each layer. For a thin bladder on the braid
        this is the braid's radius at rest.

    Raises
    ------
    DomainError
        For a rest length outside (0, b), negative constants, a layer outside the braid; by the
        methods for a length outside (0, b) or one that leaves no room for a layer.
    """

    def __init__(
        self,
        thread_length: float,
        turns: float,
        rest_length: float,
        *,
        c10: float,
        c01: float,
        layers: list[tuple[float, float]],
    ) -> None:
        require_positive(thread_length=thread_length, turns=turns)
        if not 0.0 < rest_length < thread_length:
            raise DomainError(
                f"rest_length = {rest_length:g} m is outside (0, {thread_length:g}) m"
            )
        if not (c10 >= 0.0 and c01 >= 0.0):
            raise DomainError(f"c10 = {c10:g} Pa and c01 = {c01:g} Pa must be 0 or above")
        self.thread_length = thread_length
        self.rest_length = rest_length
        self.c10 = c10
        self.c01 = c01
        self._square = thread_length**2
        self._scale = 1.0 / (4.0 * math.pi**2 * turns**2)
        outer = (self._square - rest_length**2) * self._scale
        self._layers: list[tuple[float, float, float]] = []
        for volume, radius in layers:
            if not (volume >= 0.0 and 0.0 < radius**2 <= outer * (1.0 + 1e-9)):
                raise DomainError(
                    f"a rubber layer of {volume:g} m^3 at radius {radius:g} m does not fit into "
                    f"a braid of radius {square_root(outer):g} m"
                )
            self._layers.append((volume, 1.0 / radius**2, max(0.0, outer - radius**2)))

    @classmethod
    def thin(
        cls,
        thread_length: float,
        turns: float,
        rest_length: float,
        *,
        c10: float,
        c01: float,
        volume: float,
    ) -> RubberWall:
        """A bladder with this volume of rubber [m^3] that lies on the braid."""
        radius = _rest_radius(thread_length, turns, rest_length)
        return cls(thread_length, turns, rest_length, c10=c10, c01=c01, layers=[(volume, radius)])

    @classmethod
    def thick(
        cls,
        thread_length: float,
        turns: float,
        rest_length: float,
        *,
        c10: float,
        c01: float,
        thickness: float,
    ) -> RubberWall:
        """A wall with this thickness at rest [m], with the braid at its outer face."""
        outer = _rest_radius(thread_length, turns, rest_length)
        if not 0.0 <= thickness < outer:
            raise DomainError(f"wall thickness = {thickness:g} m is outside [0, {outer:g}) m")
        # equal shares of rubber in R^2, so that the layers sum to the wall's volume exactly
        inner2, outer2 = (outer - thickness) ** 2, outer**2
        half = 0.5 * (outer2 - inner2)
        layers = [
            (
                math.pi * rest_length * half * float(weight),
                square_root(0.5 * (outer2 + inner2) + half * float(node)),
            )
            for node, weight in zip(_NODES, _WEIGHTS, strict=True)
        ]
        return cls(thread_length, turns, rest_length, c10=c10, c01=c01, layers=layers)

    @property
    def volume(self) -> float:
        """Volume of rubber [m^3]."""
        return sum(volume for volume, _, _ in self._layers)

    def _sum(self, length: Any, term: Callable[[Any, Any, Any, Any], Any]) -> Any:
        """Sum over layers of volume times term(x, y, dy/dL, d2y/dL2)."""
        length = require_length(length, 0.0, self.thread_length, "the thread length")
        rest, scale = self.rest_length, self._scale
        stretch = length / rest
        outer = (self._square - length * length) * scale
        outer1, outer2 = -2.0 * scale * length, -2.0 * scale
        total = 0.0 * length
        for volume, inverse, gap in self._layers:
            inward = gap / stretch
            hoop = (outer - inward) * inverse
            if not all_true(hoop > 0.0):
                raise DomainError(
                    f"length {np.max(length):g} m leaves no room for the rubber inside the braid"
                )
            hoop1 = (outer1 + inward / length) * inverse
            hoop2 = (outer2 - 2.0 * inward / (length * length)) * inverse
            total = total + volume * term(stretch, hoop, hoop1, hoop2)
        return total

    def energy(self, length: Any) -> Any:
        """Strain energy [J], 0 at the rest length."""

        def density(x: Any, y: Any, _first: Any, _second: Any) -> Any:
            x2 = x * x
            first = x2 + y + 1.0 / (x2 * y) - 3.0
            return self.c10 * first + self.c01 * (1.0 / x2 + 1.0 / y + x2 * y - 3.0)

        return self._sum(length, density)

    def force(self, length: Any) -> Any:
        """Pull [N], the slope of the energy: positive above the rest length, negative below it."""
        rest = self.rest_length

        def slope(x: Any, y: Any, y1: Any, _second: Any) -> Any:
            x3 = x * x * x
            by_x = self.c10 * (x - 1.0 / (x3 * y)) + self.c01 * (x * y - 1.0 / x3)
            by_y = self.c10 * (1.0 - 1.0 / (x * x * y * y)) + self.c01 * (x * x - 1.0 / (y * y))
            return 2.0 * by_x / rest + by_y * y1

        return self._sum(length, slope)

    def stiffness(self, length: Any) -> Any:
        """d(pull)/dL [N/m]."""
        rest = self.rest_length

        def curvature(x: Any, y: Any, y1: Any, y2: Any) -> Any:
            x2 = x * x
            by_y = self.c10 * (1.0 - 1.0 / (x2 * y * y)) + self.c01 * (x2 - 1.0 / (y * y))
            by_xx = self.c10 * (1.0 + 3.0 / (x2 * x2 * y)) + self.c01 * (3.0 / (x2 * x2) + y)
            by_xy = self.c10 / (x2 * x * y * y) + self.c01 * x
            by_yy = (self.c10 / x2 + self.c01) / (y * y * y)
            return (
                2.0 * by_xx / (rest * rest)
                + 4.0 * by_xy * y1 / rest
                + 2.0 * by_yy * y1 * y1
                + by_y * y2
            )

        return self._sum(length, curvature)


def _rest_radius(thread_length: float, turns: float, rest_length: float) -> Any:
    require_positive(thread_length=thread_length, turns=turns)
    if not 0.0 < rest_length < thread_length:
        raise DomainError(f"rest_length = {rest_length:g} m is outside (0, {thread_length:g}) m")
    return 0.5 * braid_diameter(thread_length, turns, rest_length)


def tube_volume(thread_length: float, turns: float, rest_length: float, thickness: float) -> Any:
    """Volume of rubber [m^3] in a wall of this thickness [m] in the braid at its rest length."""
    outer = _rest_radius(thread_length, turns, rest_length)
    if not 0.0 <= thickness < outer:
        raise DomainError(f"wall thickness = {thickness:g} m is outside [0, {outer:g}) m")
    return math.pi * thickness * (2.0 * outer - thickness) * rest_length
