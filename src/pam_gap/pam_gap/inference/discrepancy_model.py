"""What a flexible law of the recorded signals leaves of an error, on held-out data.

The law contains no physics: a ridge regression on pressures, angle, speed, direction of motion,
commands, their products, harmonics of the angle, rates and past values. It is fitted on one fold
and scored on the other. A law of the table that is right leaves less than such a regression, which
knows nothing of the joint. If the regression leaves less, the error follows a law of the motion
that the table does not contain (a discrepancy: Kennedy and O'Hagan, J. R. Statist. Soc. B 63, 2001;
its ridge is chosen by cross-validation: Hastie, Tibshirani and Friedman, The Elements of
Statistical Learning, 2nd ed., section 7.10).
"""

from __future__ import annotations

import numpy as np

from pam_gap.inference.held_out import Folds
from pam_gap.prediction.channel_order import BOTH_PRESSURES, POSITION
from pam_gap.prediction.channels import Channels
from pam_gap.prediction.fit import Array
from pam_gap.prediction.problem import PredictionProblem

HARMONICS = (2.0, 4.0, 8.0, 12.0, 16.0)
"""Harmonics of the angle [1/rad]: eccentric parts, oval pulleys, ripple of the torque."""
MEMORY = (0.1, 0.5, 2.0, 8.0)
"""Time constants [s] over which past pressures, angles and directions may still act."""
SMOOTHING = 0.04
"""Time [s] over which the angle is averaged before its slope is taken."""
RIDGES = tuple(np.geomspace(3e-4, 10.0, 10))
"""Ridge parameters, per row, from which cross-validation within the fitted fold chooses."""
PARTS = 4
"""Contiguous parts of that cross-validation."""


def _known(values: Array) -> Array:
    """Values with those that were not measured replaced by the mean of their column, or by 0."""
    known = np.isfinite(values)
    sums = np.where(known, values, 0.0).sum(axis=0)
    return np.where(known, values, sums / np.maximum(known.sum(axis=0), 1))


def _standardised(columns: Array) -> Array:
    spread = columns.std(axis=0)
    found: Array = (columns - columns.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)
    return found


def _past(values: Array, step: float) -> list[Array]:
    """Values (rows, n) as first-order lags with the time constants `MEMORY` show them.

    A loop, because the filters of scipy take longer to import than this takes.
    """
    keep = np.exp(-step / np.array(MEMORY))[:, None]
    seen = np.empty((len(values), len(MEMORY), values.shape[1]))
    state = np.tile(values[0], (len(MEMORY), 1))
    for row, value in enumerate(values):
        state = keep * state + (1.0 - keep) * value
        seen[row] = state
    return [seen[:, k] for k in range(len(MEMORY))]


def _signals(data: Channels) -> tuple[Array, Array, Array]:
    """Signals of one recording (rows, n), their rates and past (rows, m), and the angle (rows,)."""
    step = data.row_time
    measured = _known(data.rows(data.measured))
    commands = _known(data.rows(data.commands))
    pressures, angle = measured[:, BOTH_PRESSURES], measured[:, POSITION]
    window = np.ones(max(1, round(SMOOTHING / step)))
    window /= window.size
    speed = np.gradient(np.convolve(angle, window, mode="same"), step)
    acceleration = np.gradient(np.convolve(speed, window, mode="same"), step)
    direction = np.tanh(speed / (0.05 * np.std(speed) + 1e-9))
    remembered = np.column_stack([pressures, angle, direction])
    rates = [acceleration[:, None], np.gradient(pressures, step, axis=0)]
    rates += [remembered - past for past in _past(remembered, step)]
    signals = np.column_stack([pressures, angle, speed, direction, commands])
    return signals, np.concatenate(rates, axis=1), angle


def _regressors(problem: PredictionProblem) -> Array:
    """Columns of the regression, shape (n_rows, columns)."""
    parts = zip(*(_signals(data) for data in problem.data), strict=True)
    signals, rates, angle = (np.concatenate(part) for part in parts)
    base, n = _standardised(signals), signals.shape[1]
    products = [base[:, i] * base[:, j] for i in range(n) for j in range(i, n)]
    powers = base**3 - 3.0 * base
    harmonics = [f(k * angle) for k in HARMONICS for f in (np.sin, np.cos)]
    more = _standardised(np.column_stack([rates, *products, powers, *harmonics]))
    return np.concatenate([base, more], axis=1)


def _predicted(columns: Array, errors: Array, at: Array, ridges: Array) -> Array:
    """Predictions of ridge regressions at other rows, shape (ridges, rows)."""
    mean, centre = errors.mean(), columns.mean(axis=0)
    inside = columns - centre
    values, vectors = np.linalg.eigh(inside.T @ inside)
    shares = vectors.T @ (inside.T @ (errors - mean))
    weights = shares / (np.maximum(values, 0.0) + ridges[:, None] * len(errors))
    found: Array = mean + weights @ ((at - centre) @ vectors).T
    return found


def _left(columns: Array, errors: Array, at: Array, withheld: Array) -> Array:
    """Errors that the regression on one fold leaves on another one, shape (withheld rows,)."""
    ridges = np.array(RIDGES)
    missed = np.zeros(ridges.size)
    for part in np.array_split(np.arange(len(errors)), PARTS):
        rest = np.ones(len(errors), dtype=bool)
        rest[part] = False
        guess = _predicted(columns[rest], errors[rest], columns[part], ridges)
        missed += ((errors[part] - guess) ** 2).sum(axis=1)
    best = int(np.argmin(missed))
    if missed[best] >= float(errors @ errors):
        return withheld  # the law explains nothing
    left: Array = withheld - _predicted(columns, errors, at, ridges[best : best + 1])[0]
    return left


def share_of_a_flexible_law(problem: PredictionProblem, folds: Folds, errors: Array) -> Array:
    """Share of the held-out squared error of a hypothesis that a flexible law explains [-].

    Parameters
    ----------
    problem : PredictionProblem
        Rig and recordings.
    folds : Folds
        Folds for the held-out score.
    errors : ndarray, shape (n_rows, channels)
        Whitened prediction errors of the hypothesis.

    Returns
    -------
    ndarray, shape (channels,)
        At least 0; 0 in channels without errors.
    """
    columns = _regressors(problem)
    share = np.zeros(errors.shape[1])
    for channel in np.nonzero(problem.present)[0]:
        known = np.isfinite(errors[:, channel])
        left = total = 0.0
        for own, other in folds.turns:
            fitted, withheld = own & known, other & known
            before = after = errors[withheld, channel]
            if withheld.any() and np.count_nonzero(fitted) >= 2 * PARTS:
                after = _left(columns[fitted], errors[fitted, channel], columns[withheld], before)
            left += float(after @ after)
            total += float(before @ before)
        share[channel] = max(1.0 - left / total, 0.0) if total > 0.0 else 0.0
    return share
