"""Rank force models on the same measured points by their held-out error.

Each model is fitted again (`fit`), and each block is held out once. A paired bootstrap decides
whether two models differ: clusters of points that share their errors are drawn with replacement,
with the same draw for both models. If the 95 % interval of the difference in mean squared held-out
error contains 0, the data cannot separate the two models. The intervals hold for one pair at a
time; they are not corrected for multiple comparisons.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pam_model.errors import PamError
from pam_model.identify.fit import FitResult, fit
from pam_model.identify.fit_problem import RESIDUAL_UNITS, Residual
from pam_model.identify.measurements import Array, Measurements
from pam_model.muscles.force_model import MuscleGeometry, registered_models

DRAWS = 2000


@dataclass(frozen=True, slots=True)
class RankedModel:
    """One model in the ranking."""

    fit: FitResult  # the model on all points, and its held-out error
    free_numbers: int  # number of fitted numbers
    # low, high: 95 % bootstrap interval of the held-out error [unit]
    low: float
    high: float
    ties: tuple[str, ...]  # models that the data cannot separate from this one


@dataclass(frozen=True, slots=True)
class Comparison:
    """Models on one branch of the points, best first."""

    data: Measurements  # the points
    branch: str  # name of the branch, or ""
    unit: str  # unit of the errors
    ranking: tuple[RankedModel, ...]  # smallest held-out error first
    refused: Mapping[str, str]  # models that could not be fitted, with the reason

    def table(self) -> str:
        """The ranking as text."""
        scale, unit = (1e3, "mm") if self.unit == "m" else (1.0, self.unit)
        blocks = ", ".join(dict.fromkeys(str(b) for b in self.data.block))
        title = f"{self.data.name}{', ' + self.branch if self.branch else ''}"
        best = self.ranking[0]
        lines = [
            f"{title}: {len(self.data)} points, held out one at a time: {blocks}",
            f"  {'model':32s} free  training  held out [{unit}], 95 % interval",
        ]
        for row in self.ranking:
            tied = row is best or best.fit.model in row.ties
            interval = f"({row.low * scale:.3g} to {row.high * scale:.3g})"
            lines.append(
                f"{'=' if tied else ' '} {row.fit.model:32s} {row.free_numbers:4d}  "
                f"{row.fit.training_error * scale:8.3g}  "
                f"{row.fit.held_out_error * scale:8.3g}  {interval}"
            )
        lines.append(f"  = not distinguishable from the best, {best.fit.model}")
        for name, why in self.refused.items():
            lines.append(f"  {name} was not fitted: {why}")
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "data": self.data.name,
            "branch": self.branch,
            "unit": self.unit,
            "points": len(self.data),
            "blocks": list(dict.fromkeys(str(b) for b in self.data.block)),
            "assumptions": list(self.data.assumptions),
            "ranking": [
                {
                    "model": row.fit.model,
                    "free_numbers": row.free_numbers,
                    "training_error": row.fit.training_error,
                    "held_out_error": row.fit.held_out_error,
                    "held_out_low": row.low,
                    "held_out_high": row.high,
                    "indistinguishable_from": list(row.ties),
                    "fit": row.fit.as_dict(),
                }
                for row in self.ranking
            ],
            "refused": dict(self.refused),
        }


def compare(
    data: Measurements,
    models: Iterable[str] | None = None,
    geometry: MuscleGeometry | None = None,
    *,
    fit_geometry: bool = False,
    residual: Residual = "force",
    starts: int = 4,
    seed: int = 1,
    stated: Mapping[str, float] | None = None,
) -> list[Comparison]:
    """Rank models on each branch of the points.

    Parameters
    ----------
    data : Measurements
        Points in at least two blocks.
    models : iterable of str, optional
        Names; all registered force models by default.
    geometry : MuscleGeometry, optional
        The muscle. Without it, `fit_geometry` must be set.
    fit_geometry : bool
        Also fit rest length, braid angle and diameter.
    residual : str
        "force" or "length", as in `fit`.
    starts : int
        As in `fit`.
    seed : int
        Seed of the random starts and of the bootstrap.
    stated : mapping of str to float, optional
        Known numbers of the geometry, as in `fit`.

    Raises
    ------
    PamError
        For a branch with fewer than two blocks, an unknown model, or if no model can be fitted.
    """
    names = list(models) if models is not None else list(registered_models())
    unknown = [name for name in names if name not in registered_models()]
    if unknown:
        raise PamError(
            f"unknown force model {', '.join(unknown)}; known: {', '.join(registered_models())}"
        )
    results = []
    for branch, points in data.branches().items():
        if np.unique(points.block).size < 2:
            raise PamError(
                f"{data.name}{', ' + branch if branch else ''}: 1 block; a held-out error needs "
                "at least 2 (column block)"
            )
        fits: list[FitResult] = []
        refused: dict[str, str] = {}
        for name in names:
            try:
                fits.append(
                    fit(
                        name,
                        points,
                        geometry,
                        fit_geometry=fit_geometry,
                        residual=residual,
                        starts=starts,
                        seed=seed,
                        stated=stated,
                    )
                )
            except PamError as error:
                refused[name] = str(error)
        if not fits:
            raise PamError(
                f"{data.name}: no model could be fitted: "
                + "; ".join(f"{k}: {v}" for k, v in refused.items())
            )
        ranking = _rank(fits, points, seed)
        results.append(Comparison(points, branch, RESIDUAL_UNITS[residual], ranking, refused))
    return results


def _rank(fits: list[FitResult], data: Measurements, seed: int) -> tuple[RankedModel, ...]:
    fits = sorted(fits, key=lambda f: f.held_out_error)
    clusters, index = np.unique(data.cluster, return_inverse=True)
    number = clusters.size
    sizes = np.bincount(index, minlength=number).astype(float)
    sums = np.stack([np.bincount(index, f.held_out**2, minlength=number) for f in fits])
    draws = np.random.default_rng(seed).integers(0, number, (DRAWS, number))
    weight: Array = np.stack([np.bincount(d, minlength=number) for d in draws]).astype(float)
    squares = (weight @ sums.T) / (weight @ sizes)[:, None]
    ranked = []
    for i, result in enumerate(fits):
        low, high = np.sqrt(np.quantile(squares[:, i], [0.025, 0.975]))
        ties = []
        for j, other in enumerate(fits):
            if i == j:
                continue
            less, more = np.quantile(squares[:, i] - squares[:, j], [0.025, 0.975])
            # Two forms of one model agree to rounding; they tie for either sign of the difference.
            rounding = 1e-6 * (squares[:, i] + squares[:, j]).mean()
            if less <= rounding and more >= -rounding:
                ties.append(other.model)
        free = sum(p.fitted for p in result.parameters.values())
        ranked.append(RankedModel(result, free, float(low), float(high), tuple(ties)))
    return tuple(ranked)
