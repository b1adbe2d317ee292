"""Fits with known linear terms, whose amounts are fitted beside the parameters of the simulation.

The errors of a fit are those of the simulation plus a sum of known changes in bounded amounts. The
amounts are further parameters of the same Gauss-Newton steps (`pam_gap.prediction.fit`), whose
columns of the Jacobian are known, so that they cost no simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from pam_gap.prediction.fit import (
    Array,
    FitSteps,
    FreeParameter,
    PlantFit,
    Scaling,
    Slopes,
    bounded_step,
    fit_steps,
    mean_squares,
)
from pam_gap.prediction.running_equations import KnownColumns, RunningEquations
from pam_gap.rules import DEFAULT
from pam_gap.rules.prediction_rules import PredictionRules

MOST_KEPT = 2
"""Arrays of cached columns for which the terms keep their products."""


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
    _known: dict[int, tuple[Slopes | None, KnownColumns]] = field(
        init=False, default_factory=dict, repr=False
    )

    def known(self, cached: Slopes | None = None) -> KnownColumns:
        """The columns for scaled amounts, followed by `cached` ones.

        Fits that begin with the same `cached` array share them.
        """
        if id(cached) not in self._known:
            columns: Slopes = self.columns * Scaling(self.free).size
            if cached is not None:
                columns = np.concatenate([columns, cached], axis=-1)
            while len(self._known) >= MOST_KEPT:
                del self._known[next(iter(self._known))]
            self._known[id(cached)] = (cached, KnownColumns(columns))
        return self._known[id(cached)][1]


def best_amounts(
    errors: Array, terms: LinearTerms, rows: npt.NDArray[np.bool_], floor: Array, rounds: int = 3
) -> Array:
    """Amounts of linear terms that fit the errors best, in their own units.

    Each round weighs the channels by what the round before left in them.
    """
    scaling = Scaling(terms.free)
    equations = RunningEquations(len(terms.free), errors, rows, terms.known())
    at = np.clip(scaling.centre, scaling.low, scaling.high)
    for _ in range(rounds):
        now = errors + terms.columns @ scaling.own(at)
        mean = np.maximum(mean_squares(now, rows), floor)
        hessian, slope = equations.equations(now, 1.0 / mean)
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
    errors: Array | None = None,
    rules: PredictionRules = DEFAULT.prediction,
    amounts: Array | None = None,
) -> FitSteps:
    """Fit parameters and amounts of linear terms; the other arguments are those of `fit_steps`.

    Parameters
    ----------
    terms : LinearTerms
        The terms. The result holds their amounts, and its errors contain them.
    errors : ndarray, shape (blocks, channels), optional
        Errors of the simulation alone at the start, where they are known.
    amounts : ndarray, shape (k,), optional
        Amounts that are not fitted but kept.
    """
    inside = np.clip(start, [p.low for p in free], [p.high for p in free])
    if errors is None:
        errors = (yield inside[None])[0]
    if amounts is not None:
        kept = terms.columns @ amounts
        steps = fit_steps(
            free, start, rows=rows, floor=floor, cached=cached, guess=guess,
            max_iterations=max_iterations, tolerance=tolerance, errors=errors + kept, rules=rules,
        )  # fmt: skip
        lanes = next(steps)
        while True:
            try:
                lanes = steps.send((yield lanes) + kept)
            except StopIteration as end:
                found: PlantFit = end.value
                return replace(found, amounts=amounts, simulated=found.errors - kept)
    k = len(terms.free)
    amounts = best_amounts(errors, terms, rows, floor)
    steps = fit_steps(
        (*terms.free, *free),
        np.concatenate([amounts, inside]),
        rows=rows,
        floor=floor,
        cached=terms.known(cached),
        guess=guess,
        max_iterations=max_iterations,
        tolerance=tolerance,
        errors=errors + terms.columns @ amounts,
        rules=rules,
    )
    del cached, guess, errors  # many fits run side by side, and each would keep its copy
    lanes = next(steps)
    while True:
        errors = (yield lanes[:, k:]) + np.moveaxis(terms.columns @ lanes[:, :k].T, -1, 0)
        try:
            lanes = steps.send(errors)
        except StopIteration as end:
            found = end.value
            return PlantFit(
                found.values[k:],
                found.errors,
                found.objective,
                found.jacobian[..., k:].copy(),  # a view would keep the whole of it
                found.iterations,
                found.values[:k],
                found.errors - terms.columns @ found.values[:k],
            )
