"""A braided cylinder that tapers to its fittings: equations (20)-(22).

Source: equations (20)-(22) of "A Review of Design and Modeling of Pneumatic Artificial Muscle",
after Doumit and Fahim; correct as printed. b and n belong to the cylindrical part (b in (23) is
that of the whole muscle); the slant of the cones is constant. The volume is that of a cylinder and
two frusta, and F = -P dV/dL by virtual work (derived; the published model balances the forces in
the threads, and its law is not in the review).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pam_model.dual_numbers import bracketed_root, is_dual, root_with_slopes, value_of
from pam_model.errors import DomainError
from pam_model.muscles.braid import AffineMuscle, require_length, require_positive
from pam_model.muscles.elementary import square_root
from pam_model.muscles.force_model import ModelParameter, MuscleGeometry

END_PARAMETERS = {
    "cone_slant": ModelParameter(0.015, "m", 1e-4, 1.0, "slant length L_z of the cone at each end"),
    "fitting_diameter": ModelParameter(0.01, "m", 1e-4, 1.0, "diameter d of the fittings"),
}
"""Constants of every model with tapered ends, as rig files name them."""


_LIMITS = "where |D - d| = 2 cone_slant, the length turns back, or a bladder fills the braid"


class EndState(NamedTuple):
    """A tapered braid at one middle length; names with digits are derivatives by that length."""

    diameter: Any
    cone_length: Any
    length: Any
    length1: Any
    length2: Any
    volume: Any
    volume1: Any
    volume2: Any


class TaperedBraid(AffineMuscle):
    """A cylinder with two cones; affine in pressure with B = 0.

    Parameters
    ----------
    thread_length : float
        b of the cylindrical part [m].
    turns : float
        n of the cylindrical part [-].
    cone_slant : float
        L_z [m].
    fitting_diameter : float
        d [m].

    Raises
    ------
    DomainError
        For a quantity not above zero, or cones too short to join braid and fitting; by the
        methods for a length outside `length_bounds`.
    """

    def __init__(
        self, thread_length: float, turns: float, cone_slant: float, fitting_diameter: float
    ) -> None:
        require_positive(
            thread_length=thread_length,
            turns=turns,
            cone_slant=cone_slant,
            fitting_diameter=fitting_diameter,
        )
        self.thread_length = thread_length
        self.turns = turns
        self.cone_slant = cone_slant
        self.fitting_diameter = fitting_diameter
        self._square = thread_length**2
        self._pitch = (math.pi * turns) ** 2
        # The iteration for the middle length needs plain numbers.
        self._plain = tuple(
            float(value_of(x)) for x in (self._square, self._pitch, fitting_diameter, cone_slant)
        )
        self._has_slopes = is_dual(thread_length, turns, cone_slant, fitting_diameter)
        self.middle_bounds = self._find_middle_bounds()
        self._bounds = self._find_bounds()

    def _find_bounds(self) -> tuple[Any, Any]:
        low, high = self.middle_bounds
        self._plain_bounds = float(value_of(low)), float(value_of(high))
        inside = 1e-9 * (high - low)
        return self._state(low + inside).length, self._state(high - inside).length

    def _keep_room_for(self, wall_volume: float) -> None:
        """Narrow the bounds to lengths at which this volume of rubber [m^3] leaves room for gas."""
        low, high = self.middle_bounds
        middles = np.linspace(value_of(low), value_of(high), 202)[1:-1]
        volumes = value_of(self._state(middles).volume)
        widest = int(np.argmax(volumes))
        if volumes[widest] <= wall_volume:
            raise DomainError(
                f"rubber of {wall_volume:g} m^3 does not fit into a braid that holds "
                f"{volumes[widest]:g} m^3 at most"
            )

        def room(middle: Any) -> Any:
            return self._state(middle).volume - wall_volume

        inside = 1e-9 * (high - low)
        peak = float(middles[widest])
        if room(low + inside) < 0.0:
            low = bracketed_root(room, low + inside, peak)
        if room(high - inside) < 0.0:
            high = bracketed_root(room, peak, high - inside)
        self.middle_bounds = low, high
        self._bounds = self._find_bounds()

    def _find_middle_bounds(self) -> tuple[Any, Any]:
        """Middle lengths between which the cones exist and the muscle lengthens with them [m]."""
        thread, diameter90 = self.thread_length, self.thread_length / square_root(self._pitch)
        # slightly inside |D - d| = 2 cone_slant, where slopes are infinite
        widest = self.fitting_diameter + 2.0 * (1.0 - 1e-9) * self.cone_slant
        narrowest = max(0.0, self.fitting_diameter - 2.0 * self.cone_slant)
        if diameter90 <= narrowest:
            raise DomainError(
                f"|D - d| is above 2 cone_slant = {2.0 * self.cone_slant:g} m at every length: "
                f"the braid reaches D = {diameter90:g} m at most and the fittings have d = "
                f"{self.fitting_diameter:g} m"
            )
        low = thread * square_root(1.0 - min(1.0, widest / diameter90) ** 2)
        high = thread * square_root(1.0 - (narrowest / diameter90) ** 2)

        def slope(middle: Any) -> Any:
            # dL/dL_m times its positive factor, so that it is finite at both ends
            size = square_root(max(0.0, self._square - middle**2) / self._pitch)
            excess = size - self.fitting_diameter
            cone = square_root(max(0.0, self.cone_slant**2 - 0.25 * excess**2))
            return 2.0 * cone * self._pitch * size + excess * middle

        if slope(high) < 0.0:
            start = thread * square_root(1.0 - min(1.0, self.fitting_diameter / diameter90) ** 2)
            high = bracketed_root(slope, max(low, start), high)
        return low, high

    def state(self, middle_length: Any) -> EndState:
        """(20)-(22) at a length of the cylindrical part [m]."""
        low, high = self.middle_bounds
        return self._state(require_length(middle_length, low, high, _LIMITS))

    def _state(self, middle: Any) -> EndState:
        pitch, fitting = self._pitch, self.fitting_diameter
        size = square_root((self._square - middle * middle) / pitch)
        size1 = -middle / (pitch * size)
        size2 = -(1.0 + pitch * size1 * size1) / (pitch * size)
        excess = size - fitting
        cone = square_root(self.cone_slant * self.cone_slant - 0.25 * excess * excess)
        cone1 = -excess * size1 / (4.0 * cone)
        cone2 = -(size1 * size1 + excess * size2) / (4.0 * cone) - cone1 * cone1 / cone
        section = size * size + size * fitting + fitting * fitting
        section1 = (2.0 * size + fitting) * size1
        section2 = 2.0 * size1 * size1 + (2.0 * size + fitting) * size2
        quarter, sixth = 0.25 * math.pi, math.pi / 6.0
        return EndState(
            size,
            cone,
            middle + 2.0 * cone,
            1.0 + 2.0 * cone1,
            2.0 * cone2,
            quarter * size * size * middle + sixth * cone * section,
            quarter * (2.0 * size * size1 * middle + size * size)
            + sixth * (cone1 * section + cone * section1),
            quarter * (2.0 * (size1 * size1 + size * size2) * middle + 4.0 * size * size1)
            + sixth * (cone2 * section + 2.0 * cone1 * section1 + cone * section2),
        )

    def cone_angle(self, middle_length: Any) -> Any:
        """Beta = asin((D - d)/(2 L_z)) [rad] at a length of the cylindrical part [m]."""
        size = self.state(middle_length).diameter
        return np.arcsin((size - self.fitting_diameter) / (2.0 * self.cone_slant))

    @property
    def length_bounds(self) -> tuple[float, float]:
        """Shortest and longest length of the whole muscle [m]."""
        return self._bounds

    def middle_length(self, length: Any) -> Any:
        """L_m [m] of the cylindrical part at a length [m] of the whole muscle."""
        low, high = self._bounds
        length = require_length(length, low, high, _LIMITS)
        if isinstance(length, float):
            middle = self._solve(length)
        else:
            middle = self._solve_all(np.asarray(value_of(length), dtype=float))
        if self._has_slopes or is_dual(length):
            return root_with_slopes(middle, lambda at: self._whole_length(at) - length)
        return middle

    def _solve(self, length: float) -> float:
        """Newton's method; a step that leaves the bracket is replaced by bisection."""
        square, pitch, fitting, slant = self._plain
        low, high = self._plain_bounds
        middle = min(max(length - 2.0 * slant, low), high)
        if not low < middle < high:
            middle = 0.5 * (low + high)
        for _ in range(100):
            size = math.sqrt((square - middle * middle) / pitch)
            excess = size - fitting
            cone = math.sqrt(slant * slant - 0.25 * excess * excess)
            error = middle + 2.0 * cone - length
            low, high = (low, middle) if error > 0.0 else (middle, high)
            step = middle - error / (1.0 + excess * middle / (2.0 * cone * pitch * size))
            if (step - middle) ** 2 <= 1e-30 * square:
                return step
            middle = step if low < step < high else 0.5 * (low + high)
        return middle

    def _solve_all(self, length: Any) -> Any:
        """As `_solve`, for an array of lengths at once."""
        square, pitch, fitting, slant = self._plain
        low, high = (np.full(length.shape, bound) for bound in self._plain_bounds)
        middle = np.clip(length - 2.0 * slant, low, high)
        middle = np.where((low < middle) & (middle < high), middle, 0.5 * (low + high))
        done = np.zeros(length.shape, dtype=bool)
        for _ in range(100):
            size = np.sqrt((square - middle * middle) / pitch)
            excess = size - fitting
            cone = np.sqrt(slant * slant - 0.25 * excess * excess)
            error = middle + 2.0 * cone - length
            low, high = np.where(error > 0.0, low, middle), np.where(error > 0.0, middle, high)
            step = middle - error / (1.0 + excess * middle / (2.0 * cone * pitch * size))
            settled = (step - middle) ** 2 <= 1e-30 * square
            inside = np.where((low < step) & (step < high), step, 0.5 * (low + high))
            middle = np.where(done, middle, np.where(settled, step, inside))
            done |= settled
            if np.all(done):
                break
        return middle

    def _whole_length(self, middle: Any) -> Any:
        """L [m] at a middle length [m]."""
        excess = square_root((self._square - middle * middle) / self._pitch) - self.fitting_diameter
        return middle + 2.0 * square_root(self.cone_slant**2 - 0.25 * excess**2)

    def at(self, length: Any) -> EndState:
        """The state at a length [m] of the whole muscle."""
        return self._state(self.middle_length(length))

    def coefficients(self, length: Any) -> tuple[Any, Any]:
        """A = -dV/dL [m^2] and B = 0 [N]."""
        state = self.at(length)
        return -state.volume1 / state.length1, 0.0 * length

    def coefficient_slopes(self, length: Any) -> tuple[Any, Any]:
        """dA/dL [m] and 0 [N/m]."""
        state = self.at(length)
        turn = state.volume2 * state.length1 - state.volume1 * state.length2
        return -turn / state.length1**3, 0.0 * length

    def volume(self, length: Any) -> Any:
        """Volume of the cylinder and the cones [m^3]."""
        return self.at(length).volume

    def volume_slope(self, length: Any) -> Any:
        """dV/dL [m^2]."""
        state = self.at(length)
        return state.volume1 / state.length1


def cylindrical_part(
    geometry: MuscleGeometry, cone_slant: float, fitting_diameter: float
) -> tuple[Any, Any, Any]:
    """Thread length b [m], turns n and rest length [m] of the cylinder between the cones.

    The thread of a rig file runs along the whole muscle. At rest, the cones take their share of
    its length and turns, and the cylinder has the diameter that the rig file implies.

    Raises
    ------
    DomainError
        For cones that do not fit the muscle at rest.
    """
    thread, turns, rest = geometry.thread_length, geometry.turns, geometry.rest_length
    require_positive(thread_length=thread, turns=turns, rest_length=rest)
    if rest >= thread:
        raise DomainError(f"rest_length = {rest:g} m is outside (0, {thread:g}) m")
    size = square_root(thread**2 - rest**2) / (math.pi * turns)
    square = cone_slant**2 - 0.25 * (size - fitting_diameter) ** 2
    if square <= 0.0:
        raise DomainError(
            f"|D - d| = {abs(size - fitting_diameter):g} m at rest must be below 2 cone_slant = "
            f"{2.0 * cone_slant:g} m"
        )
    middle = rest - 2.0 * square_root(square)
    if middle <= 0.0:
        raise DomainError(
            f"rest_length = {rest:g} m leaves no cylinder between two cones of "
            f"{square_root(square):g} m"
        )
    return thread * middle / rest, turns * middle / rest, middle
