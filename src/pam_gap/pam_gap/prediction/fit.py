"""Least squares on prediction errors with bounds, priors and an unknown variance per channel.

The objective is half the sum over channels of n_c log(S_c/n_c) plus half the squares of the priors,
where S_c is the sum of squared errors in units of the channel's noise. This is the negative log
likelihood of Gaussian errors, concentrated over their unknown variance in each channel. A channel
that no model explains well therefore does not dominate the others. The steps are Gauss-Newton steps
with Levenberg damping; the errors are weighted by the variances of the last iterate. Steps with
other dampings are tried where the first one brings less than its Jacobian promised. Columns of the
Jacobian are reused for parameters whose effect is nearly linear. A fit is a generator that asks for
prediction errors, so that the lanes of many fits are simulated as one batch.

Sources: Nocedal and Wright, Numerical Optimization, chapters 10 and 16;
Seber and Wild, Nonlinear Regression, 2.2 (concentrated likelihood).
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from pam_gap.prediction.fit_step import best_step
from pam_gap.prediction.running_equations import KnownColumns, RunningEquations
from pam_gap.rules import DEFAULT
from pam_gap.rules.prediction_rules import PredictionRules

Array = npt.NDArray[np.float64]
Slopes = npt.NDArray[np.floating[Any]]
"""A Jacobian; kept ones have single precision, because many are kept."""
Predictor = Callable[[Array], Array]
"""(lanes, parameters) -> whitened errors (lanes, blocks, channels); NaN without a measurement."""
FitSteps = Generator[Array, Array, "PlantFit"]
"""Yields lanes of parameters in own units, is sent their errors, and returns the result."""


@dataclass(frozen=True, slots=True)
class FreeParameter:
    """One parameter that a fit may change."""

    name: str  # name in reports
    # low, high: bounds in the parameter's own unit
    low: float
    high: float
    size: float  # typical change; it scales the difference step and the damping
    prior: float = 0.0  # standard deviation of the Gaussian prior; 0 for no prior
    centre: float = 0.0  # mean of the prior
    # whether the fit works on the logarithm of the parameter; `low` must then be above 0
    is_logarithmic: bool = False


@dataclass(slots=True)
class PlantFit:
    """The result of a fit."""

    values: Array  # shape (n,): parameters in their own units
    errors: Array  # shape (blocks, channels): whitened prediction errors at these values
    objective: float  # half the sum of n_c log J_c plus the priors, over the rows that were fitted
    # shape (blocks, channels, k): the last columns of the Jacobian, those after `reused`, in single
    # precision
    columns: Slopes
    iterations: int  # number of steps taken
    # shape (k,): amounts of the linear terms; `errors` contains them
    amounts: Array = field(default_factory=lambda: np.zeros(0))
    # shape (blocks, channels): errors of the simulation alone with these values; None where it was
    # not simulated with them
    simulated: Array | None = None
    # shape (blocks, channels, n - k): the first columns of the Jacobian, where the fit did not
    # compute them; many results share them
    reused: Slopes | None = None

    @property
    def jacobian(self) -> Slopes:
        """Derivative of the errors by the scaled parameters, shape (blocks, channels, n)."""
        if self.reused is None:
            return self.columns
        if not self.columns.size:
            return self.reused
        return np.concatenate([self.reused, self.columns], axis=-1)


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


def fit_steps(
    free: Sequence[FreeParameter],
    start: Array,
    *,
    rows: npt.NDArray[np.bool_],
    floor: Array,
    cached: Slopes | KnownColumns | None = None,
    guess: Slopes | None = None,
    max_iterations: int = 8,
    tolerance: float | None = None,
    errors: Array | None = None,
    rules: PredictionRules = DEFAULT.prediction,
) -> FitSteps:
    """Fit the parameters from one starting point; the caller simulates the lanes it asks for.

    A parameter with a prior moves little, so that its column of the Jacobian is kept from step to
    step. It is computed anew after a step that brought less than the columns promised, and before
    a fit ends that has a tighter tolerance than usual. The columns of the other parameters are
    computed anew in every step.

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
    cached : ndarray, shape (blocks, channels, m), or KnownColumns, optional
        Jacobian of the first m parameters, which is reused instead of computed.
    guess : ndarray, shape (blocks, channels, k), optional
        Jacobian of the next k parameters at a point near the start, with which the fit begins.
    max_iterations : int
        Largest number of steps.
    tolerance : float
        Decrease of the mean log J in one step below which the fit ends; default
        `rules.fit_tolerance`.
    errors : ndarray, shape (blocks, channels), optional
        Errors at the start, where they are known.
    rules : PredictionRules
        Difference step, dampings and weights.
    """
    scaling = Scaling(free)
    least_fall = rules.fit_tolerance if tolerance is None else tolerance
    is_tight = least_fall < rules.fit_tolerance
    n = len(free)
    at = np.clip(scaling.scaled(np.asarray(start, dtype=np.float64)), scaling.low, scaling.high)
    if errors is None:
        errors = (yield scaling.own(at[None]))[0].copy()  # a view keeps all lanes of the batch
    counts = np.isfinite(errors[rows]).sum(axis=0).astype(np.float64)
    total = max(float(counts.sum()), 1.0)

    def objective(lane_errors: Array, lanes: Array) -> Array:
        value = log_likelihood_gap(lane_errors, counts, rows) + scaling.penalty(lanes)
        return np.where(np.isfinite(value), value, np.inf)

    best = float(objective(errors[None], at[None])[0])
    damping = rules.fit_damping
    none = np.zeros((*errors.shape, 0))
    kept = None if isinstance(cached, KnownColumns) else cached
    known = (
        cached if isinstance(cached, KnownColumns) else KnownColumns(none if kept is None else kept)
    )
    running = RunningEquations(n, errors, rows, known)
    reused, guessed = known.count, 0 if guess is None else guess.shape[-1]
    places = np.arange(n)
    fresh, quick = places[reused:], places[reused:][scaling.weight[reused:] == 0.0]
    if guess is not None:
        running.put(places[reused : reused + guessed], guess)
    due = np.union1d(quick, places[reused + guessed :])
    del cached, guess  # many fits run side by side, and each would keep its copy
    taken = 0
    while taken < max_iterations:
        if due.size:
            lanes, steps = shifted_lanes(scaling, at, due, rules.fit_difference)
            running.put(due, differences((yield scaling.own(lanes)), errors, steps))
        is_new = due.size == fresh.size
        mean = np.maximum(mean_squares(errors, rows), rules.fit_weight_floor * floor)
        hessian, slope = running.equations(errors, 1.0 / mean)
        hessian[np.diag_indices(n)] += scaling.weight**2
        slope += scaling.weight**2 * (at - scaling.centre)
        step = yield from best_step(
            hessian, slope, scaling.own, (scaling.low, scaling.high), at, best, damping,
            rules.fit_attempts if is_new else 1, objective, rules.fit_promise,
        )  # fmt: skip
        if step is None and is_new:
            break
        due = fresh
        if step is None:
            continue
        is_small = best - step.value < least_fall * total
        at, errors, best, damping = step.at, step.errors, step.value, step.damping
        taken += 1
        if is_small and (is_new or (step.is_as_promised and not is_tight)):
            break
        if step.is_as_promised and not is_small:
            due = quick
    return PlantFit(
        scaling.own(at), errors, best, running.own_columns, taken, simulated=errors, reused=kept
    )


def fit_together(
    fits: Sequence[tuple[Callable[[Array], Array], FitSteps]], predict: Predictor
) -> list[PlantFit]:
    """Run several fits side by side: what all of them ask for next is simulated as one batch.

    Parameters
    ----------
    fits : sequence of pairs
        A function that completes the lanes of a fit to what `predict` takes, and the fit.
    predict : callable
        Maps completed lanes to whitened errors.

    Returns
    -------
    list of PlantFit
        In the order of `fits`; each is the same as that of the fit alone.
    """
    results: dict[int, PlantFit] = {}
    asked: dict[int, Array] = {}

    def go_on(k: int, errors: Array | None) -> None:
        complete, steps = fits[k]
        try:
            asked[k] = complete(next(steps) if errors is None else steps.send(errors))
        except StopIteration as end:
            results[k] = end.value
            asked.pop(k, None)

    for k in range(len(fits)):
        go_on(k, None)
    while asked:
        errors = predict(np.concatenate(list(asked.values())))
        first = 0
        for k, lanes in list(asked.items()):
            go_on(k, errors[first : first + len(lanes)])
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
) -> PlantFit:
    """Run one fit alone, as `fit_steps`; `predict` maps lanes in own units to whitened errors."""
    steps = fit_steps(
        free, start, rows=rows, floor=floor, max_iterations=max_iterations, tolerance=tolerance
    )
    return fit_together([(lambda lanes: lanes, steps)], predict)[0]
