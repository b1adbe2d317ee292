"""Weights of functions that explain a value, averaged over rival explanations by their probability.

A rival is a subset of the functions. With few data, several of them leave equally small errors, and
the one with the most functions leaves the least. Each rival is fitted by Bayesian regression: its
weights have a normal prior in physical units, and its errors a variance with a scaled inverse
chi-squared prior. The evidence, the probability of the data under a rival, rewards small errors and
penalises functions that the data do not need. The weights that are used are the means of all rivals
times their posterior probabilities: what is not yet known to be the cause acts in proportion to
how sure it is.

Errors count by exp(-age/memory). Some weights have a lower bound that physics gives, such as that
of dry friction, which cannot drive a joint.

With few data the weights change as fast as the values: they would be a feedback, whose margins
nobody has designed. As long as no rival explains the values, the weights that are used follow the
fit within a time that is long compared with the feedback; the smaller the errors that it leaves,
compared with the noise, the faster they follow. They are taken back where they do not help
(`running_comparison`).

What the weights explain must be larger than a threshold. Near it, they are reduced by the factor
1 - (threshold/explained)^2, which is 0 below it. So a rig that matches its rig file stays
untouched by noise.

An exact rival, whose functions are the law itself, is believed sooner than one whose functions only
resemble it: the more of the values it explains, the faster the weights follow, although its errors
are still larger than the noise; and it has to explain only more than noise would by chance, which
is the variance of the errors for each function. A motion that has just begun is told in time so.

Sources: J. A. Hoeting, D. Madigan, A. E. Raftery, C. T. Volinsky, "Bayesian model averaging: a
tutorial", Statistical Science 14 (1999) 382-417; D. J. C. MacKay, "Bayesian interpolation", Neural
Computation 4 (1992) 415-447 (evidence with an estimated variance); J. J. Judice, F. M. Pires,
"Basic-set algorithm for a generalized linear complementarity problem", Journal of Optimization
Theory and Applications 74 (1992) 391-411 (block principal pivoting for the bounds); the factor is
that of W. James and C. Stein, "Estimation with quadratic loss", 1961, in its positive-part form.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
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
    CORRELATED,
    ENERGY,
    N_SUMS,
    SEEN,
    Array,
    add_sample,
    factorise,
    log_determinant,
    square_sum,
    squares_left,
    substitute,
    worth,
)
from pam_control.adaptation.recursive_fit import DOUBTED
from pam_model.plant.compiled import for_kernel, listed, shared_entry_point

PIVOTS: Final = 6  # exchanges of what is at its bound; the last sets are nearly always right
BELIEVED_FOR: Final = 0.1  # s of motion, for which the believed error counts
SOON: Final = 0.03  # of the motion that was seen: so often a fit of few samples is solved again
FOLLOWS: Final = 0.3  # s of motion, in which the weights follow a fit that explains too little
EXPLAINED: Final = 2.0  # times the noise, which the errors of a fit exceed that does so

# What does not change of a fit: noise, believed error, threshold
NOISE, BELIEVED, THRESHOLD = range(3)
# In the state after the sums: squared errors of the fit by those of one that explains too little
UNEXPLAINED: Final = N_SUMS
# Rows of weights: as the data show them, as they follow these, as they are used, bounds, sums, and
# scratch
FITTED, FOLLOWED, WEIGHTS, BOUND, WANTED, SIDE, N_ROWS = range(7)
# Of each rival: log odds, least gain, logarithm of the determinant of its penalty, what it leaves,
# evidence, probability, number of its functions, what it would explain of noise, and whether it is
# exact
(ODDS, BETTER, PRIOR_SIZE, LEFT, EVIDENCE, PROBABILITY, COUNT, BY_CHANCE, EXACT,
 N_RIVAL) = range(10)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Rival:
    """One explanation."""

    functions: tuple[int, ...]  # numbers of its functions
    # logarithm of its probability before anything was seen, up to a constant that is common to all
    # rivals [-]
    log_odds: float
    # Squared errors of the best ordinary rival over its own, at least, for it to take part [-]; 1
    # for an ordinary one. The evidence alone would prefer it for any trifle that all rivals lack.
    better: float = 1.0
    # whether its functions are those of the law itself, and do not only resemble it
    exact: bool = True


def rival_left(state: Any, rows: Any, products: Any, weights: Any) -> float:
    """Sum of the squared errors that the weights of a rival leave."""
    return max(squares_left(state, products, rows[WANTED], weights), 0.0)


def regular_equations(
    products: Any, penalty: Any, variance: float, held: Any, doubt: float, scratch: Any
) -> None:
    """Write the normal equations of a rival, in which weights at their bounds are held there."""
    for i in range(len(penalty)):
        for j in range(len(penalty)):
            scratch[i][j] = products[i][j] / variance
        scratch[i][i] += penalty[i] * (1.0 + doubt * held[i])


def solve_rival(
    rows: Any, products: Any, penalty: Any, variance: float, held: Any, solution: Any, scratch: Any
) -> None:
    """Find the weights of a rival, each above its bound."""
    count = len(penalty)
    for _ in range(PIVOTS):
        regular_equations(products, penalty, variance, held, DOUBTED, scratch)
        factorise(scratch, count)
        for i in range(count):
            solution[i] = rows[WANTED][i] / variance
            if held[i] > 0.0:
                solution[i] += DOUBTED * penalty[i] * rows[BOUND][i]
        substitute(scratch, count, solution)
        changed = False
        for i in range(count):
            if held[i] > 0.0:
                # what pulls a weight that is held down from above
                pull = rows[WANTED][i] / variance - penalty[i] * solution[i]
                for j in range(count):
                    pull -= products[i][j] * solution[j] / variance
                at_bound = 1.0 if pull <= 0.0 else 0.0
            else:
                at_bound = 1.0 if solution[i] < rows[BOUND][i] else 0.0
            rows[SIDE][i] = at_bound
            changed = changed or at_bound != held[i]
        if not changed:
            return
        for i in range(count):
            held[i] = rows[SIDE][i]


def fit_rivals(
    given: Any, state: Any, rows: Any, products: Any, rivals: Any, penalties: Any, held: Any,
    solutions: Any, scratch: Any,
) -> None:  # fmt: skip
    """Compute the weights and the probabilities of all rivals, and the fitted weights."""
    count, before = len(rows[WANTED]), BELIEVED_FOR / CORRELATED
    samples, doubt = state[SEEN] + before, before * given[BELIEVED] * given[BELIEVED]
    ordinary, best = math.inf, -math.inf
    for r in range(len(rivals)):
        rival, penalty, weights = rivals[r], penalties[r], solutions[r]
        variance = (rival_left(state, rows, products, weights) + doubt) / samples
        variance = max(variance, given[NOISE] * given[NOISE])
        solve_rival(rows, products, penalty, variance, held[r], weights, scratch)
        left = rival_left(state, rows, products, weights)
        errors = (left + doubt) / variance
        for i in range(count):
            errors += penalty[i] * weights[i] * weights[i]
        regular_equations(products, penalty, variance, held[r], 0.0, scratch)
        factorise(scratch, count)
        occam = log_determinant(scratch, count) - rival[PRIOR_SIZE]
        rival[LEFT], rival[BY_CHANCE] = left, variance * rival[COUNT]
        rival[EVIDENCE] = rival[ODDS] - 0.5 * (occam + samples * math.log(variance) + errors)
        if rival[BETTER] == 1.0:
            ordinary = min(ordinary, left)
    for r in range(len(rivals)):
        rival = rivals[r]
        if rival[BETTER] != 1.0 and rival[BETTER] * rival[LEFT] > ordinary:
            rival[EVIDENCE] = -math.inf
        best = max(best, rival[EVIDENCE])
    total = 0.0
    for r in range(len(rivals)):
        rivals[r][PROBABILITY] = math.exp(rivals[r][EVIDENCE] - best)
        total += rivals[r][PROBABILITY]
    fitted = rows[FITTED]
    for i in range(count):
        fitted[i] = 0.0
    left = by_chance = exact = 0.0
    for r in range(len(rivals)):
        rival = rivals[r]
        rival[PROBABILITY] /= total
        left += rival[PROBABILITY] * rival[LEFT]
        by_chance += rival[PROBABILITY] * rival[BY_CHANCE]
        exact += rival[PROBABILITY] * rival[EXACT]
        for i in range(count):
            fitted[i] += rival[PROBABILITY] * solutions[r][i]
    doubtful = (EXPLAINED * given[NOISE]) ** 2
    unexplained = min((left + before * doubtful) / (samples * doubtful), 1.0)
    share = min((left + doubt) / (state[ENERGY] + doubt), unexplained)
    state[UNEXPLAINED] = unexplained + exact * (share - unexplained)
    trifle = given[THRESHOLD] ** 2 * state[SEEN]
    least = trifle + exact * (min(by_chance, trifle) - trifle)
    used = worth(square_sum(products, fitted), least)
    for i in range(count):
        fitted[i] *= used


@shared_entry_point
def take_rival_sample(
    value: float, duration: float, given: Any, state: Any, rows: Any, products: Any, rivals: Any,
    has: Any, penalties: Any, held: Any, solutions: Any, scratch: Any, functions: Any,
) -> None:  # fmt: skip
    """Take a sample after a time [s]; compute the weights.

    The rows are those of `AveragedFit`.
    """
    if duration <= 0.0:
        return
    followed = rows[FOLLOWED]
    kept = kept_share(state, followed, functions, value, duration, given[THRESHOLD])
    if add_sample(state, products, rows[WANTED], functions, value, duration, kept, SOON):
        fit_rivals(given, state, rows, products, rivals, penalties, held, solutions, scratch)
    fitted, nothing = rows[FITTED], True
    nearer = -math.expm1(-duration / max(FOLLOWS * state[UNEXPLAINED], duration))
    for i in range(len(fitted)):
        followed[i] += nearer * (fitted[i] - followed[i])
        nothing = nothing and fitted[i] == 0.0
    trifle = 0.01 * given[THRESHOLD] ** 2 * state[SEEN]
    if nothing and square_sum(products, followed) <= trifle:
        for i in range(len(followed)):
            followed[i] = 0.0
    write_weights(state, followed, rows[WEIGHTS])


def certainty_of(rivals: Any, has: Any, function: int) -> float:
    """Probability of the rivals that have a function [-]."""
    total = 0.0
    for r in range(len(rivals)):
        total += rivals[r][PROBABILITY] * has[r][function]
    return total


class AveragedFit(ForgettingFit):
    """Weights of given functions that explain a measured value.

    Parameters
    ----------
    deviations : sequence of float
        (n,), standard deviation of each weight before anything was seen.
    rivals : sequence of Rival
        The explanations.
    noise : float
        Least standard deviation of the value, for `CORRELATED` seconds.
    believed : float
        Standard deviation of the errors before much was seen, in the value's unit.
    threshold : float
        Root mean square that the weights must explain to be used at all, in the value's unit.
    bounds : mapping of int to float
        Least weight by the number of the function.
    """

    def __init__(
        self,
        deviations: Sequence[float],
        rivals: Sequence[Rival],
        noise: float,
        believed: float,
        threshold: float,
        bounds: Mapping[int, float],
    ) -> None:
        count = len(deviations)
        has = [[number in rival.functions for number in range(count)] for rival in rivals]
        self._has = for_kernel(np.array(has, dtype=np.float64))
        self._penalty: Array = np.where(has, 1.0, DOUBTED)
        self._penalty /= np.array(deviations, dtype=np.float64) ** 2
        self._bounds = [bounds.get(number, -math.inf) for number in range(count)]
        self._rivals = rivals
        self._given = for_kernel(np.array([noise, believed, threshold]))
        super().__init__(take_rival_sample)

    def _begin(self) -> tuple[Any, ...]:
        count, rivals = len(self._bounds), len(self._rivals)
        sums, table = np.zeros((N_ROWS, count)), np.zeros((rivals, N_RIVAL))
        sums[BOUND] = self._bounds
        table[:, ODDS] = [rival.log_odds for rival in self._rivals]
        table[:, BETTER] = [rival.better for rival in self._rivals]
        table[:, COUNT] = [len(rival.functions) for rival in self._rivals]
        table[:, EXACT] = [rival.exact for rival in self._rivals]
        table[:, PRIOR_SIZE] = np.log(self._penalty).sum(axis=1)
        table[:, PROBABILITY] = 1.0 / rivals
        self._sums, self._table = for_kernel(sums), for_kernel(table)
        self._weights = self._sums[WEIGHTS]
        return (
            self._given,
            new_state(),
            self._sums,
            for_kernel(np.zeros((count, count))),
            self._table,
            self._has,
            for_kernel(self._penalty),
            for_kernel(np.zeros((rivals, count))),
            for_kernel(np.zeros((rivals, count))),
            for_kernel(np.zeros((count, count))),
        )

    @property
    def fitted(self) -> list[float]:
        """Of the functions, as the data show them now."""
        return [*listed(self._sums[FITTED])]

    @property
    def probabilities(self) -> list[float]:
        """Of the rivals [-]."""
        return [float(rival[PROBABILITY]) for rival in self._table]

    def certainty(self, function: int) -> float:
        """Probability of the rivals that have a function [-]."""
        return certainty_of(self._table, self._has, function)
