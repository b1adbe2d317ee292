"""Tondu and Lopez with two factors: F = mu pi r0^2 P (A (1 - k eps)^2 - B).

mu = a_m e^(-40 eps) - b_m scales the whole force and k the contraction ratio. Source: (11) of
"A Review of Design and Modeling of Pneumatic Artificial Muscle" with a second factor known from
the literature after Tondu and Lopez. Its form is general knowledge, not verified against a paper.
Its constants are valid for one muscle only; the defaults only have a plausible size. Errata as in
`tondu_lopez`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pam_model.muscles.elementary import exponential
from pam_model.muscles.force_model import ModelParameter, register
from pam_model.muscles.models.tondu_lopez import TonduLopez

DECAY = 40.0
"""Rate at which the first part of mu decays with contraction [-]."""


@register(
    equations="(11)",
    status="empirical",
    summary="contraction ratio with an end factor k and a force factor mu(eps)",
)
class TonduLopezTwoFactors(TonduLopez):
    """Affine in pressure; the gas volume is the ideal cylinder's (stand-in).

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
    initial_factor, offset_factor : float
        a_m and b_m [-]; mu = 1 for 0 and -1.

    Raises
    ------
    DomainError
        As `TonduLopez`.
    """

    name: ClassVar[str] = "tondu_lopez_two_factors"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        **TonduLopez.parameters,
        "initial_factor": ModelParameter(0.1, "-", -10.0, 10.0, "a_m, decays with contraction"),
        "offset_factor": ModelParameter(-0.9, "-", -10.0, 10.0, "b_m, negative of mu at the end"),
    }

    def __init__(
        self,
        thread_length: float,
        turns: float,
        rest_length: float,
        k: float = 1.0,
        *,
        initial_factor: float = 0.0,
        offset_factor: float = -1.0,
    ) -> None:
        super().__init__(thread_length, turns, rest_length, k)
        self.initial_factor = initial_factor
        self.offset_factor = offset_factor

    def _dying(self, length: Any) -> Any:
        return self.initial_factor * exponential(-DECAY * (1.0 - length / self.rest_length))

    def force_factor(self, length: Any) -> Any:
        """Mu(eps) [-] at a length [m]."""
        return self._dying(length) - self.offset_factor

    def coefficients(self, length: Any) -> tuple[Any, Any]:
        """A = mu times that of (11) [m^2], and B = 0 [N]."""
        scale, passive = super().coefficients(length)
        return self.force_factor(length) * scale, passive

    def coefficient_slopes(self, length: Any) -> tuple[Any, Any]:
        """dA/dL [m] and 0 [N/m]."""
        scale, _ = super().coefficients(length)
        slope, passive = super().coefficient_slopes(length)
        rise = DECAY / self.rest_length * self._dying(length)
        return self.force_factor(length) * slope + rise * scale, passive
