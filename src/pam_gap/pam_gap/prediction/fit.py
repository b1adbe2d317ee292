"""Least squares on prediction errors with bounds, priors and an unknown variance per channel.

The objective is half the sum over channels of n_c log(S_c/n_c) plus half the squares of the priors,
where S_c is the sum of squared errors in units of the channel's noise. This is the negative log
likelihood of Gaussian errors, concentrated over their unknown variance in each channel. A channel
that no model explains well therefore does not dominate the others. The steps are Gauss-Newton steps
with Levenberg damping; the errors are weighted by the variances of the last iterate. Steps with
several dampings are evaluated as lanes of one batch. Given columns of the Jacobian are reused for
parameters whose effect is nearly linear. A fit is a generator that asks for prediction errors, so
that the lanes of many fits are simulated as one batch.

Sources: Nocedal and Wright, Numerical Optimization, chapters 10 and 16;
Seber and Wild, Nonlinear Regression, 2.2 (concentrated likelihood).
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import lsq_linear

from pam_gap.rules import DEFAULT
from pam_gap.rules.prediction_rules import PredictionRules

Array = npt.NDArray[np.float64]
Slopes = npt.NDArray[np.floating[Any]]
"""A Jacobian; kept ones have single precision, because many are kept."""
Predictor = Callable[[Array], Array]
"""(lanes, parameters) -> whitened errors (lanes, blocks, channels); NaN without a measurement."""
FitSteps = Generator[Array, Array, "FitResult"]
"""Yields lanes of parameters in own units, is sent their errors, and returns the result."""


@dataclass(frozen=True, slots=True)
class FreeParameter:
    """One parameter that a fit may change.

    Attributes
    ----------
    name : str
        Name in reports.
    low, high : float
        Bounds in the parameter's own unit.
    size : float
        Typical change; it scales the difference step and the damping.
    prior : float
        Standard deviation of the Gaussian prior; 0 for no prior.
    centre : float
        Mean of the prior.
    is_logarithmic : bool
        Whether the fit works on the logarithm of the parameter; `low` must then be above 0.
    """

    name: str
    low: float
    high: float
    size: float
    prior: float = 0.0
    centre: float = 0.0
    is_logarithmic: bool = False


@dataclass(slots=True)
class FitResult:
    """The result of a fit.

    Attributes
    ----------
    values : ndarray, shape (n,)
        Parameters in their own units.
    errors : ndarray, shape (blocks, channels)
        Whitened prediction errors at these values.
    objective : float
        Half the sum of n_c log J_c plus the priors, over the rows that were fitted.
    jacobian : ndarray, shape (blocks, channels, n)
        Derivative of the errors with respect to the scaled parameters, in single precision.
    iterations : int
        Number of steps taken.
    amounts : ndarray, shape (k,)
        Amounts of the linear terms; `errors` contains them.
    """

    values: Array
    errors: Array
    objective: float
    jacobian: Slopes
    iterations: int
    amounts: Array = field(default_factory=lambda: np.zeros(0))


def mean_squares(errors: Array, rows: npt.NDArray[np.bool_] | None = None) -> Array:
    """J_c: mean squared whitened error of each channel, ignoring NaN; shape (..., channels)."""
    chosen = errors if rows is None else errors[..., rows, :]
    with np.errstate(invalid="ignore", over="ignore"):
        square = chosen * chosen
        known = np.isfinite(square)
        total = np.where(known, square, 0.0).sum(axis=-2)
        mean: Array = total / np.maximum(known.sum(axis=-2), 1)
    return mean


def log_likelihood_gap(errors: Array, counts: Array, rows: npt.NDArray[np.bool_] | None) -> Array:
    """Half of sum n_c log J_c for each lane; infinite where a prediction is not finite."""
    mean = mean_squares(errors, rows)
    value: Array = 0.5 * np.sum(counts * np.log(np.maximum(mean, 1e-12)), axis=-1)
    return value


class Scaling:
    """Conversion between the parameters' own units and the scaled space of the fit."""

    def __init__(self, free: Sequence[FreeParameter]) -> None:
        self.log = np.array([p.is_logarithmic for p in free], dtype=bool)
        self.size = np.array([p.size for p in free], dtype=np.float64)
        self.low = self.scaled(np.array([p.low for p in free], dtype=np.float64))
        self.high = self.scaled(np.array([p.high for p in free], dtype=np.float64))
        self.prior = np.array([p.prior for p in free], dtype=np.float64)
        centre = np.array([p.centre for p in free], dtype=np.float64)
        known = np.where(self.prior > 0.0, self.prior, 1.0)
        self.weight = np.where(self.prior > 0.0, self.size / known, 0.0)
        self.centre = self.scaled(np.where(self.log & (centre <= 0.0), 1.0, centre))

    def scaled(self, values: Array) -> Array:
        """Convert values in own units to scaled values."""
        with np.errstate(invalid="ignore", divide="ignore"):
            result: Array = np.where(
                self.log, np.log(np.maximum(values, 1e-300)) / self.size, values / self.size
            )
        return result

    def own(self, scaled: Array) -> Array:
        """Convert scaled values to own units."""
        with np.errstate(over="ignore"):
            result: Array = np.where(
                self.log, np.exp(np.clip(scaled * self.size, -700, 700)), scaled * self.size
            )
        return result

    def penalty(self, scaled: Array) -> Array:
        """Half the sum of the squared priors, for each lane."""
        value: Array = 0.5 * np.sum((self.weight * (scaled - self.centre)) ** 2, axis=-1)
        return value


def bounded_step(hessian: Array, slope: Array, low: Array, high: Array) -> Array:
    """Minimiser of x.H.x/2 + g.x in a box that contains 0 (H positive semidefinite).

    Source: bounded-variable least squares, Stark and Parker, Computational Statistics 10 (1995).
    """
    size = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    scaled = hessian / np.outer(size, size)
    scaled[np.diag_indices(size.size)] += 1e-9
    root = np.linalg.cholesky(scaled)
    target = -np.linalg.solve(root, slope / size)
    free = np.linalg.solve(root.T, target) / size
    if ((free >= low) & (free <= high)).all():
        return np.asarray(free, dtype=np.float64)
    bounds = (low * size - 1e-12, high * size + 1e-12)
    found = lsq_linear(root.T, target, bounds, method="bvls", tol=1e-10)
    step: Array = np.clip(found.x / size, low, high)
    return step


def shifted_lanes(
    scaling: Scaling, at: Array, columns: npt.NDArray[np.intp], step: float
) -> tuple[Array, Array]:
    """Points that differ from `at` by a step in one of the `columns`, and these steps."""
    lanes = np.repeat(at[None, :], columns.size, axis=0)
    steps = np.full(columns.size, step)
    for lane, column in enumerate(columns):
        if at[column] + step > scaling.high[column]:
            steps[lane] = -step
        lanes[lane, column] += steps[lane]
    return lanes, steps


def differences(shifted: Array, errors: Array, steps: Array) -> Array:
    """Columns of the Jacobian from the errors at `shifted_lanes` and at the point itself."""
    result: Array = np.moveaxis((shifted - errors) / steps[:, None, None], 0, -1)
    return result


def numerical_jacobian(
    predict: Predictor,
    scaling: Scaling,
    at: Array,
    errors: Array,
    columns: npt.NDArray[np.intp],
    step: float,
) -> Array:
    """Forward differences of the errors with respect to the scaled parameters in `columns`."""
    lanes, steps = shifted_lanes(scaling, at, columns, step)
    return differences(predict(scaling.own(lanes)), errors, steps)


def normal_equations(
    errors: Array, jacobian: Slopes, rows: npt.NDArray[np.bool_], weights: Array
) -> tuple[Array, Array]:
    """J'WJ and J'We over the chosen rows with one weight per channel; rows with NaN are skipped."""
    n = jacobian.shape[-1]
    hessian, slope = np.zeros((n, n)), np.zeros(n)
    for channel in range(errors.shape[1]):
        at = np.flatnonzero(rows & np.isfinite(errors[:, channel]))
        if not at.size:
            continue
        e, d = errors[at, channel], jacobian[:, channel].take(at, axis=0)
        d = d.astype(np.float64, copy=False)
        if not np.isfinite(d.sum()):
            known = np.isfinite(d).all(axis=1)
            e, d = e[known], d[known]
        hessian += weights[channel] * (d.T @ d)
        slope += weights[channel] * (d.T @ e)
    return hessian, slope


def trial_lanes(
    hessian: Array, slope: Array, dampings: Sequence[Array], scaling: Scaling, at: Array
) -> Array:
    """Trial points: `at` plus one step for each damping, and `at` plus a part of the first step."""
    low, high = scaling.low - at, scaling.high - at
    steps = [bounded_step(hessian + np.diag(d), slope, low, high) for d in dampings]
    lanes: Array = at + np.array([*steps, 0.3 * steps[0]])
    return lanes


def fit_steps(
    free: Sequence[FreeParameter],
    start: Array,
    *,
    rows: npt.NDArray[np.bool_],
    floor: Array,
    cached: Slopes | None = None,
    max_iterations: int = 8,
    tolerance: float | None = None,
    rules: PredictionRules = DEFAULT.prediction,
) -> FitSteps:
    """Fit the parameters from one starting point; the caller simulates the lanes it asks for.

    Parameters
    ----------
    free : sequence of FreeParameter
        The n parameters.
    start : ndarray, shape (n,)
        Starting values in own units.
    rows : ndarray of bool, shape (blocks,)
        Blocks that are fitted.
    floor : ndarray, shape (channels,)
        J_c that noise alone causes; it limits the weights of the channels.
    cached : ndarray, shape (blocks, channels, m), optional
        Jacobian of the first m parameters, which is reused instead of computed.
    max_iterations : int
        Largest number of steps.
    tolerance : float
        Decrease of the mean log J in one step below which the fit ends; default
        `rules.fit_tolerance`.
    rules : PredictionRules
        Difference step, dampings and weights.
    """
    scaling = Scaling(free)
    least_fall = rules.fit_tolerance if tolerance is None else tolerance
    n = len(free)
    at = np.clip(scaling.scaled(np.asarray(start, dtype=np.float64)), scaling.low, scaling.high)
    errors = (yield scaling.own(at[None, :]))[0]
    counts = np.isfinite(errors[rows]).sum(axis=0).astype(np.float64)
    total = max(float(counts.sum()), 1.0)

    def objective(lane_errors: Array, lanes: Array) -> Array:
        value = log_likelihood_gap(lane_errors, counts, rows) + scaling.penalty(lanes)
        return np.where(np.isfinite(value), value, np.inf)

    best = float(objective(errors[None], at[None])[0])
    damping = rules.fit_damping
    jacobian = np.zeros((*errors.shape, n))
    reused = 0 if cached is None else cached.shape[-1]
    if cached is not None:
        jacobian[..., :reused] = cached
    del cached  # many fits run side by side, and each would keep its copy
    fresh = np.arange(reused, n)
    taken = 0
    for _ in range(max_iterations):
        if fresh.size:
            lanes, steps = shifted_lanes(scaling, at, fresh, rules.fit_difference)
            jacobian[..., fresh] = differences((yield scaling.own(lanes)), errors, steps)
        mean = np.maximum(mean_squares(errors, rows), rules.fit_weight_floor * floor)
        hessian, slope = normal_equations(errors, jacobian, rows, 1.0 / mean)
        hessian[np.diag_indices(n)] += scaling.weight**2
        slope += scaling.weight**2 * (at - scaling.centre)
        scale = np.maximum(np.diag(hessian), 1e-9 * float(np.max(np.diag(hessian))) + 1e-12)
        for attempt in range(rules.fit_attempts):
            dampings = [scale * (damping * factor + 1e-10) for factor in (min(attempt, 1), 30.0)]
            lanes = trial_lanes(hessian, slope, dampings, scaling, at)
            lane_errors = yield scaling.own(lanes)
            values = objective(lane_errors, lanes)
            winner = int(np.argmin(values))
            fall = best - float(values[winner])
            if fall > 0.0:
                break
            damping *= 1000.0
        if not fall > 0.0:
            break
        damping = max(damping * (0.1, 30.0, 10.0)[winner], 1e-5)
        at, errors, best = lanes[winner], lane_errors[winner], float(values[winner])
        taken += 1
        if fall < least_fall * total:
            break
    return FitResult(scaling.own(at), errors, best, jacobian.astype(np.float32), taken)


def fit_together(
    fits: Sequence[tuple[Callable[[Array], Array], FitSteps]], predict: Predictor
) -> list[FitResult]:
    """Run several fits side by side: what all of them ask for next is simulated as one batch.

    Parameters
    ----------
    fits : sequence of pairs
        A function that completes the lanes of a fit to what `predict` takes, and the fit.
    predict : callable
        Maps completed lanes to whitened errors.

    Returns
    -------
    list of FitResult
        In the order of `fits`; each is the same as that of the fit alone.
    """
    results: dict[int, FitResult] = {}
    asked = {k: complete(next(steps)) for k, (complete, steps) in enumerate(fits)}
    while asked:
        errors = predict(np.concatenate(list(asked.values())))
        first = 0
        for k, lanes in list(asked.items()):
            complete, steps = fits[k]
            try:
                asked[k] = complete(steps.send(errors[first : first + len(lanes)]))
            except StopIteration as end:
                results[k] = end.value
                del asked[k]
            first += len(lanes)
    return [results[k] for k in range(len(fits))]


def fit(
    predict: Predictor,
    free: Sequence[FreeParameter],
    start: Array,
    *,
    rows: npt.NDArray[np.bool_],
    floor: Array,
    max_iterations: int = 8,
    tolerance: float | None = None,
) -> FitResult:
    """Run one fit alone, as `fit_steps`; `predict` maps lanes in own units to whitened errors."""
    steps = fit_steps(
        free, start, rows=rows, floor=floor, max_iterations=max_iterations, tolerance=tolerance
    )
    return fit_together([(lambda lanes: lanes, steps)], predict)[0]
