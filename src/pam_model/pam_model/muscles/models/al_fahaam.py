"""Contractor inside an extensor: equations (27)-(32), corrected, after Al-Fahaam.

Source: equations (27)-(32) of "A Review of Design and Modeling of Pneumatic Artificial Muscle".
Derived from the work of both gases, dW = P_c dV_c + P_e d(V_e - V_c) = -F dL: P_c in the inner
bladder, P_e in the annulus, both gauge.
Errata: (30) lacks the factor (3 cos^2 theta_c - 1), so its force would never vanish; the second
angle of (31) must be theta_e; (32) is wrong in sign and factor (it equals F_c + F_s with 1 in
place of 4), and F_c - F_s would count P_e twice. (27) is a ratio of rest lengths; (28), (29) are
design data. This model assumes that both ends are joined, so that the lengths are equal. For the
literal L_c = 1.15 L_e use `design_pair_forces` with a length ratio of 1.15.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from pam_model.domain import plain
from pam_model.dual_numbers import bracketed_root
from pam_model.errors import DomainError
from pam_model.muscles.braid import AffineMuscle, ThinCylinder, braid_diameter, require_length
from pam_model.muscles.force_model import ModelParameter, MuscleGeometry, register

DESIGN_RATIO = 1.15
"""(27)-(29): the contractor's bladder length over the extensor's rest length; n_c/n_e [-]."""


def design_pair_forces(
    contractor_thread: float,
    contractor_turns: float,
    *,
    contractor_pressure: Any,
    extensor_pressure: Any,
    contractor_angle: Any,
    extensor_angle: Any,
    length_ratio: float = 1.0,
) -> tuple[Any, Any, Any]:
    """Forces (30)-(32), corrected, of a pair with the design ratios (28), (29).

    Parameters
    ----------
    contractor_thread : float
        b_c [m].
    contractor_turns : float
        n_c [-].
    contractor_pressure, extensor_pressure : float or array
        P_c and P_e, gauge [Pa].
    contractor_angle, extensor_angle : float or array
        Thread angles [rad].
    length_ratio : float
        dL_c/dL: 1 if both ends are joined, 1.15 for (27) taken literally.

    Returns
    -------
    tuple
        Force F of the pair, F_c of the contractor, and extension force F_s of the annulus; in
        F_s, the length ratio replaces the factor 1.15 of (31) [N].
    """
    area = contractor_thread**2 / (4.0 * math.pi * contractor_turns**2)
    inner = 3.0 * np.cos(contractor_angle) ** 2 - 1.0
    outer = 3.0 * np.cos(extensor_angle) ** 2 - 1.0
    contractor = area * (contractor_pressure - extensor_pressure) * inner
    annulus = area * extensor_pressure * (length_ratio * inner - 4.0 * outer)
    pair = length_ratio * contractor + 4.0 * area * extensor_pressure * outer
    return plain(pair), plain(contractor), plain(annulus)


@register(
    equations="(27)-(32)",
    status="derived",
    summary="contractor inside an extensor: pulls, pushes, and changes stiffness at constant force",
    row="extensor_contractor",
)
class AlFahaam(AffineMuscle):
    """Affine in the contractor's pressure; the extensor's pressure is a constant.

    F = (P_c - P_e)(3 L^2 - b_c^2)/(4 pi n_c^2) + P_e (3 L^2 - b_e^2)/(4 pi n_e^2).

    Parameters
    ----------
    contractor, extensor : ThinCylinder
        The inner and the outer braid.
    extensor_pressure : float
        P_e, gauge, in the annulus [Pa].
    wall_thickness : float
        Thickness of the extensor's wall [m].

    Raises
    ------
    DomainError
        For a pair whose annulus is closed; by the methods for a length at which it closes.
    """

    name: ClassVar[str] = "al_fahaam"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        "extensor_pressure": ModelParameter(
            0.0, "Pa", -1.1e5, 2e6, "gauge pressure P_e in the annulus"
        ),
        "thread_ratio": ModelParameter(
            2.0 / DESIGN_RATIO, "-", 0.1, 10.0, "thread length of the extensor over contractor's"
        ),
        "turns_ratio": ModelParameter(
            1.0 / DESIGN_RATIO, "-", 0.1, 10.0, "turns of the extensor over contractor's"
        ),
    }

    def __init__(
        self,
        contractor: ThinCylinder,
        extensor: ThinCylinder,
        extensor_pressure: float = 0.0,
        wall_thickness: float = 0.0,
    ) -> None:
        self.contractor = contractor
        self.extensor = extensor
        self.extensor_pressure = extensor_pressure
        self.wall_thickness = wall_thickness
        self._bounds = self._find_bounds()

    @classmethod
    def from_geometry(cls, geometry: MuscleGeometry, constants: Mapping[str, float]) -> AlFahaam:
        """The model of a muscle in a rig file; its thread and turns are those of the contractor."""
        thread, turns = geometry.thread_length, geometry.turns
        return cls(
            ThinCylinder(thread, turns),
            ThinCylinder(thread * constants["thread_ratio"], turns * constants["turns_ratio"]),
            constants["extensor_pressure"],
            geometry.wall_thickness,
        )

    def _find_bounds(self) -> tuple[Any, Any]:
        low: Any = 0.0
        high: Any = min(self.contractor.thread_length, self.extensor.thread_length)
        short, long = self._annulus(low), self._annulus(high)
        if short <= 0.0 and long <= 0.0:
            raise DomainError(
                f"the annulus is closed: the extensor's bore minus the contractor's diameter is "
                f"{short:g} m on a short muscle and {long:g} m on a long one"
            )
        if short * long < 0.0:
            edge = bracketed_root(self._annulus, low, high)
            low, high = (low, edge) if short > 0.0 else (edge, high)
        return low, high

    def _annulus(self, length: Any) -> Any:
        inner = braid_diameter(self.contractor.thread_length, self.contractor.turns, length)
        outer = braid_diameter(self.extensor.thread_length, self.extensor.turns, length)
        return outer - inner - 2.0 * self.wall_thickness

    @property
    def length_bounds(self) -> tuple[float, float]:
        """Lengths at which the annulus is open [m]."""
        return self._bounds

    def _check(self, length: Any) -> Any:
        reason = "the thread length or where the annulus closes"
        return require_length(length, *self._bounds, reason)

    def pair_force(self, contractor_pressure: Any, extensor_pressure: Any, length: Any) -> Any:
        """Pull [N] at both gauge pressures [Pa] and the common length [m]."""
        length = self._check(length)
        inner = self.contractor.coefficients(length)[0]
        outer = self.extensor.coefficients(length)[0]
        return (contractor_pressure - extensor_pressure) * inner + extensor_pressure * outer

    def pair_stiffness(self, contractor_pressure: Any, extensor_pressure: Any, length: Any) -> Any:
        """dF/dL [N/m] at both gauge pressures [Pa] held."""
        length = self._check(length)
        inner = self.contractor.coefficient_slopes(length)[0]
        outer = self.extensor.coefficient_slopes(length)[0]
        return (contractor_pressure - extensor_pressure) * inner + extensor_pressure * outer

    def coefficients(self, length: Any) -> tuple[Any, Any]:
        """A(L) of the contractor [m^2]; B(L) is the force of the annulus [N]."""
        length = self._check(length)
        inner = self.contractor.coefficients(length)[0]
        outer = self.extensor.coefficients(length)[0]
        return inner, self.extensor_pressure * (outer - inner)

    def coefficient_slopes(self, length: Any) -> tuple[Any, Any]:
        """dA/dL [m] and dB/dL [N/m]."""
        length = self._check(length)
        inner = self.contractor.coefficient_slopes(length)[0]
        outer = self.extensor.coefficient_slopes(length)[0]
        return inner, self.extensor_pressure * (outer - inner)

    def volume(self, length: Any) -> Any:
        """Gas volume of the contractor [m^3]."""
        length = self._check(length)
        return self.contractor.volume(length)

    def volume_slope(self, length: Any) -> Any:
        """dV/dL of the contractor [m^2]."""
        length = self._check(length)
        return self.contractor.volume_slope(length)

    def annulus_volume(self, length: Any) -> Any:
        """Gas volume between the two braids [m^3]."""
        length = self._check(length)
        return self.extensor.volume(length) - self.contractor.volume(length)
