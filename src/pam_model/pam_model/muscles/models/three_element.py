"""The three-element muscle of (38): force as a function of pressure, length and speed.

F = F_ce(P) - K(P) y - B y', where y is the shortening from the rest length, and F_ce and K are
affine in pressure. Source: equation (38) of "A Review of Design and Modeling of Pneumatic
Artificial Muscle" (K in its text is k in the formula, L is the load). Default constants: Serres'
fit above 314 kPa while contracting, from a public simulator's description; other muscles need
their own. `pam_model.atlas.phenomenological.three_element` has the complete fit and the motion in
closed form. Gas volume is the ideal braid's (stand-in).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pam_model.muscles.braid import AffineMuscle, ThinCylinder, require_positive
from pam_model.muscles.force_model import ModelParameter, MuscleGeometry, register


@register(
    equations="(38)",
    status="empirical",
    summary="contractile force, spring and damper in parallel, affine in pressure",
)
class ThreeElement(AffineMuscle):
    """Affine in pressure.

    Parameters
    ----------
    geometry : MuscleGeometry
        Thread length and turns determine the volume; y = 0 at the rest length.
    constants : mapping of str to float
        The constants that `parameters` lists.

    Raises
    ------
    DomainError
        For a length of the geometry not above 0; by the methods for a length outside (0, b].
    """

    name: ClassVar[str] = "three_element"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        "force_per_pressure": ModelParameter(2.91e-3, "N/Pa", -1.0, 1.0, "slope of F_ce"),
        "force_offset": ModelParameter(44.6, "N", -1e5, 1e5, "F_ce without pressure"),
        "stiffness_per_pressure": ModelParameter(0.0179, "N/(m Pa)", -10.0, 10.0, "slope of K"),
        "stiffness_offset": ModelParameter(17e3, "N/m", -1e6, 1e7, "K without pressure"),
        "damping": ModelParameter(2900.0, "N s/m", 0.0, 1e6, "B"),
    }

    def __init__(self, geometry: MuscleGeometry, constants: Mapping[str, float]) -> None:
        require_positive(rest_length=geometry.rest_length)
        self._braid = ThinCylinder(geometry.thread_length, geometry.turns)
        self.rest_length = geometry.rest_length
        self._constants = dict(constants)

    @classmethod
    def from_geometry(
        cls, geometry: MuscleGeometry, constants: Mapping[str, float]
    ) -> ThreeElement:
        """The model of a muscle in a rig file."""
        return cls(geometry, constants)

    @property
    def length_bounds(self) -> tuple[float, float]:
        """(0, b) [m]."""
        return self._braid.length_bounds

    def coefficients(self, length: Any) -> tuple[Any, Any]:
        """A(L) [m^2] and B(L) [N] of F = P A + B."""
        self._braid.volume(length)  # raises for a length outside (0, b]
        shortening = self.rest_length - length
        fit = self._constants
        return (
            fit["force_per_pressure"] - fit["stiffness_per_pressure"] * shortening,
            fit["force_offset"] - fit["stiffness_offset"] * shortening,
        )

    def coefficient_slopes(self, length: Any) -> tuple[Any, Any]:
        """dA/dL [m] and dB/dL [N/m]."""
        self._braid.volume(length)  # raises for a length outside (0, b]
        same = 0.0 * length
        fit = self._constants
        return fit["stiffness_per_pressure"] + same, fit["stiffness_offset"] + same

    def force(self, pressure: Any, length: Any, velocity: Any = 0.0) -> Any:
        """Pull [N]; the damper adds to it in lengthening [m/s]."""
        return super().force(pressure, length) + self._constants["damping"] * velocity

    def volume(self, length: Any) -> Any:
        """The ideal braid's volume [m^3]; the model itself defines no volume."""
        return self._braid.volume(length)

    def volume_slope(self, length: Any) -> Any:
        """The ideal braid's dV/dL [m^2]."""
        return self._braid.volume_slope(length)
