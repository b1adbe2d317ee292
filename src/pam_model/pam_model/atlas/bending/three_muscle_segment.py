"""A continuum segment of three parallel muscles at 120 degrees: constant curvature.

Named without a formula in "A Review of Design and Modeling of Pneumatic Artificial Muscle";
derived here from concentric arcs. The segment bends towards the shortest muscle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pam_model.domain import require
from pam_model.errors import DomainError

_PLACES = tuple(2.0 * math.pi * i / 3.0 for i in range(3))


@dataclass(frozen=True, slots=True)
class Arc:
    """Length of the middle line [m], curvature [1/m], direction of bending about the axis [rad]."""

    length: float
    curvature: float
    direction: float


class ThreeMuscleSegment:
    """Convert lengths into an arc and back, and forces into moments.

    Parameters
    ----------
    radius : float
        d, distance of each muscle from the middle line [m]; muscle i stands at 120 deg (i - 1).

    Raises
    ------
    DomainError
        For a radius not above 0; by the methods for a number of values other than three, lengths
        not above 0, and a bend with its centre inside the segment (curvature * radius >= 1).
    """

    def __init__(self, radius: float) -> None:
        require("radius [m]", radius, 0.0, open_low=True)
        self.radius = radius

    def arc(self, lengths: Sequence[float]) -> Arc:
        """The arc that belongs to three muscle lengths [m]."""
        _three("lengths [m]", lengths)
        require("lengths [m]", lengths, 0.0, open_low=True)
        l1, l2, l3 = lengths
        total = l1 + l2 + l3
        # Use differences instead of squares, so that equal lengths give exactly zero.
        spread = 0.5 * ((l1 - l2) ** 2 + (l2 - l3) ** 2 + (l3 - l1) ** 2)
        curvature = 2.0 * math.sqrt(spread) / (self.radius * total)
        x = -sum(length * math.cos(place) for length, place in zip(lengths, _PLACES, strict=True))
        y = -sum(length * math.sin(place) for length, place in zip(lengths, _PLACES, strict=True))
        return Arc(total / 3.0, curvature, math.atan2(y, x) if curvature > 0.0 else 0.0)

    def lengths(self, arc: Arc) -> tuple[float, float, float]:
        """The three muscle lengths [m] of an arc."""
        require("length [m]", arc.length, 0.0, open_low=True)
        bend = arc.curvature * self.radius
        require("curvature * radius [-]", bend, 0.0, 1.0, open_high=True, why="the arc folds")
        first, second, third = (
            arc.length * (1.0 - bend * math.cos(place - arc.direction)) for place in _PLACES
        )
        return first, second, third

    def tip(self, arc: Arc) -> tuple[float, float, float]:
        """Position of the segment's end [m]; the base is at the origin, straight is along z."""
        angle = arc.curvature * arc.length
        if abs(angle) < 1e-6:
            side, along = 0.5 * arc.length * angle, arc.length
        else:
            side = (1.0 - math.cos(angle)) / arc.curvature
            along = math.sin(angle) / arc.curvature
        return side * math.cos(arc.direction), side * math.sin(arc.direction), along

    def moments(self, forces: Sequence[float]) -> tuple[float, float]:
        """Bending moment towards direction 0 and towards 90 deg [N m] of three pulls [N]."""
        _three("forces [N]", forces)
        towards_x = sum(f * math.cos(place) for f, place in zip(forces, _PLACES, strict=True))
        towards_y = sum(f * math.sin(place) for f, place in zip(forces, _PLACES, strict=True))
        return self.radius * towards_x, self.radius * towards_y


def _three(name: str, values: Sequence[float]) -> None:
    if len(values) != len(_PLACES):
        raise DomainError(f"{name}: {len(values)} values given, a segment has 3 muscles")
