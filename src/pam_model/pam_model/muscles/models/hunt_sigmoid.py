"""Pressure as a tangent of contraction, after Hunt: a sigmoid length-pressure curve.

P = a0 + a1 tan(a2 (eps/(eps_max - a4 F) - a3)) + a5 F + a6 S, S = +1 shortening, -1 lengthening,
0 at rest. Named without an equation in "A Review of Design and Modeling of Pneumatic Artificial
Muscle"; form and constants (a muscle of 10 mm) are from public code; that this code implements the
reviewed model is inferred. Published forms differ in the placement of the brackets; only this one
gives zero pressure at zero contraction and 624 kPa at eps_max. eps_max depends on the muscle's
length: 0.1491 at 153 mm, 0.1750 at 281 mm. Gas volume is the ideal braid's (stand-in).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np

from pam_model.domain import plain, require
from pam_model.dual_numbers import is_dual, root_with_slopes, value_of
from pam_model.errors import DomainError
from pam_model.muscles.braid import ThinCylinder, require_length, require_positive
from pam_model.muscles.elastic_wall import CurvedMuscle
from pam_model.muscles.elementary import direction, tangent
from pam_model.muscles.force_model import ModelParameter, MuscleGeometry, register


class HuntConstants(NamedTuple):
    """The constants of the formula above; a1 to a4 are above zero."""

    a0: float = 254.3e3
    a1: float = 192e3
    a2: float = 2.0265
    a3: float = 0.461
    a4: float = 0.331e-3
    a5: float = 1.23e3
    a6: float = 15.6e3


@register(
    equations="-",
    status="empirical",
    summary="pressure as a tangent of contraction and force, with hysteresis by direction (Hunt)",
)
class HuntSigmoid(CurvedMuscle):
    """The force is solved numerically from the pressure formula; not affine in pressure.

    Parameters
    ----------
    thread_length : float
        b [m], for the gas volume.
    turns : float
        n [-], for the gas volume.
    rest_length : float
        Length at zero contraction [m].
    maximum_contraction : float
        eps_max [-].
    constants : HuntConstants
        a0 to a6.

    Raises
    ------
    DomainError
        For a quantity that must be above zero and is not; by the methods for a length outside
        `length_bounds`, or a force outside the branch of the tangent.
    """

    name: ClassVar[str] = "hunt_sigmoid"
    parameters: ClassVar[Mapping[str, ModelParameter]] = {
        "maximum_contraction": ModelParameter(0.1667, "-", 0.01, 0.6, "eps_max"),
        "a0": ModelParameter(254.3e3, "Pa", -1e7, 1e7, "pressure at the middle of the sigmoid"),
        "a1": ModelParameter(192e3, "Pa", 1.0, 1e7, "pressure scale of the tangent"),
        "a2": ModelParameter(2.0265, "-", 1e-3, 100.0, "steepness of the tangent"),
        "a3": ModelParameter(0.461, "-", 0.0, 10.0, "contraction ratio at the middle"),
        "a4": ModelParameter(0.331e-3, "1/N", 0.0, 1.0, "loss of contraction per force"),
        "a5": ModelParameter(1.23e3, "Pa/N", 1.0, 1e7, "pressure per force"),
        "a6": ModelParameter(15.6e3, "Pa", -1e6, 1e6, "hysteresis, half width"),
    }

    def __init__(
        self,
        thread_length: float,
        turns: float,
        rest_length: float,
        maximum_contraction: float,
        constants: HuntConstants | None = None,
    ) -> None:
        fit = constants or HuntConstants()
        require_positive(
            rest_length=rest_length,
            maximum_contraction=maximum_contraction,
            a1=fit.a1,
            a2=fit.a2,
            a5=fit.a5,
        )
        self.braid = ThinCylinder(thread_length, turns)
        self.rest_length = rest_length
        self.maximum_contraction = maximum_contraction
        self.constants = fit

    @classmethod
    def from_geometry(cls, geometry: MuscleGeometry, constants: Mapping[str, float]) -> HuntSigmoid:
        """The model of a muscle in a rig file."""
        fit = {key: value for key, value in constants.items() if key != "maximum_contraction"}
        return cls(
            geometry.thread_length,
            geometry.turns,
            geometry.rest_length,
            constants["maximum_contraction"],
            HuntConstants(**fit),
        )

    @property
    def length_bounds(self) -> tuple[float, float]:
        """From the tangent's pole at zero force to the rest length [m]."""
        pole = self.maximum_contraction * (self.constants.a3 + 0.5 * math.pi / self.constants.a2)
        return max(0.0, self.rest_length * (1.0 - pole)), self.rest_length

    def pressure(self, force: Any, contraction: Any, shortening: Any = 0.0) -> Any:
        """Gauge pressure [Pa] for a force [N], contraction ratio, and direction -1, 0 or 1.

        Raises
        ------
        DomainError
            For a force that leaves no contraction, eps_max <= a4 F, or an angle of the tangent
            outside (-pi/2, pi/2).
        """
        fit = self.constants
        room = self.maximum_contraction - fit.a4 * force
        require("eps_max - a4 F [-]", room, 0.0, open_low=True, why="no contraction is left")
        angle = fit.a2 * (contraction / room - fit.a3)
        half = 0.5 * math.pi
        require("tangent's angle [rad]", angle, -half, half, open_low=True, open_high=True)
        return plain(fit.a0 + fit.a1 * np.tan(angle) + fit.a5 * force + fit.a6 * shortening)

    def force(self, pressure: Any, length: Any, velocity: Any = 0.0) -> Any:
        """Pull [N] at gauge pressure [Pa], length [m], lengthening speed [m/s]."""
        contraction = self._contraction(length)
        wanted = pressure + self.constants.a6 * direction(velocity)
        if is_dual(wanted, contraction, *self.constants, self.maximum_contraction):
            # Solved with plain numbers; the formula then gives the derivatives of the root.
            plainly = HuntSigmoid(
                value_of(self.braid.thread_length),
                value_of(self.braid.turns),
                value_of(self.rest_length),
                value_of(self.maximum_contraction),
                HuntConstants(*(value_of(number) for number in self.constants)),
            )
            solve = np.vectorize(plainly._solve, otypes=[float])
            found = solve(value_of(wanted), value_of(contraction))
            return root_with_slopes(found, lambda f: self._pressure(f, contraction) - wanted)
        if isinstance(wanted, float) and isinstance(contraction, float):
            return self._solve(wanted, contraction)
        return np.vectorize(self._solve, otypes=[float])(wanted, contraction)

    def _pressure(self, force: Any, contraction: Any) -> Any:
        """The formula without hysteresis and checks, also for dual numbers."""
        fit = self.constants
        angle = fit.a2 * (contraction / (self.maximum_contraction - fit.a4 * force) - fit.a3)
        return fit.a0 + fit.a1 * tangent(angle) + fit.a5 * force

    def stiffness(self, pressure: Any, length: Any) -> Any:
        """dF/dL at constant pressure [N/m]."""
        by_force, by_contraction = self._slopes(pressure, length)
        return by_contraction / by_force / self.rest_length

    def pressure_slope(self, pressure: Any, length: Any) -> Any:
        """dF/dP at constant length [m^2]."""
        return 1.0 / self._slopes(pressure, length)[0]

    def _contraction(self, length: Any) -> Any:
        length = require_length(length, *self.length_bounds, "the rest length")
        return 1.0 - length / self.rest_length

    def _slopes(self, pressure: Any, length: Any) -> tuple[Any, Any]:
        """dP/dF and dP/d(contraction)."""
        fit, contraction = self.constants, self._contraction(length)
        room = self.maximum_contraction - fit.a4 * self.force(pressure, length)
        cosine = np.cos(fit.a2 * (contraction / room - fit.a3))
        rise = plain(fit.a1 * fit.a2 / (cosine * cosine * room))
        return fit.a5 + rise * contraction * fit.a4 / room, rise

    def _solve(self, pressure: float, contraction: float) -> float:
        """Newton's method for the force; bisection replaces steps that leave the bracket.

        Pressure rises with force up to the pole, so there is only one root. Newton's steps
        converge to it from above; from below they may overshoot it.
        """
        a0, a1, a2, a3, a4, a5, _ = self.constants
        if contraction <= 0.0:  # the tangent no longer depends on the force
            force = (pressure - a0 + a1 * math.tan(a2 * a3)) / a5
            if a4 * force >= self.maximum_contraction:
                raise DomainError(
                    f"pressure {pressure:g} Pa at rest length gives {force:g} N, which leaves no "
                    f"contraction: a4 F must be below eps_max = {self.maximum_contraction:g}"
                )
            return force
        # the pole: contraction/room = a3 + pi/(2 a2); at zero contraction the only pole is room = 0
        pole = contraction / (a3 + 0.5 * math.pi / a2)
        high = (self.maximum_contraction - pole) / a4 if a4 > 0.0 else math.inf
        if a4 == 0.0 and pole >= self.maximum_contraction:
            raise DomainError(f"contraction {contraction:g} is beyond the tangent's pole")
        low = -math.inf
        force = min(0.0, high - 1.0 / a5 * a1)
        for _ in range(200):
            room = self.maximum_contraction - a4 * force
            angle = a2 * (contraction / room - a3)
            tangent = math.tan(angle)
            error = a0 + a1 * tangent + a5 * force - pressure
            slope = a5 + a1 * a2 * (1.0 + tangent * tangent) * contraction * a4 / (room * room)
            low, high = (low, force) if error > 0.0 else (force, high)
            step = force - error / slope
            if abs(step - force) <= 1e-12 * (1.0 + abs(force)) and low <= step <= high:
                return step
            if not low < step < high:
                step = 0.5 * (low + high)
            force = step
        return force
