"""Ideal braid around a Mooney-Rivlin bladder: F = -P dV/dL + V_b dW/dL.

Named without an equation in "A Review of Design and Modeling of Pneumatic Artificial Muscle"
(G. K. Klute, B. Hannaford, "Accounting for elastic energy storage in McKibben artificial muscle
actuators", Journal of Dynamic Systems, Measurement, and Control 122(2), 2000); derived here from
energy, see `pam_model.muscles.rubber_wall`. The bladder is stress-free at the rest length.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pam_model.muscles.elastic_wall import ElasticCylinder
from pam_model.muscles.force_model import ModelParameter, MuscleGeometry, register
from pam_model.muscles.rubber_wall import RUBBER_PARAMETERS, RubberWall, tube_volume


def _tube_of(geometry: MuscleGeometry) -> Any:
    size = (geometry.thread_length, geometry.turns, geometry.rest_length)
    return tube_volume(*size, geometry.wall_thickness)


@register(
    equations="-",
    status="derived",
    summary="ideal braid around a thin Mooney-Rivlin bladder (Klute, Hannaford)",
    row="mooney_rivlin",
)
class BraidBladder(ElasticCylinder):
    """Affine in pressure; B(L) is the bladder's pull; gas volume is braid minus rubber.

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    rest_length : float
        Length at which the bladder is stress-free [m].
    c10, c01 : float
        Mooney-Rivlin constants [Pa].
    bladder_volume : float
        Volume of rubber V_b [m^3].

    Raises
    ------
    DomainError
        For a geometry or constants out of range; by the methods for a length at which the rubber
        fills the braid.
    """

    name: ClassVar[str] = "braid_bladder"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        **RUBBER_PARAMETERS,
        "bladder_volume": ModelParameter(
            0.0, "m^3", 0.0, 0.1, "rubber volume; 0: from wall_thickness at rest", _tube_of
        ),
    }

    def __init__(
        self,
        thread_length: float,
        turns: float,
        rest_length: float,
        *,
        c10: float,
        c01: float,
        bladder_volume: float,
    ) -> None:
        bladder = RubberWall.thin(
            thread_length, turns, rest_length, c10=c10, c01=c01, volume=bladder_volume
        )
        super().__init__(thread_length, turns, bladder, bladder_volume)
        self.bladder = bladder

    @classmethod
    def from_geometry(
        cls, geometry: MuscleGeometry, constants: Mapping[str, float]
    ) -> BraidBladder:
        """The model of a muscle in a rig file."""
        size = (geometry.thread_length, geometry.turns, geometry.rest_length)
        volume = constants["bladder_volume"] or _tube_of(geometry)
        return cls(*size, c10=constants["c10"], c01=constants["c01"], bladder_volume=volume)

    def energy(self, length: Any) -> Any:
        """Strain energy of the bladder [J]."""
        return self.bladder.energy(length)
