"""Weighted least-squares fit that forgets, stays near zero without evidence, and ignores trifles.

The fit minimises the squared errors, weighted by exp(-age/memory), plus a constant penalty that
pulls every weight to 0. The penalty stands for what is believed before anything was seen: weights
with these standard deviations, and errors of this size, or of the size that the fit leaves if that
is larger. Since the penalty does not fade, the fit is regular at any time, however little has been
seen.

What the fit explains must be larger than a threshold. Near it, the weights are reduced by the
factor 1 - (threshold/explained)^2, which is 0 below it. So a rig that matches its rig file stays
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
from typing import Any, Final

import numpy as np

from pam_control.adaptation.forgetting_fit import (
    ForgettingFit,
    kept_share,
    new_state,
    write_weights,
)
from pam_control.adaptation.normal_equations import (
    N_SUMS,
    SEEN,
    add_sample,
    factorise,
    square_sum,
    squares_left,
    substitute,
    worth,
)
from pam_model.plant.compiled import for_kernel, shared_entry_point

DOUBTED: Final = 1e9  # times the penalty; such a weight is as good as 0

# What does not change of a fit: noise, threshold, least weight and gain of the suspect (a gain of 0
# means that there is none), and the number of the function whose weight is positive, or -1
NOISE, THRESHOLD, SUSPECT_LEAST, SUSPECT_BETTER, POSITIVE = range(5)
SIZE: Final = N_SUMS  # of the errors, in the state after the sums
# Rows of weights: fitted, in use, last solution, their standard deviations' penalty, doubts, and
# scratch
FITTED, WEIGHTS, SOLUTION, PENALTY, DOUBT, WANTED, ALONE, MOVED, N_ROWS = range(9)


@dataclass(frozen=True, slots=True)
class Suspect:
    """When the last function of a fit is used."""

    least: float  # least absolute weight; smaller ones are not believed
    better: float  # squared errors without it over those with it, at least [-]


def solve_with_or_without_suspect(
    given: Any, state: Any, rows: Any, products: Any, scratch: Any
) -> None:
    """Write the solution of the normal equations with what was known before."""
    count = len(rows[WANTED])
    found, alone, moved = rows[SOLUTION], rows[ALONE], rows[MOVED]
    for i in range(count):
        for j in range(count):
            scratch[i][j] = products[i][j]
        scratch[i][i] += state[SIZE] * rows[DOUBT][i] * rows[PENALTY][i]
        alone[i] = rows[WANTED][i]
        moved[i] = scratch[i][count - 1]
    if given[SUSPECT_BETTER] == 0.0:
        factorise(scratch, count)
        substitute(scratch, count, alone)
        for i in range(count):
            found[i] = alone[i]
        return
    # with and without the suspect from one factorisation, by its Schur complement
    last = count - 1
    column, corner = scratch[last], scratch[last][last]  # the factorisation leaves them
    factorise(scratch, last)
    substitute(scratch, last, alone)
    substitute(scratch, last, moved)
    weight, size = rows[WANTED][last], corner
    for i in range(last):
        weight -= column[i] * alone[i]
        size -= column[i] * moved[i]
    weight /= size
    alone[last], found[last] = 0.0, weight
    for i in range(last):
        found[i] = alone[i] - weight * moved[i]
    without = squares_left(state, products, rows[WANTED], alone)
    with_all = squares_left(state, products, rows[WANTED], found)
    believed = without > given[SUSPECT_BETTER] * with_all and abs(weight) > given[SUSPECT_LEAST]
    if not believed:
        for i in range(count):
            found[i] = alone[i]


def solve_sums(given: Any, state: Any, rows: Any, products: Any, scratch: Any) -> None:
    """Fit the weights to the sums."""
    found, fitted, positive = rows[SOLUTION], rows[FITTED], int(given[POSITIVE])
    left = squares_left(state, products, rows[WANTED], found)
    state[SIZE] = max(left / (state[SEEN] * given[NOISE] ** 2), 1.0)
    if positive >= 0:
        rows[DOUBT][positive] = 1.0
    solve_with_or_without_suspect(given, state, rows, products, scratch)
    if positive >= 0 and found[positive] < 0.0:
        rows[DOUBT][positive] = DOUBTED
        solve_with_or_without_suspect(given, state, rows, products, scratch)
    used = worth(square_sum(products, found) / state[SEEN], given[THRESHOLD] ** 2)
    for i in range(len(fitted)):
        fitted[i] = used * found[i]


@shared_entry_point
def take_sample(
    value: float, duration: float, given: Any, state: Any, rows: Any, products: Any, scratch: Any,
    functions: Any,
) -> None:  # fmt: skip
    """Take a sample after a time [s]; compute the weights.

    The rows are those of `RecursiveFit`.
    """
    if duration <= 0.0:
        return
    threshold, fitted = given[THRESHOLD], rows[FITTED]
    kept = kept_share(state, fitted, functions, value, duration, threshold)
    if add_sample(state, products, rows[WANTED], functions, value, duration, kept):
        solve_sums(given, state, rows, products, scratch)
    write_weights(state, fitted, rows[WEIGHTS])


class RecursiveFit(ForgettingFit):
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
    """

    def __init__(
        self,
        deviations: Sequence[float],
        noise: float,
        threshold: float,
        suspect: Suspect | None = None,
        positive: int | None = None,
    ) -> None:
        self._deviations, self._noise = np.array(deviations, dtype=np.float64), noise
        least, better = (suspect.least, suspect.better) if suspect else (0.0, 0.0)
        number = -1.0 if positive is None else float(positive)
        self._given = for_kernel(np.array([noise, threshold, least, better, number]))
        super().__init__(take_sample)

    def _begin(self) -> tuple[Any, ...]:
        count = len(self._deviations)
        sums, square = np.zeros((N_ROWS, count)), np.zeros((count, count))
        sums[PENALTY], sums[DOUBT] = (self._noise / self._deviations) ** 2, 1.0
        self._sums, self._products = for_kernel(sums), for_kernel(square)
        self._state = new_state()
        scratch = for_kernel(square.copy())
        self._weights = self._sums[WEIGHTS]
        return self._given, self._state, self._sums, self._products, scratch

    def deviation(self, index: int) -> float:
        """Standard deviation of one weight, in its unit."""
        sums, size = np.array(self._sums), self._state[SIZE]
        regular = np.array(self._products) + np.diag(size * sums[DOUBT] * sums[PENALTY])
        inverse = np.linalg.inv(regular)
        return self._noise * math.sqrt(size * max(float(inverse[index, index]), 0.0))
