"""One Gauss-Newton step of a fit within bounds, and the dampings that are tried for it.

Source: Nocedal and Wright, Numerical Optimization, chapters 10 and 16.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
MOST_ACTIVE_SETS = 20
MOST_BOUNDS = 1000


def bounded_step(hessian: Array, slope: Array, low: Array, high: Array) -> Array:
    """Minimiser of x.H.x/2 + g.x in a box that contains 0 (H positive semidefinite).

    Source: primal-dual active sets, Hintermueller, Ito and Kunisch, SIAM J. Optim. 13 (2002); where
    they do not settle, a descent with one bound at a time.
    """
    size = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    scaled = hessian / np.outer(size, size)
    scaled[np.diag_indices(size.size)] += 1e-9
    pull, least, most = slope / size, low * size, high * size
    fixed = least == most
    at = fixed.astype(np.int64)
    for _ in range(MOST_ACTIVE_SETS):
        free = at == 0
        x = _best_of_free(scaled, pull, np.where(at < 0, least, most), free)
        moved = x + np.where(free, 0.0, -(scaled @ x + pull))
        before, at = at, np.where(fixed | (moved > most), 1, np.where(moved < least, -1, 0))
        if (at == before).all():
            break
    else:
        x = _bound_by_bound(scaled, pull, least, most)
    return np.asarray(np.clip(x / size, low, high))


def _best_of_free(hessian: Array, slope: Array, x: Array, free: npt.NDArray[np.bool_]) -> Array:
    """The minimiser if only the free entries of `x` may change."""
    held = np.where(free, 0.0, x)
    target = -(slope + hessian @ held)
    held[free] = np.linalg.solve(hessian[free][:, free], target[free])
    return held


def _bound_by_bound(hessian: Array, slope: Array, least: Array, most: Array) -> Array:
    """The minimiser in the box, on a path that begins at 0 and never rises.

    Each step ends at the first bound that it meets; where it meets none, the bound is given up that
    holds most against the slope.
    """
    x = np.zeros_like(slope)
    free = least < most
    for _ in range(MOST_BOUNDS):
        step = _best_of_free(hessian, slope, x, free) - x
        way = np.where(step > 0.0, most - x, least - x)
        share = np.divide(way, step, out=np.full_like(x, np.inf), where=free & (step != 0.0))
        first = int(np.argmin(share))
        if share[first] < 1.0:
            x += share[first] * step
            x[first] = most[first] if step[first] > 0.0 else least[first]
            free[first] = False
            continue
        x += step
        force = -(hessian @ x + slope)
        inwards = np.where(x < most, force, np.where(x > least, -force, 0.0))
        held = int(np.argmax(np.where(free, 0.0, inwards)))
        if inwards[held] <= 1e-12 * np.abs(slope).max():
            break
        free[held] = True
    return x


@dataclass(frozen=True, slots=True)
class FitStep:
    """One accepted step of a fit."""

    at: Array  # shape (n,): the new point, scaled
    errors: Array  # shape (blocks, channels): errors there
    value: float  # objective there
    damping: float  # damping with which the next step begins
    is_as_promised: bool  # whether the undamped step brought what the Jacobian promised


def best_step(
    hessian: Array,
    slope: Array,
    own: Callable[[Array], Array],
    box: tuple[Array, Array],
    at: Array,
    best: float,
    damping: float,
    attempts: int,
    objective: Callable[[Array, Array], Array],
    promise: float,
) -> Generator[Array, Array, FitStep | None]:
    """Try steps with several dampings; the best one that lowers the objective below `best`.

    The first step is tried alone. Where it brings what the Jacobian promises, the shorter ones are
    not simulated.

    Parameters
    ----------
    hessian, slope : ndarray
        Of the objective at `at`, scaled.
    own : callable
        Converts scaled points to the parameters' own units, which are yielded for simulation.
    box : tuple of ndarray
        Least and greatest scaled values.
    at : ndarray, shape (n,)
        Where the step begins, scaled.
    best : float
        Objective there.
    damping : float
        First damping.
    attempts : int
        How often it is raised.
    objective : callable
        Of the errors and the scaled points.
    promise : float
        Share of the promised fall from which a step brings what was promised.
    """
    scale = np.maximum(np.diag(hessian), 1e-9 * float(np.max(np.diag(hessian))) + 1e-12)
    low, high = box[0] - at, box[1] - at
    for attempt in range(attempts):

        def damped(factor: float, now: float = damping) -> Array:
            added = np.diag(scale * (now * factor + 1e-10))
            return bounded_step(hessian + added, slope, low, high)

        step = damped(min(attempt, 1))
        lanes = at + step[None]
        errors = yield own(lanes)
        values = objective(errors, lanes)
        promised = -float(slope @ step + 0.5 * step @ hessian @ step)
        kept = best - float(values[0]) > promise * promised > 0.0
        if not kept:
            others = at + np.array([damped(30.0), 0.3 * step])
            lanes = np.concatenate([lanes, others])
            errors = np.concatenate([errors, (yield own(others))])
            values = objective(errors, lanes)
        winner = int(np.argmin(values))
        if values[winner] < best:
            next_damping = max(damping * (0.1, 30.0, 10.0)[winner], 1e-5)
            kept = kept and attempt == 0
            won = errors[winner].copy()  # a view keeps all lanes of the batch
            return FitStep(lanes[winner], won, float(values[winner]), next_damping, kept)
        damping *= 1000.0
    return None
