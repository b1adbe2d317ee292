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
1 - (threshold/explained)^2, which is 0 below it. So a rig that is its rig file stays untouched by
noise.

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
from typing import Final

import numpy as np
import numpy.typing as npt

from pam_control.adaptation.recursive_fit import CORRELATED, DOUBTED, MEMORY, SOLVED_EVERY
from pam_control.adaptation.running_comparison import RunningComparison

PIVOTS: Final = 6  # exchanges of what is at its bound; the last sets are nearly always right
BELIEVED_FOR: Final = 0.25  # s of motion, for which the believed error counts
FOLLOWS: Final = 0.3  # s of motion, in which the weights follow a fit that explains too little
EXPLAINED: Final = 2.0  # times the noise, which the errors of a fit exceed that does so

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Rival:
    """One explanation.

    Attributes
    ----------
    functions : tuple of int
        Numbers of its functions.
    log_odds : float
        Logarithm of its probability before anything was seen, up to a constant that is common to
        all rivals [-].
    better : float
        Squared errors of the best ordinary rival over its own, at least, for it to take part [-]; 1
        for an ordinary one. The evidence alone would prefer it for any trifle that all rivals lack.
    """

    functions: tuple[int, ...]
    log_odds: float
    better: float = 1.0


class AveragedFit:
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

    Attributes
    ----------
    weights : list of float
        Of the functions, as they are to be used.
    fitted : list of float
        Of the functions, as the data show them now.
    probabilities : ndarray
        Of the rivals [-].
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
        self._noise, self._believed, self._threshold = noise, believed, threshold
        count = len(deviations)
        self._odds: Array = np.array([rival.log_odds for rival in rivals])
        self._better: Array = np.array([rival.better for rival in rivals])
        self._has = np.array([[n in rival.functions for n in range(count)] for rival in rivals])
        self._penalty: Array = np.where(self._has, 1.0, DOUBTED)
        self._penalty /= np.array(deviations, dtype=np.float64) ** 2
        self._bounds: Array = np.full(count, -math.inf)
        for number, least in bounds.items():
            self._bounds[number] = least
        self._finite: Array = np.where(np.isfinite(self._bounds), self._bounds, 0.0)
        self._diagonal = np.arange(count)
        self._comparison = RunningComparison(threshold)
        self.forget()

    def forget(self) -> None:
        """Nothing is known."""
        rivals, count = self._penalty.shape
        self.weights: list[float] = [0.0] * count
        self.fitted: list[float] = [0.0] * count
        self._followed: Array = np.zeros(count)
        self._comparison.forget()
        self.probabilities: Array = np.full(rivals, 1.0 / rivals)
        self._products: Array = np.zeros((count, count))
        self._wanted: Array = np.zeros(count)
        self._seen = self._energy = 0.0
        self._unsolved = math.inf
        self._unexplained = 1.0  # squared errors of the fit, by those that are too large
        self._solutions: Array = np.zeros((rivals, count))
        self._at_bound = np.zeros((rivals, count), dtype=bool)

    def certainty(self, function: int) -> float:
        """Probability of the rivals that have a function [-]."""
        return float(self.probabilities @ self._has[:, function])

    def update(self, functions: Array, value: float, duration: float) -> None:
        """Take the functions' values, shape (n,), and the measured value after a time [s].

        The weights are computed anew every `SOLVED_EVERY`, because that takes most of the time.
        """
        comparison = self._comparison
        comparison.update(float(self._followed @ functions), value, duration)
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
        within = max(FOLLOWS * self._unexplained, duration)
        self._followed += -math.expm1(-duration / within) * (self.fitted - self._followed)
        if not any(self.fitted) and self._explained(self._followed) <= 0.01 * self._least:
            self._followed[:] = 0.0
        self.weights = (comparison.share * self._followed).tolist()

    def _fit(self) -> None:
        """Compute the fitted weights from all data."""
        before = BELIEVED_FOR / CORRELATED
        samples, doubt = self._seen + before, before * np.square(self._believed)
        variance = np.maximum((self._left() + doubt) / samples, self._noise**2)
        regular = self._products / variance[:, None, None]
        regular[:, self._diagonal, self._diagonal] += self._penalty
        self._solve(regular, self._wanted / variance[:, None])
        left = self._left()
        errors = (left + doubt) / variance
        errors += (self._penalty * self._solutions**2).sum(axis=1)
        _, size = np.linalg.slogdet(regular)
        occam = size - np.log(self._penalty).sum(axis=1)
        evidence = self._odds - 0.5 * (occam + samples * np.log(variance) + errors)
        ordinary = self._better == 1.0
        evidence[~ordinary & (self._better * left > left[ordinary].min())] = -math.inf
        odds = np.exp(evidence - evidence.max())
        self.probabilities = odds / odds.sum()
        doubtful = (EXPLAINED * self._noise) ** 2
        errors = float(self.probabilities @ left) + before * doubtful
        self._unexplained = min(errors / (samples * doubtful), 1.0)
        weights = self.probabilities @ self._solutions
        explained, least = self._explained(weights), self._least
        if explained <= least:
            self.fitted = [0.0] * len(weights)
        else:
            self.fitted = ((1.0 - least / explained) * weights).tolist()

    @property
    def _least(self) -> float:
        """Sum of the squares that weights must explain to be used at all."""
        return self._threshold**2 * self._seen

    def _explained(self, weights: Array) -> float:
        """Sum of the squares that these weights explain."""
        return float(weights @ self._products @ weights)

    def _solve(self, regular: Array, wanted: Array) -> None:
        """Find the weights of all rivals, each above its bound."""
        for _ in range(PIVOTS):
            held = np.where(self._at_bound, DOUBTED * self._penalty, 0.0)
            matrices = regular.copy()
            matrices[:, self._diagonal, self._diagonal] += held
            sides = wanted + held * self._finite
            found: Array = np.linalg.solve(matrices, sides[..., None])[..., 0]
            self._solutions = found
            # what pulls a weight that is held down from above
            pull = wanted - np.einsum("rij,rj->ri", regular, found)
            at_bound = np.where(self._at_bound, pull <= 0.0, found < self._bounds)
            if (at_bound == self._at_bound).all():
                return
            self._at_bound = at_bound

    def _left(self) -> Array:
        """Sum of the squared errors that the weights of each rival leave."""
        weights = self._solutions
        explained = ((weights @ self._products) * weights).sum(axis=1)
        left: Array = np.maximum(self._energy - 2.0 * weights @ self._wanted + explained, 0.0)
        return left
