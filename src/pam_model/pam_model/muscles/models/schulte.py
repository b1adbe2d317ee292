"""Elastic bladder and friction against the braid: equation (3), after Schulte.

Source: equation (3) of "A Review of Design and Modeling of Pneumatic Artificial Muscle"; both
elastic terms follow from virtual work of membrane resultants k_e (L - L_rest) along the axis and
pi k_e (d - D_rest) around it.
Errata: D in (3) is D90 = b/(n pi). The axial term is printed without a rest length, so that the
bladder would pull without pressure or stretch: `bladder_length_ratio` = 0 reproduces that. Friction
is printed for shortening only. D_0 is the bladder's diameter at rest. k_e [Pa] is a lumped
constant, not Young's modulus: for a thin tube of modulus E and wall t it is E t/(pi D_rest) around
the axis and E t/L_rest along it, so there are two constants. It is not verified whether the
original also omits L_rest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from pam_model.errors import DomainError
from pam_model.muscles.braid import ThinCylinder, require_length
from pam_model.muscles.elastic_wall import rest_diameter
from pam_model.muscles.elementary import direction, square_root
from pam_model.muscles.force_model import ModelParameter, MuscleGeometry, register


@register(
    equations="(3)",
    status="derived",
    summary="ideal braid with a linear bladder and dry friction between bladder and braid",
)
class Schulte(ThinCylinder):
    """(3), affine in pressure at rest; friction acts only in motion.

    F = kappa P (3 cos^2 - 1)
    + pi D90 [k_axial (L - L_rest) sin - k_hoop pi (cos^2/sin)(D90 sin - D_rest)]
    + sgn(dL/dt) pi L D P_c friction; P_c = max(0, P - 2 pi k_hoop (D - D_rest)/D) is the contact
    pressure left by the bladder's own hoop tension.

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    bladder_length, bladder_diameter : float
        L_rest and D_rest of the stress-free bladder [m].
    axial_constant, hoop_constant : float
        k_e along and around the axis [Pa].
    friction : float
        mu_s + mu_st [-].

    Raises
    ------
    DomainError
        For b or n not above zero, or negative constants; by the methods for a length outside
        (0, b).
    """

    name: ClassVar[str] = "schulte"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        "axial_constant": ModelParameter(20e3, "Pa", 0.0, 1e7, "k_e of the bladder along the axis"),
        "hoop_constant": ModelParameter(20e3, "Pa", 0.0, 1e7, "k_e of the bladder around the axis"),
        "bladder_length_ratio": ModelParameter(
            1.0, "-", 0.0, 2.0, "stress-free length of the bladder over the muscle's rest length"
        ),
        "bladder_diameter_ratio": ModelParameter(
            1.0, "-", 0.0, 2.0, "stress-free diameter of the bladder over the braid's at rest"
        ),
        "friction": ModelParameter(0.02, "-", 0.0, 2.0, "friction coefficients mu_s + mu_st"),
    }

    def __init__(
        self,
        thread_length: float,
        turns: float,
        *,
        bladder_length: float,
        bladder_diameter: float,
        axial_constant: float,
        hoop_constant: float,
        friction: float = 0.0,
    ) -> None:
        super().__init__(thread_length, turns)
        for quantity, value in {
            "bladder_length [m]": bladder_length,
            "bladder_diameter [m]": bladder_diameter,
            "axial_constant [Pa]": axial_constant,
            "hoop_constant [Pa]": hoop_constant,
            "friction": friction,
        }.items():
            if not 0.0 <= value < math.inf:
                raise DomainError(f"{quantity} = {value:g} must be 0 or above")
        self.bladder_length = bladder_length
        self.bladder_diameter = bladder_diameter
        self.axial_constant = axial_constant
        self.hoop_constant = hoop_constant
        self.friction_coefficient = friction
        self._diameter90 = thread_length / (turns * math.pi)

    @classmethod
    def from_geometry(cls, geometry: MuscleGeometry, constants: Mapping[str, float]) -> Schulte:
        """The model of a muscle in a rig file, with its bladder."""
        rest = rest_diameter(geometry)
        return cls(
            geometry.thread_length,
            geometry.turns,
            bladder_length=constants["bladder_length_ratio"] * geometry.rest_length,
            bladder_diameter=constants["bladder_diameter_ratio"] * rest,
            axial_constant=constants["axial_constant"],
            hoop_constant=constants["hoop_constant"],
            friction=constants["friction"],
        )

    @property
    def length_bounds(self) -> tuple[float, float]:
        """(0, b), open at b, where the diameter of the braid is zero [m]."""
        return 0.0, self.thread_length

    def _check(self, length: Any) -> Any:
        reason = "the thread length, where the diameter is zero"
        return require_length(length, 0.0, self.thread_length, reason, open_high=True)

    def _angle(self, length: Any) -> tuple[Any, Any]:
        """Cosine and sine of the thread angle."""
        length = self._check(length)
        cosine = length / self.thread_length
        return cosine, square_root(1.0 - cosine * cosine)

    def coefficients(self, length: Any) -> tuple[Any, Any]:
        """A of the ideal braid [m^2] and the bladder's pull B(L) [N]."""
        cosine, sine = self._angle(length)
        axial = self.axial_constant * (length - self.bladder_length) * sine
        around = self._diameter90 * sine - self.bladder_diameter
        hoop = self.hoop_constant * math.pi * cosine * cosine / sine * around
        return super().coefficients(length)[0], math.pi * self._diameter90 * (axial - hoop)

    def coefficient_slopes(self, length: Any) -> tuple[Any, Any]:
        """dA/dL [m] and dB/dL [N/m]."""
        cosine, sine = self._angle(length)
        thread = self.thread_length
        axial = self.axial_constant * (
            sine - (length - self.bladder_length) * cosine / (sine * thread)
        )
        rise = cosine * (1.0 + sine * sine) / (thread * sine**3)
        hoop = self.hoop_constant * math.pi
        hoop = hoop * (2.0 * self._diameter90 * cosine / thread - self.bladder_diameter * rise)
        return super().coefficient_slopes(length)[0], math.pi * self._diameter90 * (axial - hoop)

    def contact_pressure(self, pressure: Any, length: Any) -> Any:
        """P_c [Pa]: contact pressure of bladder and braid, reduced by the hoop tension."""
        _, sine = self._angle(length)
        around = 1.0 - self.bladder_diameter / (self._diameter90 * sine)
        left = pressure - 2.0 * math.pi * self.hoop_constant * around
        return max(0.0, left) if isinstance(left, float) else np.maximum(0.0, left)

    def friction(self, contact_pressure: Any, length: Any) -> Any:
        """Friction pi L D P_c (mu_s + mu_st) [N] at a contact pressure [Pa]."""
        _, sine = self._angle(length)
        area = math.pi * length * self._diameter90 * sine
        return self.friction_coefficient * area * contact_pressure

    def force(self, pressure: Any, length: Any, velocity: Any = 0.0) -> Any:
        """Pull [N]; friction adds to it in lengthening [m/s], reduces it in shortening."""
        static = super().force(pressure, length)
        loss = self.friction(self.contact_pressure(pressure, length), length)
        return static + direction(velocity) * loss
