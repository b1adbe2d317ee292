"""Parts that extend the ideal braid: elastic walls, friction, force nonlinear in pressure.

Source: virtual work, F = -P dV/dL + dU/dL, with U the energy stored in the wall. Friction always
opposes dL/dt. In a shut chamber P_abs (V + dead volume)^exponent stays constant.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Protocol

from pam_model.dual_numbers import bracketed_root
from pam_model.errors import DomainError
from pam_model.muscles.braid import (
    ThinCylinder,
    braid_diameter,
    require_length,
    require_positive,
)
from pam_model.muscles.closed_chamber import ClosedChamber
from pam_model.muscles.elementary import direction
from pam_model.muscles.force_model import MuscleGeometry


class Wall(Protocol):
    """Elastic parts of a muscle whose deformation follows from its length."""

    def force(self, length: Any) -> Any:
        """Pull of the wall [N]."""
        ...

    def stiffness(self, length: Any) -> Any:
        """d(pull)/dL [N/m]."""
        ...


def rest_diameter(geometry: MuscleGeometry) -> Any:
    """The braid's diameter at rest [m].

    Raises
    ------
    DomainError
        For a thread length or turns not above zero, or a rest length outside (0, b).
    """
    thread, rest = geometry.thread_length, geometry.rest_length
    require_positive(thread_length=thread, turns=geometry.turns)
    if not 0.0 < rest < thread:
        raise DomainError(f"rest_length = {rest:g} m is outside (0, {thread:g}) m")
    return braid_diameter(thread, geometry.turns, rest)


def lengths_with_room(braid: ThinCylinder, wall_volume: float) -> tuple[float, float]:
    """Lengths [m] between which the braid holds more than the wall's rubber [m^3].

    Raises
    ------
    DomainError
        If it never does.
    """
    longest = braid.thread_length
    if wall_volume == 0.0:
        return 0.0, longest
    scale = 1.0 / (4.0 * math.pi * braid.turns**2)

    def room(length: Any) -> Any:
        return length * (longest**2 - length**2) * scale - wall_volume

    widest = longest / math.sqrt(3.0)
    if not (wall_volume > 0.0 and room(widest) > 0.0):
        raise DomainError(
            f"rubber of {wall_volume:g} m^3 does not fit into a braid that holds "
            f"{room(widest) + wall_volume:g} m^3 at most"
        )
    return bracketed_root(room, 0.0, widest), bracketed_root(room, widest, longest)


class ElasticCylinder(ThinCylinder):
    """The ideal braid with an elastic wall, and friction proportional to pressure.

    F = P (3 L^2 - b^2)/(4 pi n^2) + wall(L) + sgn(dL/dt) P friction(L).

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    wall : Wall
        The elastic wall, which pulls even without pressure.
    wall_volume : float
        Volume of rubber inside the braid, which holds no gas [m^3].

    Raises
    ------
    DomainError
        For b or n not above zero, or more rubber than the braid can hold; by the methods for a
        length outside `length_bounds`.
    """

    def __init__(
        self, thread_length: float, turns: float, wall: Wall, wall_volume: float = 0.0
    ) -> None:
        super().__init__(thread_length, turns)
        self.wall = wall
        self.wall_volume = wall_volume
        self._shortest, self._longest = lengths_with_room(self, wall_volume)

    @property
    def length_bounds(self) -> tuple[float, float]:
        """Lengths at which the rubber leaves room for gas [m]."""
        return self._shortest, self._longest

    def _check(self, length: Any) -> Any:
        reason = "the thread length" if self.wall_volume == 0.0 else "the rubber fills the braid"
        return require_length(length, self._shortest, self._longest, reason)

    def coefficients(self, length: Any) -> tuple[Any, Any]:
        """A of the ideal cylinder [m^2] and the wall's pull B [N]."""
        return super().coefficients(length)[0], self.wall.force(length)

    def coefficient_slopes(self, length: Any) -> tuple[Any, Any]:
        """dA/dL [m] and the wall's stiffness [N/m]."""
        return super().coefficient_slopes(length)[0], self.wall.stiffness(length)

    def friction_per_pressure(self, length: Any) -> Any:
        """Friction over pressure [m^2]; 0 unless a subclass defines it."""
        return 0.0 * length

    def force(self, pressure: Any, length: Any, velocity: Any = 0.0) -> Any:
        """Pull [N]; friction adds to it in lengthening and reduces it in shortening."""
        static = super().force(pressure, length)
        return static + direction(velocity) * pressure * self.friction_per_pressure(length)

    def volume(self, length: Any) -> Any:
        """Volume of the braid minus that of the rubber [m^3]."""
        return super().volume(length) - self.wall_volume


class CurvedMuscle(ClosedChamber):
    """A muscle whose force is not affine in pressure; it provides dF/dP instead.

    A subclass defines `force`, `stiffness` and `pressure_slope`; the gas volume is by default
    that of the ideal braid in `braid`.
    """

    name: ClassVar[str]
    braid: ThinCylinder

    @property
    def length_bounds(self) -> tuple[float, float]:
        """(0, b) [m]."""
        return self.braid.length_bounds

    def volume(self, length: Any) -> Any:
        """The ideal braid's gas volume [m^3]."""
        return self.braid.volume(length)

    def volume_slope(self, length: Any) -> Any:
        """The ideal braid's dV/dL [m^2]."""
        return self.braid.volume_slope(length)
