"""Global search of a fit: many random points, of which the best are refined."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from pam_model.errors import DomainError
from pam_model.identify.fit_problem import FitProblem
from pam_model.identify.identifiability import Told, noise_of, told_numbers
from pam_model.identify.measurements import Array

_SCREENED = 256
_POLISHED = 6
_JUDGED = 25
_ROUGH_STEP = 1e-7


def screened_points(problem: FitProblem, number: int, seed: int) -> list[Array]:
    """The given start, and the best of many random points around it."""
    size = len(problem.free)
    if number < 2 or not np.any(problem.active):
        return [np.ones(size)]
    random = np.random.default_rng(seed)
    low, _ = problem.bounds()
    # For a number that may be negative or 0, the value 0 is at z = 1 - start/scale.
    zero = np.array([free.zero for free in problem.free])
    tried: list[tuple[float, Array]] = []
    for i in range(_SCREENED):
        # Half of the points lie far away: a default may be wrong by orders of magnitude here.
        spread = 0.7 if i % 2 else 2.0
        sign = np.where((low < zero) & (random.random(size) < 0.3), -1.0, 1.0)
        z = zero + (1.0 - zero) * sign * np.exp(random.normal(0.0, spread, size))
        z = problem.inside(np.where(problem.active, z, 1.0))
        cost = _rough_cost(problem, z)
        if math.isfinite(cost):
            tried.append((cost, z))
    tried.sort(key=lambda pair: pair[0])
    return [np.ones(size), *(z for _, z in tried[: number - 1])]


def search_starts(problem: FitProblem, number: int, seed: int) -> list[Array]:
    """The given start, and the best random points, roughly refined."""
    given, *tried = screened_points(problem, max(_POLISHED, number) + 1 if number > 1 else 1, seed)
    polished = [_polished(problem, z) for z in tried]
    polished.sort(key=lambda pair: pair[0])
    return [given, *(z for _, z in polished[: number - 1])]


def hold_dependent_numbers(problem: FitProblem, seed: int) -> dict[str, str]:
    """Hold free numbers that are not identifiable; returns the reason for each name.

    Such a number changes no prediction, or only in a way that other numbers can imitate. A model
    need not use the whole geometry, for example, and friction at a single speed determines only
    one number. `identifiability` decides, at the start and at the best of some random points
    around it. Of these, the point with the most identifiable numbers counts, and of several such
    points the one with the smallest residuals.
    """
    # Of equivalent numbers, keep one that may have either sign: it is not bounded at 0.
    preference = np.array([1.0 if f.low < 0.0 < f.high else 0.01 for f in problem.free])
    best: tuple[int, float, Told] | None = None
    silent = set(range(len(problem.free)))
    for start in screened_points(problem, _JUDGED, seed):
        z = problem.inside(start)
        try:
            slopes = problem.jacobian(z) * problem.own_sizes(z)
            misfit = float(np.sum(problem.residuals(z) ** 2))
        except DomainError:
            continue
        told = told_numbers(slopes, 0.0, preference)
        silent &= set(told.silent)
        if math.isfinite(misfit) and (best is None or (-len(told.told), misfit) < best[:2]):
            best = -len(told.told), misfit, told
    if best is None or not best[2].told:
        return {}
    reasons = {}
    for i, free in enumerate(problem.free):
        if i in silent:
            reasons[free.name] = "held: it changes no prediction"
        elif i not in best[2].told:
            reasons[free.name] = "held: not separable from other numbers"
    problem.active = np.array([free.name not in reasons for free in problem.free], dtype=bool)
    return reasons


def numbers_lost_in_noise(problem: FitProblem, best: Array) -> Any:
    """For each free number, whether its effect near the best z is below the noise."""
    active = np.flatnonzero(problem.active)
    lost = np.zeros(len(problem.free), dtype=bool)
    if active.size:
        z = problem.inside(best)
        slopes = (problem.jacobian(z) * problem.own_sizes(z))[:, active]
        noise = noise_of(problem.data, problem.residual)
        told = told_numbers(slopes, noise, np.ones(active.size))
        lost[active] = True
        lost[active[list(told.told)]] = False
    return lost


def _rough_cost(problem: FitProblem, z: Array) -> float:
    try:
        residuals = problem.rough_residuals(z)
    except DomainError:
        return math.inf
    return float(np.sum(residuals * residuals))


def _polished(problem: FitProblem, start: Array) -> tuple[float, Array]:
    if problem.residual == "force":
        return _rough_cost(problem, start), start
    at = _minimum(problem, start, problem.rough_residuals, None, 1e-3, 30)
    return _rough_cost(problem, at), at


def solve(
    problem: FitProblem,
    mask: Any,
    starts: list[Array],
    *,
    most: int = 100,
    tolerance: float = 1e-6,
) -> Array:
    """The best z on the points of a mask, with at most `most` steps from each start.

    The steps end when the relative change of the sum of squares falls below the tolerance.

    Raises
    ------
    DomainError
        If no start lies in the model's domain.
    """
    if not np.any(problem.active):
        return np.ones(len(problem.free))

    def residuals(z: Array) -> Array:
        return np.asarray(problem.residuals(z)[mask])

    def jacobian(z: Array) -> Array:
        return np.asarray(problem.jacobian(z)[mask])

    best: tuple[float, Array] | None = None
    refused: DomainError | None = None
    for start in starts:
        inside = problem.inside(start)
        try:
            first = residuals(inside)
        except DomainError as error:
            refused = error
            continue
        if not np.any(np.isfinite(first)):
            continue
        at = _minimum(problem, inside, residuals, jacobian, tolerance, most)
        reached = residuals(at)
        cost = float(np.sum(reached * reached))
        if best is None or cost < best[0]:
            best = cost, at
    if best is None:
        raise refused or DomainError(f"model {problem.name} cannot be evaluated at any start")
    return best[1]


def _minimum(
    problem: FitProblem,
    start: Array,
    residuals: Callable[[Array], Array],
    jacobian: Callable[[Array], Array] | None,
    tolerance: float,
    most: int,
) -> Array:
    """Least squares over the active numbers; a point outside the domain gets a high cost."""
    data = problem.data
    measured = data.force if problem.residual == "force" else data.position
    penalty = 10.0 * (float(np.ptp(measured)) + float(np.max(np.abs(measured))))
    size = residuals(problem.inside(start)).size
    active = problem.active

    def whole(part: Any) -> Array:
        z = start.copy()
        z[active] = part
        return z

    def cost(part: Any) -> Any:
        try:
            values = residuals(whole(part))
        except DomainError:
            return np.full(size, penalty)
        return np.where(np.isfinite(values), values, penalty)

    def slopes(part: Any) -> Any:
        assert jacobian is not None
        return jacobian(whole(part))[:, active]

    low, high = problem.bounds()
    bounds: Any = low[active], high[active]
    how: Any = "2-point" if jacobian is None else slopes
    found = least_squares(
        cost,
        problem.inside(start)[active],
        jac=how,
        bounds=bounds,
        diff_step=np.full(int(np.sum(active)), _ROUGH_STEP),
        x_scale="jac",
        ftol=tolerance,
        xtol=tolerance,
        max_nfev=most,
    )
    return whole(found.x)
