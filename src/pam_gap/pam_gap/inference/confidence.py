"""Intervals that survive correlated errors: block bootstraps of parameters and of the gap closed.

Parameters: each score block's share of the normal equations is computed once; a bootstrap sample
of blocks then moves the estimate by one Newton step (the linearised, or one-step, bootstrap; Shao
and Tu, The Jackknife and Bootstrap, 1995, chapter 8). The gap closed: blocks of held-out errors of
both models are resampled together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pam_gap.inference.held_out import Folds, HeldOut
from pam_gap.inference.hypothesis import Hypothesis, HypothesisFitter
from pam_gap.inference.selection import BOOTSTRAPS, resampled_blocks
from pam_gap.prediction.fit import Array, Scaling, mean_squares

LOW, HIGH = 5.0, 95.0
"""Percentiles of a 90 % interval."""
NORMAL_90 = 1.645
"""Standard deviations to either side of a 90 % interval."""
MOTION_SPREAD = 0.55
"""Standard deviation of the logarithm of the share left, from one motion to another: measured on
eleven withheld rigs of another plant, recorded twice; on 78 others the interval held 75 times."""
FLOOR_SHARE = 0.1
"""How far the floor may be off, as a share of itself."""


@dataclass(frozen=True, slots=True)
class Interval:
    """A value with its 90 % interval."""

    value: float
    low: float
    high: float


def parameter_intervals(
    fitter: HypothesisFitter, folds: Folds, hypothesis: Hypothesis, seed: int = 0
) -> list[Interval]:
    """90 % intervals of all fitted parameters, nuisances first."""
    free, _, _ = fitter.problem_parts(hypothesis.members)
    result = hypothesis.result
    n = len(free)
    if n == 0:
        return []
    scaling = Scaling(free)
    at = scaling.scaled(result.values)
    weights = 1.0 / np.maximum(mean_squares(result.errors, fitter.problem.counted), fitter.floor)
    hessians = np.zeros((folds.n_blocks, n, n))
    slopes = np.zeros((folds.n_blocks, n))
    for block in range(folds.n_blocks):
        rows = folds.score_block == block
        for channel in np.nonzero(fitter.problem.present)[0]:
            e = result.errors[rows, channel]
            d = result.jacobian[rows, channel]
            known = np.isfinite(e) & np.isfinite(d).all(axis=1)
            hessians[block] += weights[channel] * d[known].T @ d[known]
            slopes[block] += weights[channel] * d[known].T @ e[known]
    generator = np.random.default_rng(seed)
    prior = np.diag(scaling.weight**2)
    mean_slope = slopes.mean(axis=0)
    steps = np.empty((BOOTSTRAPS, n))
    for k in range(BOOTSTRAPS):
        sample = resampled_blocks(folds.n_blocks, generator)
        hessian = hessians[sample].sum(axis=0) + prior
        hessian[np.diag_indices(n)] += 1e-9 * np.max(np.diag(hessian)) + 1e-12
        steps[k] = -np.linalg.solve(hessian, (slopes[sample] - mean_slope).sum(axis=0))
    low, high = np.percentile(steps, [LOW, HIGH], axis=0)
    lower = scaling.own(np.clip(at + low, scaling.low, scaling.high))
    upper = scaling.own(np.clip(at + high, scaling.low, scaling.high))
    return [
        Interval(float(v), float(min(v, a)), float(max(v, b)))
        for v, a, b in zip(result.values, lower, upper, strict=True)
    ]


def pooled_rms(sums: Array, counts: Array, present: np.ndarray) -> Array:
    """RMS error over all channels in units of each channel's noise, leading axes kept."""
    mean = sums / np.maximum(counts, 1.0)
    value: Array = np.sqrt(mean[..., present].mean(axis=-1))
    return value


def gap_closed(
    before: HeldOut, after: HeldOut, floor: Array, present: np.ndarray, seed: int = 0
) -> Interval:
    """(before - after)/(before - floor) of the pooled RMS error, with its 90 % interval."""
    floor_rms = float(np.sqrt(floor[present].mean()))

    def closed(at: np.ndarray) -> float:
        first = float(pooled_rms(before.sums[at].sum(0), before.counts[at].sum(0), present))
        last = float(pooled_rms(after.sums[at].sum(0), after.counts[at].sum(0), present))
        return (first - max(last, floor_rms)) / max(first - floor_rms, 1e-9)

    generator = np.random.default_rng(seed)
    n = before.sums.shape[0]
    draws = [closed(resampled_blocks(n, generator)) for _ in range(BOOTSTRAPS)]
    low, high = np.percentile(draws, [LOW, HIGH])
    value = closed(np.arange(n))
    return Interval(value, float(min(low, value)), float(max(high, value)))


def for_another_motion(
    closed: Interval, before: HeldOut, floor: Array, present: np.ndarray
) -> Interval:
    """Widen a gap closed to where it lies under another motion of the same kind.

    Blocks of one recording share its motion, so that resampling them says nothing of the next.
    What a law that is nearly right leaves differs from motion to motion by a factor; the floor is
    known to a share of itself.

    Parameters
    ----------
    closed : Interval
        From `gap_closed`.
    before : HeldOut
        Of the rig as written.
    floor : ndarray, shape (channels,)
        Mean square that noise alone leaves.
    present : ndarray of bool, shape (channels,)
        Channels that count.
    """
    floor_rms = float(np.sqrt(floor[present].mean()))
    first = float(pooled_rms(before.sums.sum(0), before.counts.sum(0), present))
    reach = FLOOR_SHARE * floor_rms / max(first - floor_rms, 1e-9)
    factor = float(np.exp(NORMAL_90 * MOTION_SPREAD))
    left, least, most = 1.0 - closed.value, 1.0 - closed.high, 1.0 - closed.low
    return Interval(
        closed.value,
        min(1.0 - most, 1.0 - (left * factor + reach)),
        min(max(1.0 - least, 1.0 - (left / factor - reach)), 1.0),
    )
