"""Pictures of a fit and of a comparison: measured points, models, held-out errors."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pam_model.identify.compare import Comparison
from pam_model.identify.fit import FitResult
from pam_model.identify.fit_problem import predicted_force
from pam_model.identify.measurements import Array, Measurements
from pam_model.identify.show import new_figure
from pam_model.muscles.equilibrium_length import equilibrium_length
from pam_model.muscles.force_model import create_force_model

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CURVES = 4
_POINTS = 200


def draw_fit(result: FitResult, data: Measurements) -> Figure:
    """Measured points with the model, and at every point the held-out model minus the measured."""
    figure, (left, right) = new_figure(2)
    _draw_points(left, data, [result])
    scale, unit = _scale(result.unit)
    for block in dict.fromkeys(str(b) for b in data.block):
        mask = data.block == block
        right.plot(data.pressure[mask] / 1e5, scale * result.held_out[mask], ".", ms=4, label=block)
    right.axhline(0.0, color="0.4", linewidth=0.7)
    right.set_xlabel("gauge pressure [bar]")
    right.set_ylabel(f"held-out error [{unit}]")
    figure.legend(  # beside the points, of which it would hide some
        *right.get_legend_handles_labels(), loc="outside right upper", fontsize="x-small",
        title="held-out\nblock", title_fontsize="x-small",
    )  # fmt: skip
    figure.suptitle(f"{result.model} on {data.name}", fontsize="medium")
    return figure


def draw_comparison(comparisons: list[Comparison]) -> Figure:
    """For each branch: the points with the best models, and all held-out errors."""
    from matplotlib.figure import Figure  # noqa: PLC0415

    rows = len(comparisons)
    names = max(len(c.ranking) for c in comparisons)
    figure = Figure(figsize=(10.0, rows * max(3.2, 0.22 * names + 1.2)), layout="constrained")
    for i, comparison in enumerate(comparisons):
        left = figure.add_subplot(rows, 2, 2 * i + 1)
        right = figure.add_subplot(rows, 2, 2 * i + 2)
        for axis in (left, right):
            axis.grid(alpha=0.3, linewidth=0.5)
        _draw_points(left, comparison.data, _different(comparison))
        title = f"{comparison.data.name}{', ' + comparison.branch if comparison.branch else ''}"
        left.set_title(title, fontsize="medium")
        _draw_errors(right, comparison)
    return figure


def _different(comparison: Comparison) -> list[FitResult]:
    """The best models; of several models with equal errors, only the first."""
    chosen: list[FitResult] = []
    for row in comparison.ranking:
        error = row.fit.held_out_error
        if all(not math.isclose(error, c.held_out_error, rel_tol=1e-3) for c in chosen):
            chosen.append(row.fit)
        if len(chosen) == _CURVES:
            break
    return chosen


def _draw_errors(axis: Axes, comparison: Comparison) -> None:
    scale, unit = _scale(comparison.unit)
    ranking = comparison.ranking[::-1]
    best = comparison.ranking[0]
    errors = scale * np.array([row.fit.held_out_error for row in ranking])
    reach = scale * np.array([[row.low for row in ranking], [row.high for row in ranking]])
    colours = [
        "tab:green" if row is best or best.fit.model in row.ties else "0.6" for row in ranking
    ]
    places = np.arange(len(ranking))
    axis.barh(places, errors, color=colours, height=0.7)
    # A bootstrap interval need not contain the estimate itself.
    whiskers = np.maximum([errors - reach[0], reach[1] - errors], 0.0)
    axis.errorbar(errors, places, xerr=whiskers, fmt="none", color="0.2", linewidth=1.0)
    axis.set_yticks(places, [row.fit.model for row in ranking], fontsize="x-small")
    axis.set_xlabel(f"held-out error, root mean square [{unit}], 95 % interval")
    farthest = max(float(np.max(errors)), float(np.max(reach)))
    axis.set_xlim(0.0, 1.05 * min(farthest, 4.6 * float(np.median(errors))))
    axis.set_title("green: not distinguishable from the best", fontsize="small")


def _draw_points(axis: Axes, data: Measurements, results: list[FitResult]) -> None:
    """Draw position against pressure for a fitted length, else modelled against measured force."""
    if results[0].unit == "m":
        for block in dict.fromkeys(str(b) for b in data.block):
            mask = data.block == block
            axis.plot(data.pressure[mask] / 1e5, 1e3 * data.position[mask], ".", ms=3, label=block)
        axis.set_xlabel("gauge pressure [bar]")
        axis.set_ylabel(f"{'shortening' if data.is_shortening else 'length'} [mm]")
        if np.ptp(data.force) <= 1e-9 * float(np.max(np.abs(data.force))):
            pressures = np.linspace(float(data.pressure.min()), float(data.pressure.max()), _POINTS)
            for result in results:
                line = 1e3 * _positions(result, data, pressures)
                axis.plot(pressures / 1e5, line, linewidth=1.1, label=result.model)
        axis.legend(fontsize="x-small")
        return
    extremes = [float(data.force.min()), float(data.force.max())]
    for result in results:
        model = create_force_model(result.model, result.geometry, result.constants)
        predicted = predicted_force(model, result.geometry, data)
        axis.plot(data.force, predicted, ".", ms=3, label=result.model)
    axis.plot(extremes, extremes, color="0.4", linewidth=0.7)
    axis.set_xlabel("measured force [N]")
    axis.set_ylabel("modelled force [N]")
    axis.legend(fontsize="x-small")


def _positions(result: FitResult, data: Measurements, pressures: Array) -> Array:
    model = create_force_model(result.model, result.geometry, result.constants)
    rest = result.geometry.rest_length
    lengths = equilibrium_length(
        model,
        pressures,
        np.full(pressures.shape, float(data.force[0])),
        np.full(pressures.shape, float(data.velocity[0])),
        rest if data.is_shortening else math.inf,
    )
    return rest - lengths if data.is_shortening else lengths


def _scale(unit: str) -> tuple[float, str]:
    return (1e3, "mm") if unit == "m" else (1.0, unit)
