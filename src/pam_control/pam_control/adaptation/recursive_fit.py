"""Weighted least-squares fit that forgets, stays near zero without evidence, and ignores trifles.

The fit minimises the squared errors, weighted by exp(-age/memory), plus a constant penalty that
pulls every weight to 0. The penalty stands for what is believed before anything was seen: weights
with these standard deviations, and errors of this size, or of the size that the fit leaves if that
is larger. Since the penalty does not fade, the fit is regular at any time, however little has been
seen.

What the fit explains must be larger than a threshold. Near it, the weights are reduced by the
factor 1 - (threshold/explained)^2, which is 0 below it. So a rig that is its rig file stays
untouched by noise.

One of the functions may be a suspect: it resembles others so much that most data do not tell them
apart. It is left out of the fit until the fit with it leaves so much smaller errors that nothing
else can be the cause.

What was learnt is taken back where it does not help (`running_comparison`).

Sources: A. E. Hoerl and R. W. Kennard, "Ridge regression", Technometrics 12 (1970) 55-67; L. Ljung,
System Identification, Prentice Hall 1999, section 11.2 (exponential forgetting) and 16.4 (model
selection by the reduction of the squared errors); the factor is that of W. James and C. Stein,
"Estimation with quadratic loss", 1961, in its positive-part form.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from pam_control.adaptation.running_comparison import RunningComparison

CORRELATED: Final = 0.05  # s, for which the error of a fit stays about the same
DOUBTED: Final = 1e9  # times the penalty; such a weight is as good as 0
MEMORY: Final = 15.0  # s of motion or work, not of time
SOLVED_EVERY: Final = 0.045  # s of motion or work; the weights change within seconds

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Suspect:
    """When the last function of a fit is used.

    Attributes
    ----------
    least : float
        Least absolute weight; smaller ones are not believed.
    better : float
        Squared errors without it over those with it, at least [-].
    """

    least: float
    better: float


class RecursiveFit:
    """Weights of given functions that explain a measured value.

    Parameters
    ----------
    deviations : sequence of float
        Standard deviation of each weight before anything was seen.
    noise : float
        Least standard deviation of the value, for `CORRELATED` seconds.
    threshold : float
        Root mean square that the weights must explain to be used at all, in the value's unit.
    suspect : Suspect, optional
        The last function is one.
    positive : int, optional
        Number of a function whose weight cannot be negative; it is left out where it would be.

    Attributes
    ----------
    weights : list of float
        Of the functions.
    """

    def __init__(
        self,
        deviations: Sequence[float],
        noise: float,
        threshold: float,
        suspect: Suspect | None = None,
        positive: int | None = None,
    ) -> None:
        self._noise = noise
        self._penalty: Array = (noise / np.array(deviations, dtype=np.float64)) ** 2
        self._threshold, self._suspect, self._positive = threshold, suspect, positive
        self._comparison = RunningComparison(threshold)
        self.forget()

    def forget(self) -> None:
        """Nothing is known."""
        count = len(self._penalty)
        self.weights: list[float] = [0.0] * count
        self._fitted: Array = np.zeros(count)
        self._comparison.forget()
        self._products: Array = np.zeros((count, count))
        self._wanted: Array = np.zeros(count)
        self._seen = self._energy = 0.0
        self._unsolved = math.inf
        self._solution: Array = np.zeros(count)
        self._size = 1.0
        self._doubt: Array = np.ones(count)

    def update(self, functions: Array, value: float, duration: float) -> None:
        """Take the functions' values, shape (n,), and the measured value after a time [s].

        The weights are computed anew every `SOLVED_EVERY`, because that takes most of the time.
        """
        comparison = self._comparison
        comparison.update(float(self._fitted @ functions), value, duration)
        kept = math.exp(-duration / comparison.memory(MEMORY))
        share = duration / CORRELATED
        self._products *= kept
        self._products += share * (functions[:, None] * functions)
        self._wanted = kept * self._wanted + (share * value) * functions
        self._energy = kept * self._energy + share * value * value
        self._seen = kept * self._seen + share
        self._unsolved += duration
        if self._unsolved >= SOLVED_EVERY:
            self._unsolved = 0.0
            self._fit()
        self.weights = (comparison.share * self._fitted).tolist()

    def _fit(self) -> None:
        """Compute the weights from all data."""
        left = self._left(self._solution, self._explained(self._solution))
        self._size = max(left / (self._seen * self._noise**2), 1.0)
        weights, explained = self._solved()
        self._solution = weights
        explained /= self._seen
        if explained <= self._threshold**2:
            self._fitted = np.zeros(len(weights))
        else:
            self._fitted = (1.0 - self._threshold**2 / explained) * weights

    def deviation(self, index: int) -> float:
        """Standard deviation of one weight, in its unit."""
        inverse = np.linalg.inv(self._regular())
        return self._noise * math.sqrt(self._size * max(float(inverse[index, index]), 0.0))

    def _regular(self) -> Array:
        """The normal equations with what was known before."""
        regular = self._products.copy()
        regular.flat[:: len(regular) + 1] += self._size * self._doubt * self._penalty
        return regular

    def _solved(self) -> tuple[Array, float]:
        """The weights, and the sum of the squares that they explain."""
        if self._positive is None:
            return self._with_or_without_suspect()
        self._doubt[self._positive] = 1.0
        found = self._with_or_without_suspect()
        if found[0][self._positive] >= 0.0:
            return found
        self._doubt[self._positive] = DOUBTED
        return self._with_or_without_suspect()

    def _with_or_without_suspect(self) -> tuple[Array, float]:
        regular = self._regular()
        if self._suspect is None:
            found: Array = np.linalg.solve(regular, self._wanted)
            return found, self._explained(found)
        # with and without the suspect from one factorisation, by its Schur complement
        column = regular[:-1, -1]
        sides = np.array((self._wanted[:-1], column)).T
        alone, moved = np.linalg.solve(regular[:-1, :-1], sides).T
        last = (self._wanted[-1] - column @ alone) / (regular[-1, -1] - column @ moved)
        without, with_all = np.zeros((2, len(regular)))
        without[:-1] = alone
        with_all[:-1] = alone - last * moved
        with_all[-1] = last
        less, more = self._explained(without), self._explained(with_all)
        better = self._left(without, less) > self._suspect.better * self._left(with_all, more)
        return (with_all, more) if better and abs(last) > self._suspect.least else (without, less)

    def _explained(self, weights: Array) -> float:
        """Sum of the squares that these weights explain."""
        return float(weights @ self._products @ weights)

    def _left(self, weights: Array, explained: float) -> float:
        """Sum of the squared errors that these weights leave."""
        return self._energy - 2.0 * float(weights @ self._wanted) + explained
