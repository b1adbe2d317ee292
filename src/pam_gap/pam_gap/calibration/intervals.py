"""How well a fit knows its numbers, and combinations of them.

The covariance of a least squares estimate with correlated errors is H^-1 S H^-1, where H are the
normal equations and S the covariance of their right side, estimated from blocks of time (White,
Econometrica 48, 1980; Liang and Zeger, Biometrika 73, 1986). What was known beforehand is further
observations with independent errors. They have more weight than one sample of the log, whose errors
are correlated (`CalibrationRules.correlation`). The amounts of an ordinary background are further
numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pam_gap.calibration.calibration_rules import CalibrationRules
from pam_gap.inference.confidence import NORMAL_90
from pam_gap.inference.held_out import Folds
from pam_gap.inference.hypothesis import Hypothesis, HypothesisFitter
from pam_gap.prediction.fit import Array, FreeParameter, Scaling, mean_squares


@dataclass(frozen=True, slots=True)
class Knowledge:
    """Values and covariance of the numbers of a fit."""

    free: tuple[FreeParameter, ...]  # the numbers
    values: Array  # shape (n,): in their own units
    # shape (n, n): of the values, or of the logarithms of those that are fitted by their logarithms
    covariance: Array
    # shape (n,): standard deviations before the log, in the same measure; infinite where nothing
    # was known
    before: Array

    def kept(self, narrowed: float, places: Sequence[int]) -> list[int]:
        """Places of the numbers of which the log says nothing that was not known before.

        A log fixes combinations, such as the ratio of an inertia to the pull of the muscles. One
        number after the other is kept at what was known, the least narrowed one first, and its
        uncertainty is then taken from the others.

        Parameters
        ----------
        narrowed : float
            Deviation over that before the log, above which a number is kept.
        places : sequence of int
            The numbers that may be kept.
        """
        rest, found = self.covariance.copy(), list[int]()
        others = np.setdiff1d(np.arange(self.values.size), places)
        while True:
            share = np.sqrt(np.maximum(np.diag(rest), 0.0)) / self.before
            share[[*found, *others]] = 0.0
            place = int(np.argmax(share))
            if not share[place] > narrowed:
                return found
            found.append(place)
            rest = rest - np.outer(rest[:, place], rest[place]) / rest[place, place]

    def given(self, kept: Sequence[int], values: Array) -> Array:
        """Values (own units) of all numbers if some are known to be as in `values`."""
        if not kept:
            return self.values
        own = [i for i in range(self.values.size) if i not in kept]
        logs = np.array([p.is_logarithmic for p in self.free])
        at, goal = (
            np.where(logs, np.log(np.where(logs, x, 1.0)), x) for x in (self.values, values)
        )
        block = self.covariance[np.ix_(kept, kept)]
        moved = at.copy()
        moved[kept] = goal[kept]
        moved[own] += self.covariance[np.ix_(own, kept)] @ np.linalg.solve(block, (goal - at)[kept])
        own_units = np.where(logs, np.exp(np.where(logs, moved, 0.0)), moved)
        low = np.array([p.low for p in self.free])
        high = np.array([p.high for p in self.free])
        result: Array = np.clip(own_units, low, high)
        return result

    def relative_deviation(self, place: int, weights: Array) -> float:
        """Deviation of the logarithm of one number less a weighted sum of those of others."""
        row = -weights.copy()
        row[place] += 1.0
        return math.sqrt(max(float(row @ self.covariance @ row), 0.0))

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


def jacobian_at(fitter: HypothesisFitter, values: Array, rules: CalibrationRules) -> Array:
    """Derivative of the errors by all scaled numbers at one point, by central differences.

    A fit keeps columns from one step to the next. Combinations of numbers that change nothing, such
    as the scale of all forces, are only seen if all columns belong to one point.

    Parameters
    ----------
    values : ndarray, shape (n,)
        The point, in own units.
    rules : CalibrationRules
        Step of the differences, and of the integration: a coarse one would make errors that depend
        on the numbers.

    Returns
    -------
    ndarray, shape (rows, channels, n)
    """
    scaling = Scaling([n.free for n in fitter.nuisances])
    at = np.clip(scaling.scaled(values), scaling.low, scaling.high)
    lanes = np.repeat(at[None], 2 * at.size, axis=0)
    ends = lanes.reshape(2, at.size, at.size)
    place = np.arange(at.size)
    ends[0, place, place] = np.minimum(at + rules.difference, scaling.high)
    ends[1, place, place] = np.maximum(at - rules.difference, scaling.low)
    width = ends[0, place, place] - ends[1, place, place]
    full = np.array([fitter.vector((), lane) for lane in scaling.own(lanes)])
    errors = fitter.problem.with_step(rules.fine_step).errors(full)
    change = (errors[: at.size] - errors[at.size :]) / width[:, None, None]
    result: Array = np.moveaxis(change, 0, -1)
    return result


def knowledge(
    fitter: HypothesisFitter, folds: Folds, fitted: Hypothesis, rules: CalibrationRules
) -> Knowledge:
    """Covariance of a fit without effects, its ordinary background included.

    Parameters
    ----------
    folds : Folds
        Blocks of time of the problem.
    rules : CalibrationRules
        How far errors are correlated, and how much more than they show the laws of a rig differ.
    """
    free: Sequence[FreeParameter] = [n.free for n in fitter.nuisances]
    result, own = fitted.result, len(fitter.nuisances)
    values = result.values
    jacobian = jacobian_at(fitter, values, rules)
    if fitter.background is not None and result.amounts.size:
        terms = fitter.background.terms
        free = [*free, *terms.free]
        values = np.concatenate([values, result.amounts])
        jacobian = np.concatenate([jacobian, terms.slopes()], axis=-1)
    scaling = Scaling(free)
    counted = fitter.problem.counted
    weights = 1.0 / np.maximum(mean_squares(result.errors, counted), fitter.floor)
    n = len(free)
    slopes, hessian = np.zeros((folds.n_blocks, n)), np.zeros((n, n))
    for channel in np.flatnonzero(fitter.problem.present):
        e, d = result.errors[:, channel], jacobian[:, channel]
        known = counted & np.isfinite(e) & np.isfinite(d).all(axis=1)
        hessian += weights[channel] * d[known].T @ d[known]
        inside = known & (folds.score_block >= 0)
        share = int(known.sum()) / max(int(inside.sum()), 1)
        pulls = np.sqrt(share) * weights[channel] * d[inside] * e[inside, None]
        np.add.at(slopes, folds.score_block[inside], pulls)
    score = long_run_covariance(slopes - slopes.mean(axis=0), rules.lags) + hessian
    prior = np.diag(scaling.weight**2)
    whole = hessian + prior
    whole[np.diag_indices(n)] += 1e-9 * np.max(np.diag(whole)) + 1e-12
    inverse = np.linalg.inv(whole)
    # what was known beforehand has the weight of `correlation` independent observations
    scaled = inverse @ (rules.discrepancy**2 * score + rules.correlation * prior) @ inverse
    covariance = scaled * np.outer(scaling.size, scaling.size)
    known_before = np.sqrt(rules.correlation) * np.array([p.prior for p in free])
    before = np.where(known_before > 0.0, known_before, np.inf)
    return Knowledge(tuple(free[:own]), values[:own], covariance[:own, :own], before[:own])
