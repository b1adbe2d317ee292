"""Fits with known linear terms, whose amounts are fitted beside the parameters of the simulation.

The errors of a fit are those of the simulation plus a sum of known changes in bounded amounts. The
amounts are further parameters of the same Gauss-Newton steps (`pam_gap.prediction.fit`), whose
columns of the Jacobian are known, so that they cost no simulation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from weakref import WeakValueDictionary

import numpy as np
import numpy.typing as npt

from pam_gap.prediction.fit import (
    Array,
    FitSteps,
    FreeParameter,
    PlantFit,
    Scaling,
    Slopes,
    fit_steps,
    mean_squares,
)
from pam_gap.prediction.fit_step import bounded_step
from pam_gap.prediction.running_equations import KnownColumns, RunningEquations
from pam_gap.rules import DEFAULT
from pam_gap.rules.prediction_rules import PredictionRules


@dataclass(frozen=True, slots=True)
class LinearTerms:
    """Known changes of the errors, each of which a fit adds in an amount within its bounds."""

    columns: Array  # shape (blocks, channels, k): change of the whitened errors per amount of 1
    free: tuple[FreeParameter, ...]  # bounds, priors and sizes of the amounts
    _alone: list[KnownColumns] = field(default_factory=list, repr=False)
    _beside: WeakValueDictionary[int, KnownColumns] = field(
        default_factory=WeakValueDictionary, repr=False
    )

    def without(self, absent: Sequence[bool]) -> LinearTerms:
        """The same terms with the amounts of some of them fixed at 0; the columns are shared."""
        free = tuple(
            replace(one, low=0.0, high=0.0) if is_absent else one
            for one, is_absent in zip(self.free, absent, strict=True)
        )
        return replace(self, free=free)

    def slopes(self) -> Array:
        """Derivative of the errors by the scaled amounts; 0 for an amount that is fixed."""
        moves = [one.high > one.low for one in self.free]
        return np.where(moves, self.columns * Scaling(self.free).size, 0.0)

    def known(self, cached: Slopes | None = None) -> KnownColumns:
        """The columns for scaled amounts, followed by `cached` ones.

        Fits that run side by side with the same `cached` array share them.
        """
        if cached is None:
            if not self._alone:
                self._alone.append(KnownColumns(self.columns * Scaling(self.free).size))
            return self._alone[0]
        known = self._beside.get(id(cached))
        if known is None:
            columns = self.columns * Scaling(self.free).size
            known = KnownColumns(np.concatenate([columns, cached], axis=-1), cached)
            self._beside[id(cached)] = known
        return known


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
        found = yield from _answered(steps, 0, lambda _: kept)
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
    del guess, errors  # many fits run side by side, and each would keep its copy
    found = yield from _answered(
        steps, k, lambda given: np.moveaxis(terms.columns @ given.T, -1, 0)
    )
    simulated = found.errors - terms.columns @ found.values[:k]
    return replace(
        found, values=found.values[k:], amounts=found.values[:k], simulated=simulated, reused=cached
    )


def _answered(steps: FitSteps, k: int, added: Callable[[Array], Array]) -> FitSteps:
    """A fit of which the first `k` parameters are not simulated, but add to the errors."""
    try:
        lanes = next(steps)
        while True:
            lanes = steps.send((yield lanes[:, k:]) + added(lanes[:, :k]))
    except StopIteration as end:
        found: PlantFit = end.value
        return found
