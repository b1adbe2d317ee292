"""Shared parts of the models of a braided cylinder: thread geometry, and force from volume.

Source: equations (2), (5), (6), (23) of "A Review of Design and Modeling of Pneumatic Artificial
Muscle"; forces from virtual work, F = -P dV/dL.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Any, ClassVar

import numpy as np

from pam_model.domain import ROUNDING
from pam_model.dual_numbers import value_of
from pam_model.errors import DomainError
from pam_model.muscles.closed_chamber import ClosedChamber
from pam_model.muscles.elementary import arc_cosine, is_finite_positive, square_root

NEUTRAL_ANGLE = math.acos(1.0 / math.sqrt(3.0))
"""Thread angle at which an ideal braid neither contracts nor extends, 54.7356 degrees [rad]."""


def diameter_at_90_degrees(thread_length: float, turns: float) -> float:
    """D90 = b/(n pi): the diameter at a thread angle of 90 degrees [m]."""
    return thread_length / (turns * math.pi)


def thread_angle(thread_length: float, length: Any) -> Any:
    """Angle between thread and axis, arccos(L/b) [rad], for lengths in [m]."""
    return arc_cosine(length / thread_length)


def braid_diameter(thread_length: float, turns: float, length: Any) -> Any:
    """(23): D = sqrt(b^2 - L^2)/(n pi) [m], for lengths in [m]."""
    square = thread_length * thread_length - length * length
    return square_root(square) / (turns * math.pi)


def require_positive(**quantities: float) -> None:
    """Check constants that must be finite and above zero.

    Raises
    ------
    DomainError
        Naming the first that is not finite and above zero.
    """
    for quantity, value in quantities.items():
        if not is_finite_positive(value):
            raise DomainError(f"{quantity} = {value:g} must be above 0")


def require_length(
    length: Any, low: float, high: float, reason: str, *, open_high: bool = False
) -> Any:
    """The same lengths [m], checked to lie in (low, high].

    A length that exceeds `high` by no more than rounding (`domain.ROUNDING`, relative) counts as
    `high`, since the length of a path along the joint is a sum with rounding errors.

    Parameters
    ----------
    length : float or array
        Lengths to check [m].
    low, high : float
        The bounds [m].
    reason : str
        Meaning of the upper bound, for the message.
    open_high : bool
        Whether `high` itself is outside the range.

    Raises
    ------
    DomainError
        Naming the bounds, and `reason` for the upper one.
    """
    if isinstance(length, float):
        if low < length < high:
            return length
        if not open_high and high <= length <= high * (1.0 + ROUNDING):
            return high
        worst = length
    else:
        lengths, longest = np.asarray(value_of(length), dtype=float), value_of(high)
        above = lengths >= longest
        good = lengths > value_of(low)
        good &= ~above if open_high else (lengths <= longest * (1.0 + ROUNDING))
        if bool(np.all(good)):
            return np.minimum(length, high) if bool(np.any(above)) else length
        worst = float(lengths[~good].flat[0])
    end = ")" if open_high else "]"
    raise DomainError(f"length {worst:g} m is outside ({low:g}, {high:g}{end} m, {reason}")


class AffineMuscle(ClosedChamber):
    """Force, stiffness and closed stiffness of a model with F = pressure * A(L) + B(L).

    A subclass defines `coefficients`, `coefficient_slopes`, `volume` and `volume_slope`.
    """

    name: ClassVar[str]

    @abstractmethod
    def coefficients(self, length: Any) -> tuple[Any, Any]:
        """A(L) [m^2] and B(L) [N]."""

    @abstractmethod
    def coefficient_slopes(self, length: Any) -> tuple[Any, Any]:
        """dA/dL [m] and dB/dL [N/m]."""

    def force(self, pressure: Any, length: Any, velocity: Any = 0.0) -> Any:
        """Pull [N] at gauge pressure [Pa] and length [m]; it does not depend on speed."""
        scale, passive = self.coefficients(length)
        return pressure * scale + passive

    def stiffness(self, pressure: Any, length: Any) -> Any:
        """dF/dL at constant pressure [N/m]."""
        scale, passive = self.coefficient_slopes(length)
        return pressure * scale + passive

    def pressure_slope(self, pressure: Any, length: Any) -> Any:
        """dF/dP at constant length [m^2], which is A(L)."""
        return self.coefficients(length)[0]


class ThinCylinder(AffineMuscle):
    """The ideal braid: the volume V = L (b^2 - L^2)/(4 pi n^2) and the force from its virtual work.

    Parameters
    ----------
    thread_length : float
        b [m].
    turns : float
        n [-].

    Raises
    ------
    DomainError
        For b or n not above zero; by the methods for a length outside (0, b].
    """

    def __init__(self, thread_length: float, turns: float) -> None:
        require_positive(thread_length=thread_length, turns=turns)
        self.thread_length = thread_length
        self.turns = turns
        self._square = thread_length * thread_length
        self._scale = 1.0 / (4.0 * math.pi * turns * turns)

    @property
    def length_bounds(self) -> tuple[float, float]:
        """(0, b): the muscle cannot be longer than its threads [m]."""
        return 0.0, self.thread_length

    def _check(self, length: Any) -> Any:
        if isinstance(length, float) and 0.0 < length < self.thread_length:
            return length
        return require_length(length, 0.0, self.thread_length, "the thread length")

    def coefficients(self, length: Any) -> tuple[Any, Any]:
        """A = (3 L^2 - b^2)/(4 pi n^2) [m^2] and B = 0 [N]."""
        length = self._check(length)
        return (3.0 * length * length - self._square) * self._scale, 0.0 * length

    def coefficient_slopes(self, length: Any) -> tuple[Any, Any]:
        """dA/dL = 6 L/(4 pi n^2) [m] and 0 [N/m]."""
        length = self._check(length)
        return 6.0 * length * self._scale, 0.0 * length

    def volume(self, length: Any) -> Any:
        """(5): V = L (b^2 - L^2)/(4 pi n^2) [m^3]."""
        length = self._check(length)
        return length * (self._square - length * length) * self._scale

    def volume_slope(self, length: Any) -> Any:
        """dV/dL = (b^2 - 3 L^2)/(4 pi n^2) [m^2]."""
        length = self._check(length)
        return (self._square - 3.0 * length * length) * self._scale
