"""What the fits of the adaptation have in common: samples that fade, and weights taken back."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from pam_control.adaptation.running_comparison import RunningComparison
from pam_model.plant.compiled import for_kernel, listed, prepare

MEMORY: Final = 15.0  # s of motion or work, not of time


class ForgettingFit(ABC):
    """Weights of given functions that explain a measured value; older samples fade.

    Parameters
    ----------
    take : callable
        Entry point that takes the arguments of `_begin`, and the functions' values, the measured
        value, a duration [s] and the share of older samples that stays.
    threshold : float
        Root mean square below which nothing is judged, in the value's unit.

    Attributes
    ----------
    weights : list of float
        Of the functions, as they are to be used.
    """

    _used: Any
    """Row of the weights, before what does not help is taken back."""

    def __init__(self, take: Callable[..., None], threshold: float) -> None:
        self._take, self._comparison = take, RunningComparison(threshold)
        self.forget()
        self._functions = for_kernel(np.zeros(len(self._used)))
        prepare(take, *self._arguments, self._functions, 0.0, 0.0, 0.0)

    @abstractmethod
    def _begin(self) -> tuple[Any, ...]:
        """Nothing is known: make `_used`, and the rows for the entry point."""

    def forget(self) -> None:
        """Nothing is known."""
        self._comparison.forget()
        self._arguments = self._begin()
        self.weights: list[float] = [0.0] * len(self._used)

    def update(self, functions: Sequence[float], value: float, duration: float) -> None:
        """Take the functions' values, shape (n,), and the measured value after a time [s].

        The weights are computed anew every `SOLVED_EVERY`, because that takes most of the time. A
        sample without a duration says nothing.
        """
        if duration <= 0.0:
            return
        comparison = self._comparison
        comparison.update(math.sumprod(listed(self._used), functions), value, duration)
        kept = math.exp(-duration / comparison.memory(MEMORY))
        self._functions[:] = functions
        self._take(*self._arguments, self._functions, value, duration, kept)
        share, used = comparison.share, listed(self._used)
        self.weights = used.copy() if share == 1.0 else [share * weight for weight in used]
