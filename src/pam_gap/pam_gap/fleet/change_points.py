"""Steps and slopes in a series of values with intervals, by weighted least squares and BIC.

The model is a constant plus steps (a repair, a break) and slopes, each from a date on (wear). Terms
are added one by one while the Bayesian information criterion falls, their dates are adjusted after
each addition, and terms that are no longer needed are removed. A term costs more than one logarithm
of the number of values, because its date and its kind are searched, too; a slope that begins with
the series has no date to search and costs one logarithm less (N. Zhang and D. Siegmund, "A modified
Bayes information criterion", Biometrics 63, 2007, have three). The cost rises where the values are
few, because the variance is estimated as well (C. Hurvich and C.-L. Tsai, Biometrika 76, 1989). Its
size keeps false changes below 5 % of series without any, also with outliers and with intervals
three times too short.

Intervals of single recordings say nothing about what differs from one motion to the next. A
variance is therefore added to theirs, and estimated together with the model. Its standard deviation
is in proportion to the size of the effect (the median of neighbouring values), except for a tenth:
where a leak was closed, the values of different motions hardly differ any more.
Errors have a Student distribution with 4 degrees of freedom, so that a single outlier is no change
(K. Lange, R. Little and J. Taylor, J. Am. Stat. Assoc. 84, 1989).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.stats import t as student_quantile

from pam_gap.rules import DEFAULT

Array = npt.NDArray[np.float64]

STEP, SLOPE = "step", "slope"
NORMAL_90 = 1.645
"""Standard deviations to either side of a 90 % interval."""
PROFILE_90 = 2.71
"""Rise of -2 log likelihood at the ends of a 90 % interval of a date (chi square, 1 degree)."""
RULES = DEFAULT.fleet
_SPREADS = (0.0, *np.geomspace(0.05, 8.0, 14).tolist())
"""Trial standard deviations common to all values, relative to the scatter of the residuals."""


@dataclass(frozen=True, slots=True)
class Term:
    """A change of the model: its kind, and the first value that it concerns."""

    kind: str
    first: int


@dataclass(frozen=True, slots=True)
class Change:
    """A change that was found."""

    kind: str  # `STEP` or `SLOPE`
    # time, earliest, latest: Date and its 90 % interval [s]. A slope that begins with the series
    # begins at its start.
    time: float
    earliest: float
    latest: float
    # size, low, high: step in the unit of the values, or slope in that unit per second; 90 %
    # interval
    size: float
    low: float
    high: float
    from_start: bool = False  # whether it is a slope over the whole series

    def scaled(self, unit: float) -> Change:
        """The same change with its size in another unit."""
        return replace(self, size=unit * self.size, low=unit * self.low, high=unit * self.high)


@dataclass(frozen=True, slots=True)
class SeriesModel:
    """The model of a series."""

    changes: tuple[Change, ...]  # by date
    curve: Array  # shape (n,): values of the model at the times of the series
    # standard deviation by which recordings differ in addition to their intervals, where the effect
    # is largest
    spread: float
    last: float  # value of the model at the last time
    rate: float  # slope of the model at the last time, per second
    enough: bool = True  # whether there were enough values to look for changes


@dataclass(frozen=True, slots=True)
class _Fit:
    terms: tuple[Term, ...]
    weights: Array
    coefficients: Array
    residuals: Array
    spread: float
    deviance: float  # -2 log likelihood
    criterion: float


def deviations(low: Array, high: Array) -> Array:
    """Standard deviations of values from their 90 % intervals."""
    result: Array = np.maximum((high - low) / (2.0 * NORMAL_90), 0.0)
    return result


def medians(value: Array) -> Array:
    """The median of each value and its neighbours."""
    reach = RULES.neighbours // 2
    return np.array(
        [np.median(value[max(k - reach, 0) : k + reach + 1]) for k in range(value.size)]
    )


class _Series:
    def __init__(self, time: Array, value: Array, deviation: Array) -> None:
        self.time, self.value = time, value
        self.n = time.size
        scale = float(np.ptp(value)) or 1.0
        self.variance = np.maximum(deviation, 1e-9 * scale) ** 2
        self.length = max(float(time[-1] - time[0]), 1e-9)
        size = np.abs(medians(value))
        self.share = RULES.least_spread + (1.0 - RULES.least_spread) * size / max(
            float(size.max()), 1e-300
        )

    def columns(self, terms: Sequence[Term]) -> Array:
        rows = np.arange(self.n)
        made = [np.ones(self.n)]
        for term in terms:
            on = rows >= term.first
            if term.kind == STEP:
                made.append(on.astype(np.float64))
            else:
                start = self.time[max(term.first - 1, 0)]
                made.append(np.where(on, (self.time - start) / self.length, 0.0))
        return np.stack(made, axis=1)

    def scatter(self) -> float:
        """Robust scatter from value to value, which slow changes do not widen."""
        steps = np.abs(np.diff(self.value))
        return float(np.median(steps)) / 0.954 or float(np.ptp(self.value)) * 1e-6 or 1e-12

    def deviance(self, residuals: Array, spread: float) -> float:
        variance = self.variance + (self.share * spread) ** 2
        tails = (RULES.freedom + 1.0) * np.log1p(residuals**2 / (RULES.freedom * variance))
        return float(np.sum(np.log(variance) + tails))

    def solve(self, terms: tuple[Term, ...], spread: float, rounds: int = RULES.rounds) -> _Fit:
        """Iteratively reweighted least squares, which maximises the Student likelihood."""
        x, variance = self.columns(terms), self.variance + (self.share * spread) ** 2
        weights = 1.0 / variance
        coefficients, residuals = np.zeros(x.shape[1]), self.value
        for _ in range(rounds):
            normal = x.T @ (weights[:, None] * x)
            normal[np.diag_indices_from(normal)] *= 1.0 + 1e-12
            coefficients = np.linalg.solve(normal, x.T @ (weights * self.value))
            residuals = self.value - x @ coefficients
            weights = (RULES.freedom + 1.0) / (RULES.freedom * variance + residuals**2)
        deviance = self.deviance(residuals, spread)
        cost = sum(RULES.penalty if t.first > 0 else RULES.penalty_from_start for t in terms)
        # With few values, the estimated variance is too small by what the terms have used up.
        correction = self.n / max(self.n - 2.0 * len(terms) - 2.0, 1.0)
        criterion = deviance + cost * correction * math.log(self.n)
        return _Fit(terms, weights, coefficients, residuals, spread, deviance, criterion)

    def best_spread(self, terms: tuple[Term, ...]) -> _Fit:
        scatter = self.scatter()
        return min(
            (self.solve(terms, share * scatter) for share in _SPREADS),
            key=lambda fit: fit.criterion,
        )

    def possible(self, terms: Sequence[Term]) -> list[Term]:
        """Changes that leave enough values on both sides of each date."""
        taken = [t.first for t in terms if t.first > 0]
        dates = [
            k
            for k in range(RULES.segment, self.n - RULES.segment + 1)
            if all(abs(k - other) >= RULES.segment for other in taken)
        ]
        found = [Term(kind, k) for k in dates for kind in (STEP, SLOPE)]
        if Term(SLOPE, 0) not in terms:
            found.append(Term(SLOPE, 0))
        return found

    def adjusted(self, fit: _Fit) -> _Fit:
        """Move each change, and try the other kind, while the criterion falls."""
        for _ in range(3):
            before = fit.criterion
            for place in range(len(fit.terms)):
                others = fit.terms[:place] + fit.terms[place + 1 :]
                trials = [
                    self.solve((*others[:place], term, *others[place:]), fit.spread, 6)
                    for term in self.possible(others)
                ]
                best = min(trials, key=lambda t: t.criterion)
                if best.criterion < fit.criterion - 1e-9:
                    fit = self.solve(best.terms, fit.spread)
            if not fit.criterion < before - 1e-6:
                break
        return fit

    def search(self) -> _Fit:
        best = self.best_spread(())
        current = best
        for _ in range(RULES.most_changes):
            possible = self.possible(current.terms)
            if not possible:
                break
            # One leader of each sort: the spread of the present model is too large to choose now.
            leaders: dict[tuple[str, bool], _Fit] = {}
            for term in possible:
                trial = self.solve((*current.terms, term), current.spread, 6)
                sort = (term.kind, term.first == 0)
                if sort not in leaders or trial.criterion < leaders[sort].criterion:
                    leaders[sort] = trial
            refined = (self.adjusted(self.best_spread(t.terms)) for t in leaders.values())
            grown = [self.best_spread(t.terms) for t in refined]
            current = min(grown, key=lambda t: t.criterion)
            if current.criterion < best.criterion:
                best = current
        return self.without_needless(best)

    def without_needless(self, fit: _Fit) -> _Fit:
        """Remove changes that the later ones have made unnecessary."""
        while fit.terms:
            fewer = [
                self.best_spread(fit.terms[:k] + fit.terms[k + 1 :]) for k in range(len(fit.terms))
            ]
            best = min(fewer, key=lambda t: t.criterion)
            if best.criterion > fit.criterion:
                break
            fit = best
        return fit

    def other_dates(self, fit: _Fit, place: int) -> list[_Fit]:
        """Fits with another date of one change that are about as likely; `fit` is the first."""
        term = fit.terms[place]
        if term.first == 0:
            return [fit]
        others = fit.terms[:place] + fit.terms[place + 1 :]
        trials = [
            self.solve((*fit.terms[:place], near, *fit.terms[place + 1 :]), fit.spread)
            for near in self.possible(others)
            if near.kind == term.kind and near.first not in (0, term.first)
        ]
        return [fit, *(t for t in trials if t.deviance <= fit.deviance + PROFILE_90)]

    def dates(self, fits: Sequence[_Fit], place: int) -> tuple[float, float, float]:
        """Date of a change with its 90 % interval."""
        term = fits[0].terms[place]
        if term.first == 0:
            return (float(self.time[0]),) * 3
        kept = [f.terms[place].first for f in fits]
        if term.kind == STEP:  # it lies between two recordings
            middle = 0.5 * float(self.time[term.first - 1] + self.time[term.first])
            return middle, float(self.time[min(kept) - 1]), float(self.time[max(kept)])
        return (
            float(self.time[term.first - 1]),
            float(self.time[max(min(kept) - 2, 0)]),
            float(self.time[max(kept)]),
        )

    def sizes(self, fits: Sequence[_Fit], place: int) -> tuple[float, float, float]:
        """Size of a change with its 90 % interval, from the likelihood at all dates (profile)."""
        low, high = math.inf, -math.inf
        for fit in fits:
            x = self.columns(fit.terms)
            # Of Student errors, the information is (f + 1)/(f + 3) of that of normal ones.
            information = (
                (RULES.freedom + 1.0)
                / (RULES.freedom + 3.0)
                / (self.variance + (self.share * fit.spread) ** 2)
            )
            # The spread was estimated with the terms and dates, and is too small by as much.
            freedom = max(self.n - 2.0 * len(fit.terms) - 1.0, 1.0)
            used = self.n / freedom * (float(student_quantile.ppf(0.95, freedom)) / NORMAL_90) ** 2
            covariance = used * np.linalg.pinv(x.T @ (information[:, None] * x))
            left = PROFILE_90 - max(fit.deviance - fits[0].deviance, 0.0)
            reach = math.sqrt(max(left * float(covariance[place + 1, place + 1]), 0.0))
            size = float(fit.coefficients[place + 1])
            low, high = min(low, size - reach), max(high, size + reach)
        return float(fits[0].coefficients[place + 1]), low, high

    def change(self, fit: _Fit, place: int) -> Change:
        term, fits = fit.terms[place], self.other_dates(fit, place)
        size, low, high = self.sizes(fits, place)
        unit = self.length if term.kind == SLOPE else 1.0
        date, earliest, latest = self.dates(fits, place)
        return Change(
            term.kind, date, earliest, latest, size / unit, low / unit, high / unit,
            term.first == 0,
        )  # fmt: skip


def find_changes(time: Array, value: Array, deviation: Array) -> SeriesModel:
    """Find the steps and slopes of a series.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Times in ascending order [s].
    value : ndarray, shape (n,)
        Finite values.
    deviation : ndarray, shape (n,)
        Standard deviation of each value, from `deviations`.

    Returns
    -------
    SeriesModel
        The model; without changes if there are fewer than `fleet.fewest` values.
    """
    if value.size < RULES.fewest or not np.ptp(value) > 0.0 or not np.ptp(time) > 0.0:
        level = float(np.median(value)) if value.size else math.nan
        enough = value.size >= RULES.fewest
        return SeriesModel((), np.full(value.size, level), 0.0, level, 0.0, enough)
    # Values of any unit, so that sums of logarithms and squares have about the size of one.
    unit = float(np.max(np.abs(value)))
    series = _Series(time, value / unit, deviation / unit)
    fit = series.search()
    changes = sorted(
        (series.change(fit, k).scaled(unit) for k in range(len(fit.terms))), key=lambda c: c.time
    )
    curve = unit * (series.columns(fit.terms) @ fit.coefficients)
    rate = sum(c.size for c in changes if c.kind == SLOPE)
    return SeriesModel(tuple(changes), curve, unit * fit.spread, float(curve[-1]), rate)
