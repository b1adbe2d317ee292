"""The length at which a muscle pulls with a given force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pam_model.errors import DomainError
from pam_model.muscles.force_model import ForceModel

Array = npt.NDArray[np.float64]
_STEPS = 60
_SETTLED = 1e-9
_SCAN = 40


@dataclass(frozen=True, slots=True)
class Equilibrium:
    """Lengths [m], and where they lie at a bound because no length in between gives the force."""

    length: Array
    at_longest: Any
    at_shortest: Any


def length_range(model: ForceModel, longest: float) -> tuple[float, float]:
    """Shortest and longest length [m] just inside the model's bounds and up to a stop at `longest`.

    Raises
    ------
    DomainError
        If the range is empty.
    """
    shortest, bound = model.length_bounds
    longest = min(longest, bound)
    margin = 1e-9 * (longest - shortest)
    if not margin > 0.0:
        raise DomainError(f"model {model.name}: no length between {shortest:g} and {longest:g} m")
    return shortest + margin, longest - margin


def slope_at(
    model: ForceModel, pressure: Array, length: Array, velocity: Array, ends: tuple[float, float]
) -> Array:
    """dF/dL [N/m] of the total force, by finite differences within `ends` [m].

    The model's own stiffness does not include terms that depend on speed, such as friction.
    """
    step = 1e-6 * (ends[1] - ends[0])
    low, high = np.maximum(length - step, ends[0]), np.minimum(length + step, ends[1])
    rise = np.asarray(model.force(pressure, high, velocity), dtype=float) - np.asarray(
        model.force(pressure, low, velocity), dtype=float
    )
    return np.asarray(rise / (high - low))


def solve_equilibrium(
    model: ForceModel,
    pressure: Array,
    force: Array,
    velocity: Array,
    longest: float,
) -> Equilibrium:
    """As `equilibrium_length`, and also report which lengths lie at a bound."""
    shortest, longest = length_range(model, longest)

    def excess(length: Array) -> Array:
        return np.asarray(model.force(pressure, length, velocity), dtype=float) - force

    low = np.full(pressure.shape, shortest)
    high = np.full(pressure.shape, longest)
    weak_at_high, strong_at_low = excess(high) < 0.0, excess(low) > 0.0
    if np.any(strong_at_low & ~weak_at_high):
        # A stiffening rubber may also pull at the short end. The muscle starts at its stop and
        # settles where its pull first equals the load.
        for start in np.linspace(longest, shortest, _SCAN)[1:-1]:
            weak = strong_at_low & (excess(np.full(pressure.shape, start)) < 0.0)
            low = np.where(weak, start, low)
            strong_at_low &= ~weak
    at_bound = weak_at_high | strong_at_low
    length = 0.5 * (low + high)
    for _ in range(_STEPS):
        error = excess(length)
        low = np.where(error < 0.0, length, low)
        high = np.where(error < 0.0, high, length)
        slope = slope_at(model, pressure, length, velocity, (shortest, longest))
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = length - error / slope
        usable = (newton >= low) & (newton <= high)
        following = np.where(usable, newton, 0.5 * (low + high))
        # Newton's method converges quadratically: the next step would be the square of this one.
        settled = np.abs(following - length) <= _SETTLED * longest
        length = following
        if np.all(settled | at_bound):
            break
    length = np.where(strong_at_low, shortest, length)
    length = np.where(weak_at_high, longest, length)
    return Equilibrium(length, weak_at_high, strong_at_low & ~weak_at_high)


def equilibrium_length(
    model: ForceModel, pressure: Array, force: Array, velocity: Array, longest: float
) -> Array:
    """The length [m] at which a model pulls with a given force, between its bounds.

    The force rises with length. If no length within the bounds gives the force, the result is the
    nearer bound: a muscle that is too weak for its load hangs at its longest length. Solved by
    Newton's method inside a shrinking bracket.

    Parameters
    ----------
    model : ForceModel
        The muscle.
    pressure, force, velocity : array
        Gauge pressure [Pa], pull [N], lengthening speed [m/s].
    longest : float
        Length of the muscle's stop [m].

    Raises
    ------
    DomainError
        If the model raises it.
    """
    return solve_equilibrium(model, pressure, force, velocity, longest).length
