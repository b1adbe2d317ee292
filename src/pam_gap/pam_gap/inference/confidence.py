"""Block-bootstrap intervals of parameters and of the closed gap, valid for correlated errors.

For parameters, the share of each score block in the normal equations is computed once. A bootstrap
sample of blocks then moves the estimate by one Newton step (the linearised, or one-step, bootstrap;
Shao and Tu, The Jackknife and Bootstrap, 1995, chapter 8). For the gap closed, blocks of the
held-out errors of both models are resampled together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pam_gap.inference.held_out import Folds
from pam_gap.inference.hypothesis import Hypothesis, HypothesisFitter
from pam_gap.inference.score import Score
from pam_gap.prediction.fit import Array, Scaling, mean_squares
from pam_gap.rules.decision_rules import DecisionRules

LOW, HIGH = 5.0, 95.0
"""Percentiles of a 90 % interval."""
NORMAL_90 = 1.645
"""Standard deviations to either side of a 90 % interval."""


@dataclass(frozen=True, slots=True)
class Interval:
    """A value with its 90 % interval."""

    value: float
    low: float
    high: float

    def spanning(self, other: Interval) -> Interval:
        """The same value with an interval that contains both."""
        return Interval(self.value, min(self.low, other.low), max(self.high, other.high))

    def reaching(self, least: float) -> Interval:
        """The same value with an interval that reaches at least this far to either side of it."""
        return self.spanning(Interval(self.value, self.value - least, self.value + least))


def circular_blocks(count: int, length: int, generator: np.random.Generator) -> np.ndarray:
    """Indices of one circular block bootstrap sample.

    Parameters
    ----------
    count : int
        Number of observations in time order, and of indices returned.
    length : int
        Number of consecutive observations that are drawn together; a block that reaches the end
        continues at the beginning.
    generator : numpy.random.Generator
        Draws the starts of the blocks.

    Returns
    -------
    ndarray of int, shape (count,)
    """
    starts = generator.integers(count, size=-(-count // length))
    sample: np.ndarray = ((starts[:, None] + np.arange(length)) % count).ravel()[:count]
    return sample


def resampled_blocks(
    n_blocks: int, generator: np.random.Generator, rules: DecisionRules
) -> np.ndarray:
    """Indices of one bootstrap sample of the score blocks."""
    length = max(1, min(rules.bootstrap_blocks, n_blocks // 4))
    return circular_blocks(n_blocks, length, generator)


def parameter_intervals(
    fitter: HypothesisFitter, folds: Folds, hypothesis: Hypothesis
) -> list[Interval]:
    """90 % intervals of all fitted parameters, nuisances first.

    They include what is not known of an ordinary background that was fitted with them: its
    amounts are further parameters, with the priors of the fit.
    """
    free, _, _ = fitter.problem_parts(hypothesis.members)
    result = hypothesis.result
    own = len(free)
    if own == 0:
        return []
    values, jacobian = result.values, result.jacobian
    if fitter.background is not None and result.amounts.size:
        terms = fitter.background.beside(hypothesis.effects)
        free = [*free, *terms.free]
        values = np.concatenate([values, result.amounts])
        jacobian = np.concatenate([jacobian, terms.slopes()], axis=-1)
    n = len(free)
    scaling = Scaling(free)
    at = scaling.scaled(values)
    weights = 1.0 / np.maximum(mean_squares(result.errors, fitter.problem.counted), fitter.floor)
    hessians = np.zeros((folds.n_blocks, n, n))
    slopes = np.zeros((folds.n_blocks, n))
    for block in range(folds.n_blocks):
        rows = folds.score_block == block
        for channel in np.nonzero(fitter.problem.present)[0]:
            e = result.errors[rows, channel]
            d = jacobian[rows, channel].astype(np.float64)
            known = np.isfinite(e) & np.isfinite(d).all(axis=1)
            hessians[block] += weights[channel] * d[known].T @ d[known]
            slopes[block] += weights[channel] * d[known].T @ e[known]
    generator = np.random.default_rng(0)
    prior = np.diag(scaling.weight**2)
    mean_slope = slopes.mean(axis=0)
    rules = fitter.rules.decision
    steps = np.empty((rules.bootstraps, n))
    for k in range(rules.bootstraps):
        sample = resampled_blocks(folds.n_blocks, generator, rules)
        hessian = hessians[sample].sum(axis=0) + prior
        hessian[np.diag_indices(n)] += 1e-9 * np.max(np.diag(hessian)) + 1e-12
        steps[k] = -np.linalg.solve(hessian, (slopes[sample] - mean_slope).sum(axis=0))
    low, high = np.percentile(steps, [LOW, HIGH], axis=0)
    # Blocks that agree exactly, and bounds, do not make a parameter certain: an interval is never
    # narrower than white noise alone allows, and at a bound it reaches into the permitted range.
    information = hessians.sum(axis=0) + prior
    information[np.diag_indices(n)] += 1e-9 * np.max(np.diag(information)) + 1e-12
    least = NORMAL_90 * np.sqrt(np.maximum(np.diag(np.linalg.inv(information)), 0.0))
    low, high = np.minimum(low, -least), np.maximum(high, least)
    lower = scaling.own(np.clip(at + low, scaling.low, scaling.high))
    upper = scaling.own(np.clip(at + high, scaling.low, scaling.high))
    return [
        Interval(float(v), float(min(v, a)), float(max(v, b)))
        for v, a, b in zip(result.values, lower[:own], upper[:own], strict=True)
    ]


def pooled_rms(sums: Array, counts: Array, present: np.ndarray) -> Array:
    """RMS error over all channels in units of each channel's noise, leading axes kept."""
    mean = sums / np.maximum(counts, 1.0)
    value: Array = np.sqrt(mean[..., present].mean(axis=-1))
    return value


def gap_closed(
    before: Score,
    after: Score,
    floor: Array,
    present: np.ndarray,
    rules: DecisionRules,
) -> Interval:
    """(before - after)/(before - floor) of the pooled RMS error, with its 90 % interval.

    It is that of the simulations alone, without what is taken for an ordinary background.
    """
    before, after = before.simulated, after.simulated
    floor_rms = float(np.sqrt(floor[present].mean()))

    def closed(at: np.ndarray) -> float:
        first = float(pooled_rms(before.sums[at].sum(0), before.counts[at].sum(0), present))
        last = float(pooled_rms(after.sums[at].sum(0), after.counts[at].sum(0), present))
        return (first - max(last, floor_rms)) / max(first - floor_rms, 1e-9)

    generator = np.random.default_rng(0)
    n = before.sums.shape[0]
    draws = [closed(resampled_blocks(n, generator, rules)) for _ in range(rules.bootstraps)]
    low, high = np.percentile(draws, [LOW, HIGH])
    value = closed(np.arange(n))
    return Interval(value, float(min(low, value)), float(max(high, value)))


def floor_reach(before: Score, floor: Array, present: np.ndarray, rules: DecisionRules) -> float:
    """Uncertainty of a share of the gap that follows from that of the noise floor."""
    floor_rms = float(np.sqrt(floor[present].mean()))
    before = before.simulated
    first = float(pooled_rms(before.sums.sum(0), before.counts.sum(0), present))
    return rules.floor_share * floor_rms / max(first - floor_rms, 1e-9)


def for_another_motion(
    closed: Interval,
    before: Score,
    floor: Array,
    present: np.ndarray,
    rules: DecisionRules,
    *,
    has_background: bool = False,
) -> Interval:
    """Widen the interval of a gap closed so that it holds for another motion of the same kind.

    The blocks of one recording share its motion, so that resampling them does not show the
    variation between motions. The share that an approximate law leaves differs by a factor from
    one motion to another, and the relative uncertainty of the noise floor must be included. With
    an ordinary background this factor is above 1 on most rigs, probably because small imperfections
    were fitted to the motion of the recording.

    Parameters
    ----------
    closed : Interval
        From `gap_closed`.
    before : Score
        Score of the plant as written in the rig file.
    floor : ndarray, shape (channels,)
        Mean squared error due to noise alone.
    present : ndarray of bool, shape (channels,)
        Channels that are judged.
    rules : DecisionRules
        Constants.
    has_background : bool
        Whether an ordinary background is assumed, of which the rig file holds only a part.
    """
    reach = floor_reach(before, floor, present, rules)
    growth, spread = 0.0, rules.motion_spread
    if has_background:
        growth, spread = rules.background_growth, rules.background_spread
    left, least, most = 1.0 - closed.value, 1.0 - closed.high, 1.0 - closed.low
    smallest, largest = left * np.exp([growth - NORMAL_90 * spread, growth + NORMAL_90 * spread])
    return Interval(
        closed.value,
        min(1.0 - most, 1.0 - float(largest + reach)),
        min(max(1.0 - least, 1.0 - float(smallest - reach)), 1.0),
    )
