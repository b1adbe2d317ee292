"""Extensor with a factor on its extension ratio that falls with pressure: (26), after Al-Ibadi.

Source: equation (26) of "A Review of Design and Modeling of Pneumatic Artificial Muscle",
q(p) = -(1 + exp(-0.5 p)). Empirical and ambiguous: p is in bar (in Pa or kPa the exponential would
be zero throughout); q multiplies the extension ratio in (11), so |q| plays the role of k. This use
of q in the force is an interpretation that is not verified in the source.
Intended for rest angles above 54.7 degrees; below, it is (11) with a factor |q| on contraction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from pam_model.errors import DomainError
from pam_model.muscles.braid import ThinCylinder, braid_diameter, require_length
from pam_model.muscles.elastic_wall import CurvedMuscle
from pam_model.muscles.elementary import all_true, arc_cosine, exponential, sine, tangent
from pam_model.muscles.force_model import ModelParameter, register

PASCAL_PER_BAR = 1e5
_LARGEST = 2.0


def extension_factor(pressure: Any, decay: float = 0.5) -> Any:
    """(26): q [-] at gauge pressure [Pa]; decay in [1/bar]."""
    return -1.0 - exponential(-decay * pressure / PASCAL_PER_BAR)


@register(
    equations="(26)",
    status="empirical",
    summary="extensor with an extension factor q(p) that falls with pressure",
)
class AlIbadi(CurvedMuscle):
    """F = pi r0^2 P (A (1 - q eps_ext)^2 - B), negative where it pushes.

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    rest_length : float
        L0 [m].
    decay : float
        Decay of the exponential in q(p) [1/bar].

    Raises
    ------
    DomainError
        For b or n not above zero or a rest length outside (0, b); by the methods for a negative
        pressure or a length outside `length_bounds`.
    """

    name: ClassVar[str] = "al_ibadi"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        "decay": ModelParameter(0.5, "1/bar", 0.0, 100.0, "decay of q with pressure"),
    }

    def __init__(
        self, thread_length: float, turns: float, rest_length: float, decay: float = 0.5
    ) -> None:
        self.braid = ThinCylinder(thread_length, turns)
        if not 0.0 < rest_length < thread_length:
            raise DomainError(
                f"rest_length = {rest_length:g} m is outside (0, {thread_length:g}) m"
            )
        self.rest_length = rest_length
        self.decay = decay
        angle = arc_cosine(rest_length / thread_length)
        self._a = 3.0 / tangent(angle) ** 2
        self._b = 1.0 / sine(angle) ** 2
        self._area = 0.25 * math.pi * braid_diameter(thread_length, turns, rest_length) ** 2

    @property
    def length_bounds(self) -> tuple[float, float]:
        """(L0/2, b): below L0/2 the square would rise again at low pressure [m]."""
        return self.rest_length * (1.0 - 1.0 / _LARGEST), self.braid.thread_length

    def free_extension(self, pressure: Any) -> Any:
        """Extension ratio without force, (sqrt(B/A) - 1)/|q| [-]."""
        return (math.sqrt(self._b / self._a) - 1.0) / -extension_factor(pressure, self.decay)

    def _left(self, pressure: Any, length: Any) -> tuple[Any, Any, Any]:
        """q, extension ratio and 1 - q eps_ext."""
        length = require_length(length, *self.length_bounds, "the thread length")
        if not all_true(pressure >= 0.0):
            raise DomainError(f"pressure {np.min(pressure):g} Pa must be 0 or above for q(p)")
        q = extension_factor(pressure, self.decay)
        extension = length / self.rest_length - 1.0
        return q, extension, 1.0 - q * extension

    def force(self, pressure: Any, length: Any, velocity: Any = 0.0) -> Any:
        """Pull [N] at gauge pressure [Pa] and length [m]; it does not depend on speed."""
        _, _, left = self._left(pressure, length)
        return pressure * self._area * (self._a * left * left - self._b)

    def stiffness(self, pressure: Any, length: Any) -> Any:
        """dF/dL at constant pressure [N/m]."""
        q, _, left = self._left(pressure, length)
        return -2.0 * pressure * self._area * self._a * q * left / self.rest_length

    def pressure_slope(self, pressure: Any, length: Any) -> Any:
        """dF/dP at constant length [m^2]."""
        q, extension, left = self._left(pressure, length)
        rise = -self.decay * (q + 1.0) * pressure / PASCAL_PER_BAR  # P dq/dP
        square = self._a * left * left - self._b
        return self._area * (square - 2.0 * self._a * left * extension * rise)
