"""Braid with a bladder of one modulus that varies with length, after Martens and Boblan.

F = -P dV/dL + F_hoop dD/dL - F_axial, with hoop and axial strain against the muscle at rest,
F_hoop = E V_w (D - D0)/D0^2, F_axial = E V_w (L0 - L)/L0^2, V_w the rubber and E a cubic in
(L - L0)/L0. The form is from public code; that code has an error in dV/dL (b^2 - 2 L^2 instead of
b^2 - 3 L^2), which is corrected here. Its muscle had a wall of 1.8 mm and a thread angle of 28.6
degrees at rest; its modulus is not known, so the default is that of a soft rubber. Named without
an equation in "A Review of Design and Modeling of Pneumatic Artificial Muscle".
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pam_model.errors import DomainError
from pam_model.muscles.braid import ThinCylinder, braid_diameter, require_length, require_positive
from pam_model.muscles.elastic_wall import ElasticCylinder
from pam_model.muscles.force_model import ModelParameter, MuscleGeometry, register
from pam_model.muscles.rubber_wall import tube_volume


class LinearWall:
    """Wall with hoop and axial stress; its modulus is a cubic polynomial in axial strain.

    Parameters
    ----------
    braid : ThinCylinder
        The braid that determines the shape of the wall.
    rest_length : float
        L0 [m].
    volume : float
        Volume of rubber V_w [m^3].
    modulus : tuple of float
        Coefficients of E by powers 0-3 of (L - L0)/L0 [Pa].

    Raises
    ------
    DomainError
        By the methods for a length outside (0, b).
    """

    def __init__(
        self,
        braid: ThinCylinder,
        rest_length: float,
        volume: float,
        modulus: tuple[float, float, float, float],
    ) -> None:
        self._braid = braid
        self.rest_length = rest_length
        self.volume = volume
        self.modulus = modulus
        self._rest_square = braid.thread_length**2 - rest_length**2

    def _strain(self, length: Any) -> tuple[Any, Any, Any, Any, Any, Any]:
        """Axial strain, hoop ratio D/D0 with its first two slopes, E and dE/dL."""
        thread = self._braid.thread_length
        length = require_length(
            length, 0.0, thread, "where the braid's diameter is zero", open_high=True
        )
        axial = length / self.rest_length - 1.0
        size = braid_diameter(thread, self._braid.turns, length)
        rest = braid_diameter(thread, self._braid.turns, self.rest_length)
        hoop = size / rest
        slope = -length / (self._rest_square * hoop)
        curve = -(1.0 / self._rest_square + slope * slope) / hoop
        e0, e1, e2, e3 = self.modulus
        modulus = e0 + axial * (e1 + axial * (e2 + axial * e3))
        rise = (e1 + axial * (2.0 * e2 + 3.0 * axial * e3)) / self.rest_length
        return axial, hoop, slope, curve, modulus, rise

    def force(self, length: Any) -> Any:
        """Pull [N]: F_hoop dD/dL - F_axial."""
        axial, hoop, slope, _, modulus, _ = self._strain(length)
        return self.volume * modulus * ((hoop - 1.0) * slope + axial / self.rest_length)

    def stiffness(self, length: Any) -> Any:
        """d(pull)/dL [N/m]."""
        axial, hoop, slope, curve, modulus, rise = self._strain(length)
        shape = (hoop - 1.0) * slope + axial / self.rest_length
        bend = slope * slope + (hoop - 1.0) * curve + 1.0 / self.rest_length**2
        return self.volume * (rise * shape + modulus * bend)


@register(
    equations="-",
    status="stand-in",
    summary="braid and a wall with hoop and axial stress of one modulus (Martens, Boblan)",
)
class MartensBoblan(ElasticCylinder):
    """Affine in pressure; B(L) is the pull of the wall.

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    rest_length : float
        L0 [m].
    wall_thickness : float
        H0 at rest [m].
    modulus : tuple of float
        Coefficients of E by powers 0-3 of (L - L0)/L0 [Pa].

    Raises
    ------
    DomainError
        For a geometry out of range; by the methods for a length at which the rubber fills the
        braid.
    """

    name: ClassVar[str] = "martens_boblan"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        "modulus": ModelParameter(1e6, "Pa", 0.0, 1e9, "E of the wall at rest length"),
        "modulus_slope": ModelParameter(0.0, "Pa", -1e9, 1e9, "E per axial strain"),
        "modulus_square": ModelParameter(0.0, "Pa", -1e9, 1e9, "E per axial strain squared"),
        "modulus_cube": ModelParameter(0.0, "Pa", -1e9, 1e9, "E per axial strain cubed"),
    }

    def __init__(
        self,
        thread_length: float,
        turns: float,
        rest_length: float,
        wall_thickness: float,
        *,
        modulus: tuple[float, float, float, float],
    ) -> None:
        require_positive(thread_length=thread_length, turns=turns)
        if not modulus[0] >= 0.0:
            raise DomainError(f"modulus = {modulus[0]:g} Pa must be 0 or above")
        volume = tube_volume(thread_length, turns, rest_length, wall_thickness)
        wall = LinearWall(ThinCylinder(thread_length, turns), rest_length, volume, modulus)
        super().__init__(thread_length, turns, wall, volume)

    @classmethod
    def from_geometry(
        cls, geometry: MuscleGeometry, constants: Mapping[str, float]
    ) -> MartensBoblan:
        """The model of a muscle in a rig file."""
        return cls(
            geometry.thread_length,
            geometry.turns,
            geometry.rest_length,
            geometry.wall_thickness,
            modulus=(
                constants["modulus"],
                constants["modulus_slope"],
                constants["modulus_square"],
                constants["modulus_cube"],
            ),
        )
