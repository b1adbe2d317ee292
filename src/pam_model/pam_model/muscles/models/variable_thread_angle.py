"""Muscle whose thread angle at rest is set mechanically, after Hassan.

Named without an equation in "A Review of Design and Modeling of Pneumatic Artificial Muscle".
Derived from (1), (2), (6) with the angle at rest as a second input: length and diameter at rest
are constant, so b = L0/cos(angle) and n = L0 tan(angle)/(pi D0). Below 54.7 degrees the muscle
contracts, above it extends. At angle 0 the threads are parallel to the axis and would carry any
force without a change of volume: n is 0, and F = (pi D0^2/4) P (2 cot^2 - 1) at rest length grows
without bound. Angles below `LEAST_ANGLE` are therefore outside the model's domain.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

from pam_model.domain import ROUNDING
from pam_model.errors import DomainError
from pam_model.muscles.braid import ThinCylinder, require_positive
from pam_model.muscles.elastic_wall import rest_diameter
from pam_model.muscles.elementary import arc_cosine, cosine, tangent
from pam_model.muscles.force_model import ModelParameter, MuscleGeometry, register

LEAST_ANGLE = math.radians(3.0)
"""Smallest thread angle at rest [rad], the same as the lower bound of the geometry in `fit`."""


def _angle_of(geometry: MuscleGeometry) -> Any:
    rest_diameter(geometry)  # raises for an impossible geometry
    return arc_cosine(geometry.rest_length / geometry.thread_length)


@register(
    equations="(1)-(2), (6)",
    status="derived",
    summary="ideal braid with the thread angle at rest as an input: contracts or extends (Hassan)",
    row="variable_angle",
)
class VariableThreadAngle(ThinCylinder):
    """The ideal cylinder with a given size at rest and a variable thread angle.

    Parameters
    ----------
    rest_length : float
        L0 [m].
    rest_diameter : float
        D0 [m].
    rest_angle : float
        Thread angle at rest [rad].

    Raises
    ------
    DomainError
        For a size not above zero or an angle outside [`LEAST_ANGLE`, pi/2); by the methods for
        a length outside (0, b].
    """

    name: ClassVar[str] = "variable_thread_angle"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        "rest_angle": ModelParameter(
            0.0,
            "rad",
            0.0,
            1.55,
            "thread angle set at rest length, at least 0.0524; 0: that of the geometry",
            _angle_of,
        ),
    }

    def __init__(self, rest_length: float, rest_diameter: float, rest_angle: float) -> None:
        require_positive(rest_length=rest_length, rest_diameter=rest_diameter)
        if not LEAST_ANGLE * (1.0 - ROUNDING) <= rest_angle < 0.5 * math.pi:
            raise DomainError(
                f"rest_angle = {rest_angle:g} rad is outside [{LEAST_ANGLE:.4g}, pi/2) rad: "
                "a braid with threads along the axis cannot contract"
            )
        super().__init__(
            rest_length / cosine(rest_angle),
            rest_length * tangent(rest_angle) / (math.pi * rest_diameter),
        )
        self.rest_length = rest_length
        self.rest_diameter = rest_diameter
        self.rest_angle = rest_angle

    @classmethod
    def from_geometry(
        cls, geometry: MuscleGeometry, constants: Mapping[str, float]
    ) -> VariableThreadAngle:
        """The model of a muscle in a rig file: its length and diameter at rest."""
        angle = constants["rest_angle"] or _angle_of(geometry)
        return cls(geometry.rest_length, rest_diameter(geometry), angle)

    @property
    def free_length_ratio(self) -> float:
        """Length without force over rest length, 1/(sqrt(3) cos(rest angle)) [-]."""
        return 1.0 / (math.sqrt(3.0) * math.cos(self.rest_angle))

    @property
    def free_contraction(self) -> float:
        """Contraction ratio without force [-], negative for an extensor, below 0.42265."""
        return 1.0 - self.free_length_ratio

    def at_angle(self, rest_angle: float) -> VariableThreadAngle:
        """The same muscle with another thread angle at rest [rad]."""
        return VariableThreadAngle(self.rest_length, self.rest_diameter, rest_angle)
