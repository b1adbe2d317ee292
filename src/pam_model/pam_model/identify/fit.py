"""Identify a force model's constants and geometry from measured points.

Nonlinear least squares (`scipy.optimize.least_squares`, bounded, several starts) on the force,
or on the length of the muscle at given pressure and force. The geometry is parametrised by rest
length, braid angle at rest and diameter at rest, so that it always describes a possible braid.
The intervals are robust against errors that the points of a cluster share (sandwich estimate,
Student's t). The held-out error is a cross-validation: each block is predicted by a fit to the
other blocks.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import t as student

from pam_model.errors import DomainError, PamError
from pam_model.identify.fit_problem import RESIDUAL_UNITS, FitProblem, Residual
from pam_model.identify.fit_search import (
    hold_dependent_numbers,
    numbers_lost_in_noise,
    search_starts,
    solve,
)
from pam_model.identify.free_numbers import GEOMETRY_UNITS, HOW_TO_STATE
from pam_model.identify.identifiability import imitated
from pam_model.identify.measurements import Array, Measurements
from pam_model.muscles.force_model import MuscleGeometry

_EXCHANGED = 0.1
"""Share of the effect of a number that another one must take over to be named as its partner."""
_EXACT = 1e-12
"""Tolerance of the last steps: small, so that the result does not depend on the search path."""


@dataclass(frozen=True, slots=True)
class FittedParameter:
    """One number of a fit; low and high are its 95 % interval, equal to a value that was given."""

    value: float
    low: float
    high: float
    unit: str
    fitted: bool
    note: str = ""


@dataclass(frozen=True, slots=True)
class FitResult:
    """A fitted model: its numbers, their intervals and the errors of the fit."""

    model: str  # name of the force model
    geometry: MuscleGeometry  # as fitted or given
    constants: Mapping[str, float]  # as fitted or given; usable as a rig file's `model_parameters`
    parameters: Mapping[str, FittedParameter]  # all numbers with their intervals
    # training_error, held_out_error: root mean square [unit]
    training_error: float
    held_out_error: float
    unit: str  # N or m
    # held-out residual of every point, model minus measurement [unit]
    held_out: Array = field(repr=False)
    # points, blocks: number of points and of blocks
    points: int
    blocks: int
    # Of the points, those outside the model's domain at the fitted numbers. Each counts with an
    # error as large as the largest force.
    outside: int = 0
    # for numbers that the data do not determine, the numbers with which they are exchanged
    partners: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON; an infinite bound of an interval becomes null."""
        return {
            "model": self.model,
            "geometry": {
                "thread_length": self.geometry.thread_length,
                "turns": self.geometry.turns,
                "rest_length": self.geometry.rest_length,
                "wall_thickness": self.geometry.wall_thickness,
            },
            "constants": dict(self.constants),
            "parameters": {
                name: {
                    "value": p.value,
                    "low": p.low if math.isfinite(p.low) else None,
                    "high": p.high if math.isfinite(p.high) else None,
                    "unit": p.unit,
                    "fitted": p.fitted,
                    "note": p.note,
                }
                for name, p in self.parameters.items()
            },
            "training_error": self.training_error,
            "held_out_error": self.held_out_error,
            "unit": self.unit,
            "points": self.points,
            "blocks": self.blocks,
            "outside": self.outside,
        }

    def table(self) -> str:
        """The fit as text."""
        held_out = f"{self.held_out_error:.4g} {self.unit} held out (root mean square)"
        if not math.isfinite(self.held_out_error):
            held_out = "root mean square; none held out, since all points are one `block`"
        lines = [
            f"{self.model}: {self.points} points in {self.blocks} block{'s'[: self.blocks != 1]}",
            f"  error {self.training_error:.4g} {self.unit} in training, {held_out}",
        ]
        if self.outside:
            lines.append(
                f"  {self.outside} of the points lie outside the domain of the model with these "
                "numbers; each counts with an error as large as the largest force"
            )
        for name, p in self.parameters.items():
            if not p.fitted:
                interval = "" if p.note else "given"
            elif math.isfinite(p.low) and math.isfinite(p.high):
                interval = f"95 %: {p.low:.6g} to {p.high:.6g}"
            else:
                interval = "not identifiable"
            note = f"  ({p.note})" if p.note else ""
            lines.append(f"  {name:26s} {p.value:12.6g} {p.unit:10s} {interval}{note}")
        return "\n".join([*lines, *(f"  advice: {text}" for text in self.advice())])

    def advice(self) -> list[str]:
        """For each number that the data do not determine, what would determine it."""
        found: list[str] = []
        told: list[set[str]] = []
        for name, p in self.parameters.items():
            if math.isfinite(p.high) and math.isfinite(p.low):
                continue
            if name in self.partners:
                alike = self.partners[name]
                ways = "; ".join(_how_to_state(one) for one in (name, *alike))
                if {name, *alike} not in told:
                    found.append(
                        f"{name} cannot be distinguished from {' and '.join(alike)} at these "
                        f"points; state one of them: {ways}"
                    )
                    told.append({name, *alike})
            elif p.note == "at its bound":
                found.append(
                    f"{name} is at its bound: compare other models, or state it "
                    f"({_how_to_state(name)})"
                )
            elif p.fitted:
                found.append(
                    f"{name} changes less than the noise does: measure at more pressures and over "
                    f"a wider range of lengths, or state it ({_how_to_state(name)})"
                )
        return found


def fit(
    name: str,
    data: Measurements,
    geometry: MuscleGeometry | None = None,
    constants: Mapping[str, float] | None = None,
    *,
    fit_geometry: bool = False,
    free: Iterable[str] | None = None,
    residual: Residual = "force",
    starts: int = 4,
    seed: int = 1,
    stated: Mapping[str, float] | None = None,
) -> FitResult:
    """Identify a model on measured points.

    Parameters
    ----------
    name : str
        A registered force model.
    data : Measurements
        One branch of the points, or all of them.
    geometry : MuscleGeometry, optional
        The muscle. Without it, the fit starts from a guess and `fit_geometry` must be set.
    constants : mapping of str to float, optional
        Constants held at a value instead of fitted.
    fit_geometry : bool
        Also fit those of rest length, braid angle, diameter and wall that the model uses.
    free : iterable of str, optional
        Fit exactly these (constants, or names of `GEOMETRY_UNITS`).
    residual : str
        "force" [N], or "length" [m] at given pressure and force.
    starts : int
        Number of starts: the given one, and the best of some random ones around it.
    seed : int
        Seed of the random starts.
    stated : mapping of str to float, optional
        Numbers of `GEOMETRY_UNITS` that are known, where the geometry is fitted.

    Raises
    ------
    PamError
        For unknown names, or fewer points than free numbers.
    DomainError
        If no start lies in the model's domain, or for a geometry that the model does not accept.
    """
    problem = FitProblem(
        name,
        data,
        geometry=geometry,
        constants=constants or {},
        fit_geometry=fit_geometry,
        free=free,
        residual=residual,
        stated=stated,
    )
    held = hold_dependent_numbers(problem, seed) if free is None and problem.free else {}
    blocks = list(dict.fromkeys(str(b) for b in data.block))
    size = int(np.sum(problem.active))
    if len(data) <= size:
        raise PamError(f"{data.name}: {len(data)} points are too few for {size} free numbers")
    everything = np.ones(len(data), dtype=bool)
    best = solve(problem, everything, search_starts(problem, starts, seed))
    # Refine to the exact optimum, so that the results below do not depend on the search path.
    best = solve(problem, everything, [best], tolerance=_EXACT)
    lost = numbers_lost_in_noise(problem, best)
    if free is None and np.any(lost):
        # Numbers that the data do not determine keep their start value.
        problem.active &= ~lost
        best = solve(problem, everything, [best], tolerance=_EXACT)
    residuals = problem.residuals(best)
    if not np.all(np.isfinite(residuals)):
        raise DomainError(f"model {name}: gives no finite value at some of the points")
    held_out = np.full(len(data), math.nan)
    if len(blocks) > 1:
        for block in blocks:
            left_out = data.block == block
            if int(np.sum(~left_out)) <= size:
                raise PamError(
                    f"{data.name}: without block {block!r} {int(np.sum(~left_out))} points are "
                    f"left, too few for {size} free numbers"
                )
            trained = solve(problem, ~left_out, [best], most=30, tolerance=_EXACT)
            held_out[left_out] = problem.residuals(trained)[left_out]
    _, found_geometry, found_constants = problem.model(best)
    return FitResult(
        name,
        found_geometry,
        found_constants,
        _intervals(problem, best, residuals, held, lost),
        _root_mean_square(residuals),
        _root_mean_square(held_out),
        RESIDUAL_UNITS[residual],
        held_out,
        len(data),
        len(blocks),
        problem.outside(best),
        _partners(problem, best),
    )


def _partners(problem: FitProblem, best: Array) -> dict[str, tuple[str, ...]]:
    """For each number that the data do not determine, the numbers with which it is exchanged.

    Raises
    ------
    DomainError
        If the model covers no point at the best numbers.
    """
    z = problem.inside(best)
    slopes = problem.jacobian(z) * problem.own_sizes(z)
    names = [free.name for free in problem.free]
    found: dict[str, tuple[str, ...]] = {}
    alike = imitated(slopes)
    for i in np.flatnonzero(~problem.active | alike).tolist():
        others = [k for k in range(len(names)) if k != i and (problem.active[k] or alike[k])]
        size = float(np.linalg.norm(slopes[:, i]))
        if not others or size <= 0.0:
            continue
        shares = np.linalg.lstsq(slopes[:, others], slopes[:, i], rcond=None)[0]
        sizes = np.abs(shares) * np.linalg.norm(slopes[:, others], axis=0) / size
        near = [names[k] for k, share in zip(others, sizes, strict=True) if share > _EXCHANGED]
        if near:
            found[names[i]] = tuple(near)
    return found


def _intervals(
    problem: FitProblem, best: Array, residuals: Array, held: Mapping[str, str], lost: Any
) -> dict[str, FittedParameter]:
    """95 % intervals by the sandwich estimate over clusters; infinite if not identifiable."""
    values = problem.values(best)
    units = {**GEOMETRY_UNITS, **{key: p.unit for key, p in problem.declared.items()}}
    result = {k: FittedParameter(values[k], values[k], values[k], units[k], False) for k in units}
    size = len(problem.free)
    if not size:
        return result
    jacobian = problem.jacobian(problem.inside(best))
    silent = imitated(jacobian)
    bread = _inverse_information(jacobian, silent)
    clusters = np.unique(problem.data.cluster)
    meat = np.zeros((size, size))
    for cluster in clusters:
        rows = problem.data.cluster == cluster
        score = jacobian[rows].T @ residuals[rows]
        meat += np.outer(score, score)
    number = clusters.size
    spread = np.full(size, math.inf)
    degrees = number - len(problem.free) + len(held)
    if degrees > 0:
        covariance = bread @ meat @ bread * number / degrees
        spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        spread = spread * float(student.ppf(0.975, degrees))
    for i, free in enumerate(problem.free):
        value = values[free.name]
        if free.name in held:
            result[free.name] = FittedParameter(
                value, -math.inf, math.inf, units[free.name], False, held[free.name]
            )
            continue
        reach = math.inf if silent[i] or lost[i] else float(spread[i]) * free.scale
        near = 1e-6 * max(abs(value), free.scale)
        at_bound = min(value - free.low, free.high - value) <= near
        note = "at its bound" if at_bound else ("the data do not determine it" if silent[i] else "")
        if lost[i]:
            note = "its effect is below the noise"
        if at_bound:
            reach = math.inf
        result[free.name] = FittedParameter(
            value, value - reach, value + reach, units[free.name], True, note
        )
    return result


def _inverse_information(jacobian: Array, silent: Any) -> Array:
    """(J'J)^-1 of the numbers that are not marked as silent, 0 for the others."""
    size = jacobian.shape[1]
    result = np.zeros((size, size))
    determined = ~silent
    if np.any(determined):
        columns = jacobian[:, determined]
        length = np.sqrt(np.sum(columns * columns, axis=0))
        # Scale the columns and avoid the product J'J, which would square the condition number.
        _, singular, right = np.linalg.svd(columns / length, full_matrices=False)
        half = right.T / singular / length[:, None]
        result[np.ix_(determined, determined)] = half @ half.T
    return result


def _how_to_state(name: str) -> str:
    return HOW_TO_STATE.get(name, f"--set {name}=NUMBER")


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt(np.mean(values * values)))
