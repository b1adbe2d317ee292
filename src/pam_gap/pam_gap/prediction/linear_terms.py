"""Fits with known linear terms, whose amounts are fitted beside the parameters of the simulation.

The errors of a fit are those of the simulation plus a sum of known changes in bounded amounts. The
amounts are further parameters of the same Gauss-Newton steps (`pam_gap.prediction.fit`), whose
columns of the Jacobian are known, so that they cost no simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pam_gap.prediction.fit import (
    Array,
    FitResult,
    FitSteps,
    FreeParameter,
    Scaling,
    Slopes,
    bounded_step,
    fit_steps,
    mean_squares,
    normal_equations,
)
from pam_gap.rules import DEFAULT
from pam_gap.rules.prediction_rules import PredictionRules


@dataclass(frozen=True, slots=True)
class LinearTerms:
    """Known changes of the errors, each of which a fit adds in an amount within its bounds.

    Attributes
    ----------
    columns : ndarray, shape (blocks, channels, k)
        Change of the whitened errors per amount of 1.
    free : tuple of FreeParameter
        Bounds, priors and sizes of the amounts.
    """

    columns: Array
    free: tuple[FreeParameter, ...]


def best_amounts(
    errors: Array, terms: LinearTerms, rows: npt.NDArray[np.bool_], floor: Array, rounds: int = 3
) -> Array:
    """Amounts of linear terms that fit the errors best, in their own units.

    Each round weighs the channels by what the round before left in them.
    """
    scaling = Scaling(terms.free)
    columns = terms.columns * scaling.size
    at = np.clip(scaling.centre, scaling.low, scaling.high)
    for _ in range(rounds):
        now = errors + columns @ at
        mean = np.maximum(mean_squares(now, rows), floor)
        hessian, slope = normal_equations(now, columns, rows, 1.0 / mean)
        hessian[np.diag_indices(at.size)] += scaling.weight**2 + 1e-12
        slope += scaling.weight**2 * (at - scaling.centre)
        at = at + bounded_step(hessian, slope, scaling.low - at, scaling.high - at)
    return scaling.own(at)


def fit_steps_with_terms(
    free: Sequence[FreeParameter],
    start: Array,
    terms: LinearTerms,
    *,
    rows: npt.NDArray[np.bool_],
    floor: Array,
    cached: Slopes | None = None,
    guess: Slopes | None = None,
    max_iterations: int = 8,
    tolerance: float | None = None,
    rules: PredictionRules = DEFAULT.prediction,
    amounts: Array | None = None,
) -> FitSteps:
    """Fit parameters and amounts of linear terms; the other arguments are those of `fit_steps`.

    Parameters
    ----------
    terms : LinearTerms
        The terms. The result holds their amounts, and its errors contain them.
    amounts : ndarray, shape (k,), optional
        Amounts that are not fitted but kept.
    """
    if amounts is not None:
        kept = terms.columns @ amounts
        steps = fit_steps(
            free, start, rows=rows, floor=floor, cached=cached, guess=guess,
            max_iterations=max_iterations, tolerance=tolerance, rules=rules,
        )  # fmt: skip
        lanes = next(steps)
        while True:
            try:
                lanes = steps.send((yield lanes) + kept)
            except StopIteration as end:
                found: FitResult = end.value
                return replace(found, amounts=amounts)
    k = len(terms.free)
    known = terms.columns * Scaling(terms.free).size
    if cached is not None:
        known = np.concatenate([known, cached], axis=-1)
    inside = np.clip(start, [p.low for p in free], [p.high for p in free])
    amounts = best_amounts((yield inside[None])[0], terms, rows, floor)
    steps = fit_steps(
        (*terms.free, *free),
        np.concatenate([amounts, inside]),
        rows=rows,
        floor=floor,
        cached=known,
        guess=guess,
        max_iterations=max_iterations,
        tolerance=tolerance,
        rules=rules,
    )
    del known, cached, guess  # many fits run side by side, and each would keep its copy
    lanes = next(steps)
    while True:
        errors = (yield lanes[:, k:]) + np.moveaxis(terms.columns @ lanes[:, :k].T, -1, 0)
        try:
            lanes = steps.send(errors)
        except StopIteration as end:
            found = end.value
            return FitResult(
                found.values[k:],
                found.errors,
                found.objective,
                found.jacobian[..., k:].copy(),  # a view would keep the whole of it
                found.iterations,
                found.values[:k],
            )
