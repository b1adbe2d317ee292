"""The last steps of a fit, along combinations of numbers that change almost nothing.

If all lengths grow by one factor, and torques, volumes and conductances by its third power, no
pressure and no angle changes. The log says nothing of such a combination; what was known before the
log decides it alone. The steps of an ordinary fit are damped in proportion to the curvature of each
number, which is many times that of the combination, so that they end long before its best value.
And differences of a number over a wide step are not quite linear: their sum does not vanish along
the combination, as if the log knew something of it. The last steps are therefore not damped, with
central differences over short steps.

Source: Nocedal and Wright, Numerical Optimization, chapters 8 and 10.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pam_gap.calibration.calibration_rules import CalibrationRules
from pam_gap.inference.hypothesis import HypothesisFitter
from pam_gap.prediction.fit import (
    Array,
    FreeParameter,
    Scaling,
    log_likelihood_gap,
    mean_squares,
    normal_equations,
)
from pam_gap.prediction.fit_step import bounded_step
from pam_gap.prediction.linear_terms import LinearTerms

SHARES = np.array([1.0, 0.5, 0.2, 0.05])
"""Lengths of a step that are tried, in whole steps."""


@dataclass(frozen=True, slots=True)
class FittedPoint:
    """A point of a fit: numbers, and amounts of the small errors beside them."""

    values: Array  # shape (n,): the numbers, in their own units
    amounts: Array  # shape (k,): the amounts
    errors: Array  # shape (rows, channels): whitened errors there


def linear_terms(fitter: HypothesisFitter) -> LinearTerms:
    """The small errors beside the numbers of a fit, of which there may be none."""
    if fitter.background is None:
        rows = fitter.problem.n_rows
        return LinearTerms(np.zeros((rows, len(fitter.problem.present), 0)), ())
    return fitter.background.terms


def all_free(fitter: HypothesisFitter) -> list[FreeParameter]:
    """The numbers of a fit, followed by the amounts of the small errors."""
    return [*(one.free for one in fitter.nuisances), *linear_terms(fitter).free]


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


def last_steps(
    fitter: HypothesisFitter, start: FittedPoint, kept: Sequence[int], rules: CalibrationRules
) -> tuple[FittedPoint, Array]:
    """Go on from a fitted point until a step promises next to nothing.

    Parameters
    ----------
    fitter : HypothesisFitter
        A fit without effects.
    start : FittedPoint
        Where it has ended; its errors are not used.
    kept : sequence of int
        Places of numbers that stay as they are.
    rules : CalibrationRules
        Number and differences of the steps.

    Returns
    -------
    point : FittedPoint
        The best point.
    jacobian : ndarray, shape (rows, channels, n + k)
        Derivative of its errors by the scaled numbers and amounts.
    """
    problem = fitter.problem.with_step(rules.fine_step)
    terms, counted = linear_terms(fitter), problem.counted
    scaling, n = Scaling(all_free(fitter)), len(fitter.nuisances)
    low, high = scaling.low.copy(), scaling.high.copy()
    at = np.clip(scaling.scaled(np.concatenate([start.values, start.amounts])), low, high)
    kept = list(kept)
    at[kept] = scaling.scaled(np.concatenate([start.values, start.amounts]))[kept]
    low[kept] = high[kept] = at[kept]

    def errors_of(lanes: Array) -> Array:
        own = scaling.own(lanes)
        simulated = problem.errors(np.array([fitter.vector((), lane[:n]) for lane in own]))
        added: Array = simulated + np.moveaxis(terms.columns @ own[:, n:].T, -1, 0)
        return added

    errors = errors_of(at[None])[0]
    counts = np.isfinite(errors[counted]).sum(axis=0).astype(np.float64)
    best = float(log_likelihood_gap(errors, counts, counted) + scaling.penalty(at))
    for step in range(rules.undamped_steps + 1):
        jacobian = np.concatenate(
            [jacobian_at(fitter, scaling.own(at)[:n], rules), terms.slopes()], axis=-1
        )
        weights = 1.0 / np.maximum(mean_squares(errors, counted), fitter.floor)
        hessian, slope = normal_equations(errors, jacobian, counted, weights)
        hessian[np.diag_indices(at.size)] += scaling.weight**2 + 1e-12
        slope += scaling.weight**2 * (at - scaling.centre)
        change = bounded_step(hessian, slope, low - at, high - at)
        promised = -float(slope @ change + 0.5 * change @ hessian @ change)
        if step == rules.undamped_steps or promised < rules.correlation * rules.settled:
            break
        lanes = at + SHARES[:, None] * change
        tried = errors_of(lanes)
        values = log_likelihood_gap(tried, counts, counted) + scaling.penalty(lanes)
        winner = int(np.argmin(np.where(np.isfinite(values), values, np.inf)))
        if not values[winner] < best:
            break
        at, errors, best = lanes[winner], tried[winner].copy(), float(values[winner])
    own = scaling.own(at)
    return FittedPoint(own[:n], own[n:], errors), jacobian
