"""Wickramatunge and Leephakpreeda's empirical stiffness of the stretched muscle.

F = K L_s, K = a3 P^2 + a2 P L_s + a1 L_s^2 + a0, where L_s is the stretch from the zero-force
length. Named without a formula in "A Review of Design and Modeling of Pneumatic Artificial
Muscle"; the form is general knowledge, not verified against the source. The default constants only
give a plausible muscle: identify them. Gas volume is the ideal braid's (stand-in).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pam_model.muscles.braid import ThinCylinder, require_positive
from pam_model.muscles.elastic_wall import CurvedMuscle
from pam_model.muscles.force_model import ModelParameter, MuscleGeometry, register


@register(
    equations="-",
    status="empirical",
    summary="stiffness as a polynomial of pressure and stretch (Wickramatunge, Leephakpreeda)",
)
class Wickramatunge(CurvedMuscle):
    """Not affine in pressure, so its inverse is found by bracketing.

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].
    rest_length : float
        Unpressurised length [m].
    constants : mapping of str to float
        The constants that `parameters` lists.

    Raises
    ------
    DomainError
        For b, n or rest length not above 0; by the methods for a length outside (0, b].
    """

    name: ClassVar[str] = "wickramatunge"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        "a0": ModelParameter(2e3, "N/m", -1e6, 1e6, "stiffness without pressure or stretch"),
        "a1": ModelParameter(2e5, "N/m^3", -1e9, 1e9, "stiffness per stretch squared"),
        "a2": ModelParameter(1e-2, "N/(m^2 Pa)", -1e2, 1e2, "stiffness per pressure and stretch"),
        "a3": ModelParameter(5e-8, "N/(m Pa^2)", -1e-5, 1e-5, "stiffness per pressure squared"),
        "zero_force_ratio": ModelParameter(
            0.62, "-", 0.1, 3.0, "zero-force length over rest length"
        ),
    }

    def __init__(
        self,
        thread_length: float,
        turns: float,
        rest_length: float,
        constants: Mapping[str, float],
    ) -> None:
        self.braid = ThinCylinder(thread_length, turns)
        self._a = tuple(constants[key] for key in ("a0", "a1", "a2", "a3"))
        require_positive(rest_length=rest_length)
        self.zero_force_length = constants["zero_force_ratio"] * rest_length

    @classmethod
    def from_geometry(
        cls, geometry: MuscleGeometry, constants: Mapping[str, float]
    ) -> Wickramatunge:
        """The model of a muscle in a rig file."""
        return cls(geometry.thread_length, geometry.turns, geometry.rest_length, constants)

    def secant_stiffness(self, pressure: Any, stretch: Any) -> Any:
        """K = F/L_s [N/m] at gauge pressure [Pa] and stretch from the zero-force length [m]."""
        a0, a1, a2, a3 = self._a
        return a3 * pressure * pressure + a2 * pressure * stretch + a1 * stretch * stretch + a0

    def stretch_stiffness(self, pressure: Any, stretch: Any) -> Any:
        """dF/dL_s [N/m] at gauge pressure [Pa] and stretch [m]."""
        a0, a1, a2, a3 = self._a
        rise = 2.0 * a2 * pressure * stretch + 3.0 * a1 * stretch * stretch
        return a3 * pressure * pressure + rise + a0

    def _stretch(self, length: Any) -> Any:
        self.braid.volume(length)  # raises for a length outside (0, b]
        return length - self.zero_force_length

    def force(self, pressure: Any, length: Any, velocity: Any = 0.0) -> Any:
        """K L_s [N] at gauge pressure [Pa] and length [m]; it does not depend on speed."""
        stretch = self._stretch(length)
        return self.secant_stiffness(pressure, stretch) * stretch

    def stiffness(self, pressure: Any, length: Any) -> Any:
        """dF/dL at constant pressure [N/m]."""
        return self.stretch_stiffness(pressure, self._stretch(length))

    def pressure_slope(self, pressure: Any, length: Any) -> Any:
        """dF/dP at constant length [m^2]."""
        stretch = self._stretch(length)
        return stretch * (2.0 * self._a[3] * pressure + self._a[2] * stretch)
