"""Weighted least-squares fit that forgets, stays near zero without evidence, and ignores trifles.

The fit minimises the squared errors, weighted by exp(-age/memory), plus a constant penalty that
pulls every weight to 0. The penalty stands for what is believed before anything was seen: weights
with these standard deviations, and errors of this size. Since the penalty does not fade, the fit
is regular at any time, however little has been seen.

What the fit explains must be larger than a threshold. Near it, the weights are reduced by the
factor 1 - (threshold/explained)^2, which is 0 below it. So a rig that is its rig file stays
untouched by noise.

Sources: A. E. Hoerl and R. W. Kennard, "Ridge regression", Technometrics 12 (1970) 55-67; L. Ljung,
System Identification, Prentice Hall 1999, section 11.2 (exponential forgetting); the factor is
that of W. James and C. Stein, "Estimation with quadratic loss", 1961, in its positive-part form.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

CORRELATED: Final = 0.05  # s, for which the error of a fit stays about the same
MEMORY: Final = 15.0  # s of motion or work, not of time

Array = npt.NDArray[np.float64]


class RecursiveFit:
    """Weights of given functions that explain a measured value.

    Parameters
    ----------
    deviations : sequence of float
        Standard deviation of each weight before anything was seen.
    noise : float
        Standard deviation of the value, for `CORRELATED` seconds.
    threshold : float
        Root mean square that the weights must explain to be used at all, in the value's unit.

    Attributes
    ----------
    weights : list of float
        Of the functions.
    """

    def __init__(self, deviations: Sequence[float], noise: float, threshold: float) -> None:
        self._penalty: Array = np.diag((noise / np.array(deviations, dtype=np.float64)) ** 2)
        self._threshold = threshold
        self.forget()

    def forget(self) -> None:
        """Nothing is known."""
        count = len(self._penalty)
        self.weights: list[float] = [0.0] * count
        self._products: Array = np.zeros((count, count))
        self._wanted: Array = np.zeros(count)
        self._seen = 0.0

    def update(self, functions: Array, value: float, duration: float) -> None:
        """Take the functions' values, shape (n,), and the measured value after a time [s]."""
        kept, share = math.exp(-duration / MEMORY), duration / CORRELATED
        self._products = kept * self._products + share * np.outer(functions, functions)
        self._wanted = kept * self._wanted + (share * value) * functions
        self._seen = kept * self._seen + share
        weights = np.linalg.solve(self._products + self._penalty, self._wanted)
        explained = float(weights @ self._products @ weights) / self._seen
        if explained <= self._threshold**2:
            self.weights = [0.0] * len(weights)
        else:
            self.weights = ((1.0 - self._threshold**2 / explained) * weights).tolist()
