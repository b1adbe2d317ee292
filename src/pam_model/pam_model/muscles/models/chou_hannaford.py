"""A braid with a thick wall: equations (7), (8), after Chou and Hannaford.

Source: equations (7)-(8) of "A Review of Design and Modeling of Pneumatic Artificial Muscle";
C.-P. Chou, B. Hannaford, "Measurement and modeling of McKibben pneumatic artificial muscles",
IEEE Transactions on Robotics and Automation 12(1), 1996. (8) follows from (7) by virtual work.
Erratum: (8) is printed with D^2 in its first term and D_0 in the second; both are
D90 = b/(n pi).

A wall of constant thickness and an incompressible wall contradict each other. (8) assumes constant
thickness. With an incompressible wall the gas volume is the outer volume minus a constant, so the
force is that of a thin wall; this is the second model here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

from pam_model.errors import DomainError
from pam_model.muscles.braid import ThinCylinder, braid_diameter, require_length
from pam_model.muscles.elastic_wall import lengths_with_room
from pam_model.muscles.elementary import square_root
from pam_model.muscles.force_model import ModelParameter, register


def _check_wall(wall_thickness: float, diameter: float, where: str) -> None:
    if not 0.0 <= wall_thickness < math.inf:
        raise DomainError(f"wall_thickness = {wall_thickness:g} m must be 0 or above")
    if 2.0 * wall_thickness >= diameter:
        raise DomainError(
            f"wall_thickness = {wall_thickness:g} m fills the braid: its diameter {where} is "
            f"{diameter:g} m"
        )


@register(equations="(7)-(8)", status="derived", summary="wall of constant thickness")
class ChouHannaford(ThinCylinder):
    """Constant wall t_k: A = kappa (3 cos^2 - 1) + pi (D90 t_k (2 sin - 1/sin) - t_k^2), B = 0.

    kappa = pi D90^2/4; at t_k = 0 this is the ideal cylinder.

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    wall_thickness : float
        t_k, bladder and sheath [m].

    Raises
    ------
    DomainError
        For b or n not above zero, or a wall that fills the braid; by the methods for a length
        where the wall would.
    """

    name: ClassVar[str] = "chou_hannaford"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {}

    def __init__(self, thread_length: float, turns: float, wall_thickness: float = 0.0) -> None:
        super().__init__(thread_length, turns)
        diameter = thread_length / (turns * math.pi)
        _check_wall(wall_thickness, diameter, "at 90 degrees")
        self.wall_thickness = wall_thickness
        self._diameter90 = diameter
        bore = 2.0 * wall_thickness * turns * math.pi
        self._longest = square_root(self._square - bore * bore)

    @property
    def length_bounds(self) -> tuple[float, float]:
        """(0, sqrt(b^2 - (2 pi n t_k)^2)); at the upper bound the wall fills the braid [m]."""
        return 0.0, self._longest

    def _check(self, length: Any) -> Any:
        if isinstance(length, float) and 0.0 < length < self._longest:
            return length
        return require_length(length, 0.0, self._longest, "where the wall fills the braid")

    def _angle(self, length: Any) -> tuple[Any, Any]:
        cosine = length / self.thread_length
        return cosine, square_root(1.0 - cosine * cosine)

    def coefficients(self, length: Any) -> tuple[Any, Any]:
        """(8) divided by pressure: A(L) [m^2]; and B = 0 [N]."""
        scale, zero = super().coefficients(length)
        wall = self.wall_thickness
        if wall == 0.0:
            return scale, zero
        _, sine = self._angle(length)
        thick = self._diameter90 * wall * (2.0 * sine - 1.0 / sine) - wall * wall
        return scale + math.pi * thick, zero

    def coefficient_slopes(self, length: Any) -> tuple[Any, Any]:
        """dA/dL = 3 L/(2 pi n^2) - (t_k/n) cot (2 + 1/sin^2) [m] and 0 [N/m]."""
        slope, zero = super().coefficient_slopes(length)
        wall = self.wall_thickness
        if wall == 0.0:
            return slope, zero
        cosine, sine = self._angle(length)
        return slope - wall / self.turns * cosine / sine * (2.0 + 1.0 / (sine * sine)), zero

    def volume(self, length: Any) -> Any:
        """(7): V = (pi/4)(D - 2 t_k)^2 L [m^3]."""
        if self.wall_thickness == 0.0:
            return super().volume(length)
        length = self._check(length)
        bore = braid_diameter(self.thread_length, self.turns, length) - 2.0 * self.wall_thickness
        return 0.25 * math.pi * bore * bore * length

    def volume_slope(self, length: Any) -> Any:
        """dV/dL = -A(L), since the force is from virtual work [m^2]."""
        return -self.coefficients(length)[0]


@register(equations="(7)-(8)", status="derived", summary="wall of constant rubber volume")
class ChouHannafordIncompressible(ThinCylinder):
    """Incompressible wall: force of the thin cylinder; its volume reduces the gas volume.

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    rest_length : float
        Length at which the wall has the given thickness [m].
    wall_thickness : float
        t_k at rest [m].

    Raises
    ------
    DomainError
        For b or n not above zero, a rest length outside (0, b), a wall that fills the braid at
        rest; by the methods for a length that leaves the gas no volume.
    """

    name: ClassVar[str] = "chou_hannaford_incompressible"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {}

    def __init__(
        self, thread_length: float, turns: float, rest_length: float, wall_thickness: float = 0.0
    ) -> None:
        super().__init__(thread_length, turns)
        if not 0.0 < rest_length < thread_length:
            raise DomainError(
                f"rest_length = {rest_length:g} m is outside (0, {thread_length:g}) m"
            )
        outer = braid_diameter(thread_length, turns, rest_length)
        _check_wall(wall_thickness, outer, "at rest")
        self.wall_thickness = wall_thickness
        self.wall_volume = math.pi * wall_thickness * (outer - wall_thickness) * rest_length
        self._bounds = lengths_with_room(self, self.wall_volume)

    @property
    def length_bounds(self) -> tuple[float, float]:
        """Lengths at which the wall leaves room for gas [m]."""
        return self._bounds

    def _check(self, length: Any) -> Any:
        reason = f"a wall of {self.wall_volume:g} m^3 leaves no gas volume beyond"
        return require_length(length, *self._bounds, reason)

    def volume(self, length: Any) -> Any:
        """Outer volume minus that of the wall [m^3]."""
        return super().volume(length) - self.wall_volume
