"""Tondu and Lopez with an end factor that falls with pressure, k(P) = a_k e^(-P) + b_k, P in bar.

Source: equation (11) of "A Review of Design and Modeling of Pneumatic Artificial Muscle" with a
factor known from the literature after Tondu and Lopez. Its form is general knowledge, not
verified against a paper. Its constants are valid for one muscle only; the defaults only have a
plausible size. Errata as in `tondu_lopez`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from pam_model.errors import DomainError
from pam_model.muscles.braid import require_length
from pam_model.muscles.elastic_wall import CurvedMuscle
from pam_model.muscles.elementary import all_true, exponential, sine, tangent
from pam_model.muscles.force_model import ModelParameter, register
from pam_model.muscles.models.tondu_lopez import TonduLopez

PASCAL_PER_BAR = 1e5


@register(
    equations="(11)",
    status="empirical",
    summary="contraction ratio with an end factor k(P) that falls with pressure",
)
class TonduLopezPressureFactor(CurvedMuscle):
    """F = pi r0^2 P (A (1 - k(P) eps)^2 - B); gas volume is the ideal braid's (stand-in).

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    rest_length : float
        l0 [m].
    falling_factor, constant_factor : float
        a_k and b_k [-].

    Raises
    ------
    DomainError
        As `TonduLopez`, or for k not above zero; by the methods for a length outside
        `length_bounds`.
    """

    name: ClassVar[str] = "tondu_lopez_pressure_factor"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        "falling_factor": ModelParameter(0.5, "-", 0.0, 10.0, "a_k, vanishes at high pressure"),
        "constant_factor": ModelParameter(1.1, "-", 0.5, 5.0, "b_k, k at high pressure"),
    }

    def __init__(
        self,
        thread_length: float,
        turns: float,
        rest_length: float,
        falling_factor: float,
        constant_factor: float,
    ) -> None:
        if not (falling_factor >= 0.0 and constant_factor > 0.0):
            raise DomainError(
                f"falling_factor = {falling_factor:g} must be 0 or above and "
                f"constant_factor = {constant_factor:g} above 0"
            )
        self.braid = TonduLopez(thread_length, turns, rest_length)
        self.rest_length = rest_length
        self.falling_factor = falling_factor
        self.constant_factor = constant_factor
        radius, angle = self.braid.rest_radius, self.braid.rest_angle
        self._area = math.pi * radius**2
        self._a = 3.0 / tangent(angle) ** 2
        self._b = 1.0 / sine(angle) ** 2
        largest = falling_factor + constant_factor
        self._shortest = max(0.0, rest_length * (1.0 - 1.0 / largest))

    @property
    def length_bounds(self) -> tuple[float, float]:
        """(l0 (1 - 1/k(0)), b): below this, the square would rise again at low pressure [m]."""
        return self._shortest, self.braid.thread_length

    def factor(self, pressure: Any) -> Any:
        """k(P) [-] at gauge pressure [Pa]."""
        return self.falling_factor * exponential(-pressure / PASCAL_PER_BAR) + self.constant_factor

    def _left(self, pressure: Any, length: Any) -> tuple[Any, Any, Any]:
        """k, contraction and 1 - k eps."""
        length = require_length(
            length, self._shortest, self.braid.thread_length, "the thread length"
        )
        if not all_true(pressure >= 0.0):
            raise DomainError(f"pressure {np.min(pressure):g} Pa must be 0 or above for k(P)")
        k = self.factor(pressure)
        contraction = 1.0 - length / self.rest_length
        return k, contraction, 1.0 - k * contraction

    def force(self, pressure: Any, length: Any, velocity: Any = 0.0) -> Any:
        """Pull [N] at gauge pressure [Pa] and length [m]; it does not depend on speed."""
        _, _, left = self._left(pressure, length)
        return pressure * self._area * (self._a * left * left - self._b)

    def stiffness(self, pressure: Any, length: Any) -> Any:
        """dF/dL at constant pressure [N/m]."""
        k, _, left = self._left(pressure, length)
        return 2.0 * pressure * self._area * self._a * k * left / self.rest_length

    def pressure_slope(self, pressure: Any, length: Any) -> Any:
        """dF/dP at constant length [m^2]."""
        k, contraction, left = self._left(pressure, length)
        fall = (k - self.constant_factor) * pressure / PASCAL_PER_BAR
        square = self._a * left * left - self._b
        return self._area * (square + 2.0 * self._a * left * contraction * fall)
