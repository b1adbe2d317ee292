"""Force as exponentials and products of contraction and pressure, after Sarosi.

F = (a1 p + a2) e^(a3 kappa) + a4 p kappa + a5 p + a6, kappa the contraction in percent, p in kPa.
The form is from public code; "A Review of Design and Modeling of Pneumatic Artificial Muscle" has
no equation. The default constants are arbitrary and only give a plausible muscle: identify them.
Gas volume is the ideal braid's (stand-in).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pam_model.muscles.braid import AffineMuscle, ThinCylinder, require_length, require_positive
from pam_model.muscles.elementary import exponential
from pam_model.muscles.force_model import ModelParameter, register

_PASCAL_PER_KILOPASCAL = 1e3
_PERCENT = 100.0


@register(
    equations="-",
    status="empirical",
    summary="six constants: exponential of contraction and products with pressure (Sarosi)",
)
class Sarosi(AffineMuscle):
    """Affine in pressure.

    Parameters
    ----------
    thread_length : float
        b [m], for the gas volume.
    turns : float
        n [-], for the gas volume.
    rest_length : float
        Length at zero contraction [m].
    a1, a2, a3, a4, a5, a6 : float
        The constants, in units of kPa, percent and N.

    Raises
    ------
    DomainError
        For a geometry not above zero; by the methods for a length outside (0, b].
    """

    name: ClassVar[str] = "sarosi"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        "a1": ModelParameter(1.2, "N/kPa", -1e4, 1e4, "factor of the exponential per pressure"),
        "a2": ModelParameter(80.0, "N", -1e5, 1e5, "factor of the exponential without pressure"),
        "a3": ModelParameter(-0.25, "1/%", -5.0, 5.0, "decay of the exponential with contraction"),
        "a4": ModelParameter(-0.02, "N/(kPa %)", -1e3, 1e3, "force per pressure and contraction"),
        "a5": ModelParameter(0.8, "N/kPa", -1e4, 1e4, "force per pressure"),
        "a6": ModelParameter(-60.0, "N", -1e5, 1e5, "force without pressure"),
    }

    def __init__(
        self,
        thread_length: float,
        turns: float,
        rest_length: float,
        *,
        a1: float,
        a2: float,
        a3: float,
        a4: float,
        a5: float,
        a6: float,
    ) -> None:
        require_positive(rest_length=rest_length)
        self._braid = ThinCylinder(thread_length, turns)
        self.rest_length = rest_length
        self._a = (a1, a2, a3, a4, a5, a6)

    @property
    def length_bounds(self) -> tuple[float, float]:
        """(0, b) [m]."""
        return self._braid.length_bounds

    def _percent(self, length: Any) -> Any:
        length = require_length(length, *self.length_bounds, "the thread length")
        return _PERCENT * (1.0 - length / self.rest_length)

    def coefficients(self, length: Any) -> tuple[Any, Any]:
        """A(L) [m^2] and B(L) [N]."""
        a1, a2, a3, a4, a5, a6 = self._a
        percent = self._percent(length)
        fade = exponential(a3 * percent)
        return (a1 * fade + a4 * percent + a5) / _PASCAL_PER_KILOPASCAL, a2 * fade + a6

    def coefficient_slopes(self, length: Any) -> tuple[Any, Any]:
        """dA/dL [m] and dB/dL [N/m]."""
        a1, a2, a3, a4, _, _ = self._a
        fade = a3 * exponential(a3 * self._percent(length))
        by_length = -_PERCENT / self.rest_length
        return by_length * (a1 * fade + a4) / _PASCAL_PER_KILOPASCAL, by_length * a2 * fade

    def volume(self, length: Any) -> Any:
        """The ideal braid's volume [m^3]; the model itself defines no volume."""
        return self._braid.volume(length)

    def volume_slope(self, length: Any) -> Any:
        """The ideal braid's dV/dL [m^2]."""
        return self._braid.volume_slope(length)
