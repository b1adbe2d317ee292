"""Miniature muscle: (24), (25) with the real size of the bladder, after Ashwin and Ghosal.

Source: equations (24)-(25) of "A Review of Design and Modeling of Pneumatic Artificial Muscle",
correct as printed (N is the turns n): stretches lambda1 = L/L0, lambda2 = r/r0, and
lambda3 = 1/(lambda1 lambda2) for the bladder. The review gives no force; here it follows from the
virtual work of the gas and of a Mooney-Rivlin bladder with the rubber volume of the real wall
(derived). The published model adds effects of the ends; here `inactive_length` represents them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pam_model.errors import DomainError
from pam_model.muscles.braid import braid_diameter, require_length
from pam_model.muscles.elementary import cosine
from pam_model.muscles.force_model import ModelParameter, MuscleGeometry, register
from pam_model.muscles.models.braid_bladder import BraidBladder
from pam_model.muscles.rubber_wall import RUBBER_PARAMETERS, tube_volume


@register(
    equations="(24)-(25)",
    status="derived",
    summary="miniature muscle: braid, bladder with the real wall, inactive length of the ends",
)
class AshwinGhosal(BraidBladder):
    """Braid and bladder along the active part; lengths are those of the whole muscle.

    Parameters
    ----------
    thread_length : float
        b along the active part [m].
    turns : float
        n along the active part [-].
    rest_length : float
        L0 of the active part [m].
    c10, c01 : float
        Mooney-Rivlin constants [Pa].
    wall_thickness : float
        Thickness of the bladder at rest [m].
    inactive_length : float
        Length of the fittings and of the braid that does not contract [m].

    Raises
    ------
    DomainError
        For a geometry or constants out of range; by the methods for a length outside
        `length_bounds`.
    """

    name: ClassVar[str] = "ashwin_ghosal"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        **RUBBER_PARAMETERS,
        "inactive_length": ModelParameter(
            0.0, "m", 0.0, 1.0, "part of the rest length that does not contract"
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
        wall_thickness: float,
        inactive_length: float = 0.0,
    ) -> None:
        volume = tube_volume(thread_length, turns, rest_length, wall_thickness)
        self.inactive_length = inactive_length
        super().__init__(thread_length, turns, rest_length, c10=c10, c01=c01, bladder_volume=volume)
        self.rest_length = rest_length

    @classmethod
    def from_geometry(
        cls, geometry: MuscleGeometry, constants: Mapping[str, float]
    ) -> AshwinGhosal:
        """The model of a muscle in a rig file: thread and turns without the inactive part."""
        inactive = constants["inactive_length"]
        share = 1.0 - inactive / geometry.rest_length
        if not 0.0 < share <= 1.0:
            raise DomainError(
                f"inactive_length = {inactive:g} m must be below rest_length = "
                f"{geometry.rest_length:g} m"
            )
        return cls(
            geometry.thread_length * share,
            geometry.turns * share,
            geometry.rest_length * share,
            wall_thickness=geometry.wall_thickness,
            **constants,
        )

    @property
    def length_bounds(self) -> tuple[float, float]:
        """Lengths of the whole muscle at which the rubber leaves room for gas [m]."""
        return self._shortest + self.inactive_length, self._longest + self.inactive_length

    def stretches(self, length: Any) -> tuple[Any, Any, Any]:
        """Lambda1, lambda2, lambda3 [-] of the bladder at a length of the active part [m]."""
        length = require_length(length, 0.0, self.thread_length, "the thread length")
        axial = length / self.rest_length
        hoop = self.radius(length) / self.radius(self.rest_length)
        return axial, hoop, 1.0 / (axial * hoop)

    def radius(self, length: Any) -> Any:
        """(25): r = b sin(theta)/(2 pi n) [m] at a length of the active part [m]."""
        return 0.5 * braid_diameter(self.thread_length, self.turns, length)

    def length_at(self, angle: float) -> Any:
        """(24): L = b cos(theta) [m] of the active part at a thread angle [rad]."""
        return self.thread_length * cosine(angle)

    def coefficients(self, length: Any) -> tuple[Any, Any]:
        """A(L) [m^2] and B(L) [N] at a length of the whole muscle [m]."""
        return super().coefficients(length - self.inactive_length)

    def coefficient_slopes(self, length: Any) -> tuple[Any, Any]:
        """dA/dL [m] and dB/dL [N/m] at a length of the whole muscle [m]."""
        return super().coefficient_slopes(length - self.inactive_length)

    def volume(self, length: Any) -> Any:
        """Gas volume [m^3] at a length of the whole muscle [m]."""
        return super().volume(length - self.inactive_length)

    def volume_slope(self, length: Any) -> Any:
        """dV/dL [m^2] at a length of the whole muscle [m]."""
        return super().volume_slope(length - self.inactive_length)

    def energy(self, length: Any) -> Any:
        """Strain energy of the bladder [J] at a length of the whole muscle [m]."""
        return super().energy(length - self.inactive_length)
