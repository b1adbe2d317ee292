"""How well a fit knows its numbers, and combinations of them.

The covariance of a least squares estimate with correlated errors is H^-1 S H^-1, where H are the
normal equations and S the covariance of their right side, estimated from blocks of time (White,
Econometrica 48, 1980; Liang and Zeger, Biometrika 73, 1986). What was known beforehand is further
observations with independent errors. They have more weight than one sample of the log, whose errors
are correlated (`CalibrationRules.correlation`). The amounts of an ordinary background are further
numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pam_gap.calibration.calibration_rules import CalibrationRules
from pam_gap.calibration.last_steps import FittedPoint, all_free
from pam_gap.inference.confidence import NORMAL_90
from pam_gap.inference.held_out import make_folds
from pam_gap.inference.hypothesis import HypothesisFitter
from pam_gap.prediction.fit import Array, FreeParameter, Scaling, mean_squares

REGULAR = 1e-10
"""Added to normal equations, over their own diagonal: of some numbers, nothing at all is known."""


@dataclass(frozen=True, slots=True)
class Knowledge:
    """Values of the numbers of a fit, and what they are known from.

    Matrices are of the scaled numbers, those of the small errors included, which come last.
    """

    free: tuple[FreeParameter, ...]  # all numbers
    values: Array  # shape (n,): in their own units
    hessian: Array  # shape (n, n): normal equations of the log alone
    score: Array  # shape (n, n): covariance of their right side
    prior: Array  # shape (n,): weights in the fit of what was known before
    weight: float  # what was known before has the weight of this number of observations

    @property
    def before(self) -> Array:
        """Deviations before the log, as in a covariance; infinite where nothing was known."""
        with np.errstate(divide="ignore"):
            result: Array = Scaling(self.free).size * np.sqrt(self.weight / self.prior)
        return result

    def covariance(self, kept: Sequence[int] = ()) -> Array:
        """Covariance of the errors of all numbers if some are kept at what was known before.

        Whoever keeps a number at what is written also keeps its error, which passes on to the
        others: an inertia follows from the pull of the muscles, and this from the kept lengths.

        Returns
        -------
        ndarray, shape (n, n)
            Of the values, or of the logarithms of those that are fitted by their logarithms.
        """
        n, kept = self.values.size, list(kept)
        own = np.setdiff1d(np.arange(n), kept)
        inverse = self._inverse(own)
        # what was known beforehand has the weight of so many independent observations
        pull = self.score[np.ix_(own, own)] + self.weight * np.diag(self.prior[own])
        errors = self.weight / self.prior[kept]
        passed = -inverse @ self.hessian[np.ix_(own, kept)]
        result = np.zeros((n, n))
        result[np.ix_(own, own)] = inverse @ pull @ inverse + (passed * errors) @ passed.T
        result[np.ix_(own, kept)] = passed * errors
        result[np.ix_(kept, own)] = result[np.ix_(own, kept)].T
        result[kept, kept] = errors
        size = Scaling(self.free).size
        scaled: Array = result * np.outer(size, size)
        return scaled

    def kept(self, most: Mapping[int, float]) -> list[int]:
        """Places of the numbers of which the log says nothing that was not known before.

        A log fixes combinations, such as the ratio of an inertia to the pull of the muscles. One
        number after the other is kept at what was known, the least narrowed one first, and its
        uncertainty is then taken from the others.

        Parameters
        ----------
        most : mapping of int to float
            By the place of each number that may be kept: deviation over that before the log, above
            which it is.
        """
        rest, found, before = self.covariance(), list[int](), self.before
        limit = np.full(self.values.size, np.inf)
        limit[list(most)] = list(most.values())
        while True:
            share = np.sqrt(np.maximum(np.diag(rest), 0.0)) / before / limit
            share[found] = 0.0
            place = int(np.argmax(share))
            if not share[place] > 1.0:
                return found
            found.append(place)
            rest = rest - np.outer(rest[:, place], rest[place]) / rest[place, place]

    def given(self, kept: Sequence[int]) -> Array:
        """Values (own units) of all numbers if some are kept at what was known before."""
        scaling, kept = Scaling(self.free), list(kept)
        own = np.setdiff1d(np.arange(self.values.size), kept)
        at = scaling.scaled(self.values)
        moved = scaling.centre[kept] - at[kept]
        at[kept] += moved
        at[own] -= self._inverse(own) @ self.hessian[np.ix_(own, kept)] @ moved
        return scaling.own(np.clip(at, scaling.low, scaling.high))

    def _inverse(self, own: npt.NDArray[np.intp]) -> Array:
        """Inverse of the normal equations of some numbers, with what was known before."""
        whole = (self.hessian + np.diag(self.prior))[np.ix_(own, own)]
        size = np.sqrt(np.diag(whole) + 1e-12)
        result: Array = np.linalg.inv(
            whole / np.outer(size, size) + REGULAR * np.eye(own.size)
        ) / np.outer(size, size)
        return result

    def about(self, place: int, value: float, deviation: float) -> tuple[float, float]:
        """The 90 % interval of one number about a value, within its bounds."""
        free, reach = self.free[place], NORMAL_90 * deviation
        low, high = value - reach, value + reach
        if free.is_logarithmic:
            low, high = value * float(np.exp(-reach)), value * float(np.exp(reach))
        return max(low, free.low), min(high, free.high)


def long_run_covariance(pulls: Array, lags: int) -> Array:
    """Covariance of a sum of terms of which neighbours are correlated.

    Source: Newey and West, Econometrica 55 (1987), Bartlett weights.

    Parameters
    ----------
    pulls : ndarray, shape (blocks, n)
        Terms with mean 0, in the order of time.
    lags : int
        Blocks up to which they are correlated.
    """
    total = pulls.T @ pulls
    for lag in range(1, min(lags, len(pulls) - 1) + 1):
        part = pulls[lag:].T @ pulls[:-lag]
        total = total + (1.0 - lag / (lags + 1.0)) * (part + part.T)
    result: Array = total
    return result


def knowledge(
    fitter: HypothesisFitter, point: FittedPoint, jacobian: Array, rules: CalibrationRules
) -> Knowledge:
    """What a fit without effects knows, its ordinary background included.

    Parameters
    ----------
    fitter : HypothesisFitter
        The fit.
    point, jacobian
        Where it has ended, of `last_steps`.
    rules : CalibrationRules
        How far errors are correlated, and how much more than they show the laws of a rig differ.
    """
    free = all_free(fitter)
    counted, folds = fitter.problem.counted, make_folds(fitter.problem)
    weights = 1.0 / np.maximum(mean_squares(point.errors, counted), fitter.floor)
    n = len(free)
    slopes, hessian = np.zeros((folds.n_blocks, n)), np.zeros((n, n))
    for channel in np.flatnonzero(fitter.problem.present):
        e, d = point.errors[:, channel], jacobian[:, channel]
        known = counted & np.isfinite(e) & np.isfinite(d).all(axis=1)
        hessian += weights[channel] * d[known].T @ d[known]
        inside = known & (folds.score_block >= 0)
        share = int(known.sum()) / max(int(inside.sum()), 1)
        pulls = np.sqrt(share) * weights[channel] * d[inside] * e[inside, None]
        np.add.at(slopes, folds.score_block[inside], pulls)
    score = long_run_covariance(slopes - slopes.mean(axis=0), rules.lags) + hessian
    values = np.concatenate([point.values, point.amounts])
    prior = Scaling(free).weight ** 2
    return Knowledge(
        tuple(free), values, hessian, rules.discrepancy**2 * score, prior, rules.correlation
    )
