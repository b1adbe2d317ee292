"""Force from the contraction ratio with a factor for the ends: equations (9)-(12).

Source: equations (9)-(12) of "A Review of Design and Modeling of Pneumatic Artificial Muscle";
B. Tondu, P. Lopez, "Modeling and control of McKibben artificial muscle robot actuators", IEEE
Control Systems Magazine 20(2), 2000.
Errata: l_0 is the initial and l the current length (the text swaps them); (9) describes a pure
cylinder, not a cone: only k above 1 in (11) represents tapered ends.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

from pam_model.errors import DomainError
from pam_model.muscles.braid import NEUTRAL_ANGLE, ThinCylinder, braid_diameter, require_length
from pam_model.muscles.elementary import arc_cosine, is_finite_positive, sine, tangent
from pam_model.muscles.force_model import ModelParameter, register


def contraction_coefficient(area: float, a: float, b: float, contraction: Any) -> Any:
    """F/P = area (a (1 - contraction)^2 - b) [m^2]; contraction may carry a factor k."""
    left = 1.0 - contraction
    return area * (a * left * left - b)


@register(equations="(9)-(12)", status="published", summary="contraction ratio with end factor k")
class TonduLopez(ThinCylinder):
    """(11): F = pi r0^2 P (A (1 - k eps)^2 - B), A = 3/tan^2 theta0, B = 1/sin^2 theta0.

    r0 and theta0 are the braid's at its rest length. At k = 1 this is the ideal cylinder. The gas
    volume is the ideal cylinder's, so that with k other than 1 force and volume do not follow from
    the same energy.

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    rest_length : float
        l0 [m].
    k : float
        Factor on the contraction ratio [-].

    Raises
    ------
    DomainError
        For b or n not above zero, a rest length outside (0, b), or a thread angle at rest of
        54.7 degrees or more (an extensor); by the methods for a length outside `length_bounds`.
    """

    name: ClassVar[str] = "tondu_lopez"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        "k": ModelParameter(1.0, "-", 0.5, 5.0, "factor on the contraction ratio for the ends"),
    }

    def __init__(
        self, thread_length: float, turns: float, rest_length: float, k: float = 1.0
    ) -> None:
        super().__init__(thread_length, turns)
        if not 0.0 < rest_length < thread_length:
            raise DomainError(
                f"rest_length = {rest_length:g} m is outside (0, {thread_length:g}) m"
            )
        angle = arc_cosine(rest_length / thread_length)
        if angle >= NEUTRAL_ANGLE:
            raise DomainError(
                f"thread angle at rest {angle * 180.0 / math.pi:.2f} deg must be below "
                f"{math.degrees(NEUTRAL_ANGLE):.2f} deg for a muscle that contracts"
            )
        if not is_finite_positive(k):
            raise DomainError(f"k = {k:g} must be above 0")
        self.rest_length = rest_length
        self.k = k
        self.rest_radius = 0.5 * braid_diameter(thread_length, turns, rest_length)
        self.rest_angle = angle
        self._a = 3.0 / tangent(angle) ** 2
        self._b = 1.0 / sine(angle) ** 2
        self._area = math.pi * self.rest_radius**2
        self._shortest = max(0.0, rest_length * (1.0 - 1.0 / k))

    @property
    def maximum_contraction(self) -> float:
        """(12): eps_max = (1 - sqrt(B/A))/k [-], where the force is zero."""
        return (1.0 - math.sqrt(self._b / self._a)) / self.k

    @property
    def length_bounds(self) -> tuple[float, float]:
        """(l0 (1 - 1/k), b): below this, the square in (11) would rise again [m]."""
        return self._shortest, self.thread_length

    def _check(self, length: Any) -> Any:
        return require_length(length, self._shortest, self.thread_length, "the thread length")

    def coefficients(self, length: Any) -> tuple[Any, Any]:
        """(11) divided by pressure: A(L) [m^2]; and B = 0 [N]."""
        length = self._check(length)
        contraction = self.k * (1.0 - length / self.rest_length)
        return contraction_coefficient(self._area, self._a, self._b, contraction), 0.0 * length

    def coefficient_slopes(self, length: Any) -> tuple[Any, Any]:
        """dA/dL = 2 pi r0^2 A k (1 - k eps)/l0 [m] and 0 [N/m]."""
        length = self._check(length)
        left = 1.0 - self.k * (1.0 - length / self.rest_length)
        return 2.0 * self._area * self._a * self.k * left / self.rest_length, 0.0 * length
