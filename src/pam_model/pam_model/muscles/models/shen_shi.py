"""Fibres embedded in thick rubber, with thread friction, similar to Shen and Shi.

Named without an equation in "A Review of Design and Modeling of Pneumatic Artificial Muscle";
the source's own form was not found. Derived composite: F = -P dV/dL + dU/dL plus friction of the
threads, where U is the Mooney-Rivlin energy of a thick wall. The fibres hold its outer face, and
its bore follows from the constant volume of the rubber.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pam_model.muscles.elastic_wall import ElasticCylinder
from pam_model.muscles.force_model import ModelParameter, MuscleGeometry, register
from pam_model.muscles.rubber_wall import RUBBER_PARAMETERS, RubberWall
from pam_model.muscles.thread_friction import FRICTION_PARAMETERS, ThreadFriction


@register(
    equations="-",
    status="stand-in",
    summary="fibres embedded in a thick rubber wall, with friction (after Shen and Shi)",
)
class ShenShi(ElasticCylinder):
    """Affine in pressure at rest; the gas volume is that of the braid minus the rubber.

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    rest_length : float
        Length at which the rubber is stress-free [m].
    wall_thickness : float
        Thickness of the rubber at rest [m].
    c10, c01 : float
        Mooney-Rivlin constants [Pa].
    friction : ThreadFriction
        Friction between threads and rubber.

    Raises
    ------
    DomainError
        For a geometry or constants out of range; by the methods for a length at which the rubber
        fills the braid.
    """

    name: ClassVar[str] = "shen_shi"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        **RUBBER_PARAMETERS,
        **FRICTION_PARAMETERS,
    }

    def __init__(
        self,
        thread_length: float,
        turns: float,
        rest_length: float,
        wall_thickness: float,
        *,
        c10: float,
        c01: float,
        friction: ThreadFriction,
    ) -> None:
        rubber = RubberWall.thick(
            thread_length, turns, rest_length, c10=c10, c01=c01, thickness=wall_thickness
        )
        super().__init__(thread_length, turns, rubber, rubber.volume)
        self.rubber = rubber
        self.friction = friction

    @classmethod
    def from_geometry(cls, geometry: MuscleGeometry, constants: Mapping[str, float]) -> ShenShi:
        """The model of a muscle in a rig file."""
        friction = {key: constants[key] for key in FRICTION_PARAMETERS}
        return cls(
            geometry.thread_length,
            geometry.turns,
            geometry.rest_length,
            geometry.wall_thickness,
            c10=constants["c10"],
            c01=constants["c01"],
            friction=ThreadFriction(geometry.turns, **friction),
        )

    def energy(self, length: Any) -> Any:
        """Strain energy of the rubber [J]."""
        return self.rubber.energy(length)

    def friction_per_pressure(self, length: Any) -> Any:
        """Friction over pressure [m^2]."""
        return self.friction.per_pressure(length)
