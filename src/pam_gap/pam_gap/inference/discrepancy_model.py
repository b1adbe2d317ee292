"""A flexible model of the remaining errors of the best hypothesis, scored on held-out data.

The regressors are position, speed, direction of motion, pressures, commands, their products, and
harmonics of the position. A ridge regression is fitted on one fold and scored on the other. If it
explains the errors, they follow a smooth law of the inputs that no candidate contains; noise and
stick-slip do not follow such a law. The result is reported and does not affect the verdict, because
a flexible discrepancy model is confounded with every parameter (Kennedy and O'Hagan, J. R. Statist.
Soc. B 63, 2001).
"""

from __future__ import annotations

import numpy as np

from pam_gap.inference.held_out import Folds
from pam_gap.prediction.channel_order import BOTH_PRESSURES, POSITION
from pam_gap.prediction.channels import block_means
from pam_gap.prediction.fit import Array
from pam_gap.prediction.problem import PredictionProblem

HARMONICS = (2.0, 4.0, 8.0, 12.0, 16.0)


def _inputs(problem: PredictionProblem) -> tuple[Array, Array]:
    """Block means of the standardised inputs (rows, n) and of the position (rows,)."""
    columns, positions = [], []
    for data in problem.data:
        mean = block_means(data.measured, problem.block)
        command = block_means(data.commands, problem.block)
        step = problem.block * data.recording.sample_time
        wide = max(1, round(0.04 / step))
        smooth = np.convolve(mean[:, POSITION], np.ones(wide) / wide, mode="same")
        rate = np.gradient(smooth, step)
        direction = np.tanh(rate / (0.05 * np.std(rate) + 1e-9))
        columns.append(
            np.column_stack([mean[:, BOTH_PRESSURES], mean[:, POSITION], rate, direction, command])
        )
        positions.append(mean[:, POSITION])
    inputs = np.concatenate(columns)
    spread = inputs.std(axis=0)
    return (inputs - inputs.mean(axis=0)) / np.where(spread > 0, spread, 1.0), np.concatenate(
        positions
    )


def _ridge_score(design: Array, errors: Array, folds: Folds, ridge: float) -> float:
    """Share of the held-out squared error that a ridge regression explains."""
    left = total = 0.0
    for own, other in folds.turns:
        fit_rows = own & np.isfinite(errors)
        test_rows = other & np.isfinite(errors)
        if not fit_rows.any() or not test_rows.any():
            return 0.0
        a, b = design[fit_rows], errors[fit_rows]
        gram = a.T @ a
        gram[np.diag_indices(len(gram))] += ridge * len(a)
        weights = np.linalg.solve(gram, a.T @ b)
        residual = errors[test_rows] - design[test_rows] @ weights
        left += float(residual @ residual)
        total += float(errors[test_rows] @ errors[test_rows])
    return 1.0 - left / max(total, 1e-300)


def explained_leftover(problem: PredictionProblem, folds: Folds, errors: Array) -> Array:
    """Regress the remaining errors of a hypothesis on the motion and the inputs of the rig.

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
        Share of the held-out squared error of each channel that a flexible law explains [-].
    """
    inputs, position = _inputs(problem)
    ones = np.ones((len(inputs), 1))
    harmonics = np.column_stack([f(k * position) for k in HARMONICS for f in (np.sin, np.cos)])
    n = inputs.shape[1]
    products = np.column_stack([inputs[:, i] * inputs[:, j] for i in range(n) for j in range(i, n)])
    everything = np.column_stack([ones, inputs, products, harmonics])
    ridge = problem.rules.decision.leftover_ridge
    explained = np.zeros(errors.shape[1])
    for c in np.nonzero(problem.present)[0]:
        explained[c] = _ridge_score(everything, errors[:, c], folds, ridge)
    return np.maximum(explained, 0.0)
