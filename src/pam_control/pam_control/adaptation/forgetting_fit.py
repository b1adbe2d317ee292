"""What the fits of the adaptation have in common: samples that fade, and weights taken back."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from pam_control.adaptation.normal_equations import N_SUMS, SHARE, UNSOLVED, dot
from pam_control.adaptation.running_comparison import begin_comparison, compare, memory_of
from pam_model.plant.compiled import for_kernel, listed

MEMORY: Final = 15.0  # s of motion or work, not of time


def new_state() -> Any:
    """The state of a fit that has seen nothing (`normal_equations`), and 1 as its last number."""
    state = np.zeros(N_SUMS + 1)
    state[UNSOLVED], state[N_SUMS] = math.inf, 1.0
    begin_comparison(state)
    return for_kernel(state)


def kept_share(
    state: Any, fitted: Any, functions: Any, value: float, duration: float, trifle: float
) -> float:
    """Compare what a fit tells of a value with it; return the share of older samples that stays."""
    compare(state, trifle, dot(fitted, functions), value, duration)
    return math.exp(-duration / memory_of(state, MEMORY))


def write_weights(state: Any, fitted: Any, weights: Any) -> None:
    """Take back of the fitted weights what does not help."""
    for i in range(len(weights)):
        weights[i] = state[SHARE] * fitted[i]


class ForgettingFit(ABC):
    """Weights of given functions that explain a measured value; older samples fade.

    Parameters
    ----------
    take : callable
        Entry point that takes `rows`, a measured value, and a duration [s].

    Attributes
    ----------
    rows : tuple
        Of the fit, the last one for the values of the functions.
    """

    _weights: Any
    """Row of the weights, as they are to be used."""

    def __init__(self, take: Callable[..., None]) -> None:
        self._take = take
        self.forget()

    @abstractmethod
    def _begin(self) -> tuple[Any, ...]:
        """Nothing is known: make `_weights` and the rows, but for that of the functions."""

    def forget(self) -> None:
        """Nothing is known."""
        rows = self._begin()
        self._functions = for_kernel(np.zeros(len(self._weights)))
        self.rows: tuple[Any, ...] = (*rows, self._functions)

    @property
    def weights(self) -> list[float]:
        """Of the functions, as they are to be used."""
        return [*listed(self._weights)]

    def update(self, functions: Sequence[float], value: float, duration: float) -> None:
        """Take the functions' values, shape (n,), and the measured value after a time [s].

        The weights are computed anew every `SOLVED_EVERY`, because that takes most of the time. A
        sample without a duration says nothing.
        """
        self._functions[:] = functions
        self._take(value, duration, *self.rows)
