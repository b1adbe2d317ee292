"""Draw a force model: force, stiffness and volume against contraction, at several pressures."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pam_model.errors import DomainError, PamError
from pam_model.identify.measurements import Array
from pam_model.muscles.force_model import ForceModel, MuscleGeometry

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CONTRACTOR = MuscleGeometry(0.25, 2.0, 0.25 * math.cos(math.radians(20.0)), 1e-3)
"""A contracting muscle to draw: b = 0.25 m, n = 2, 20 deg at rest, 1 mm wall."""
EXTENSOR = MuscleGeometry(0.5, 4.0, 0.5 * math.cos(math.radians(70.0)), 1e-3)
"""An extending muscle to draw: b = 0.5 m, n = 4, 70 deg at rest, 1 mm wall."""
PRESSURES = (1e5, 2e5, 3e5, 4e5, 5e5)
_POINTS = 121


def new_figure(panels: int = 1) -> tuple[Figure, list[Axes]]:
    """A figure without a window, with its panels side by side."""
    # Figure instead of pyplot: it needs neither global state nor a display.
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(3.1 * panels if panels > 1 else 4.4, 3.0), layout="constrained")
    axes = [figure.add_subplot(1, panels, i + 1) for i in range(panels)]
    for axis in axes:
        axis.grid(alpha=0.3, linewidth=0.5)
    return figure, axes


def draw_force_model(
    model: ForceModel,
    rest_length: float,
    pressures: Sequence[float] = PRESSURES,
    *,
    title: str = "",
    reference: ForceModel | None = None,
) -> Figure:
    """Three panels against the contraction ratio; negative contraction is extension.

    Parameters
    ----------
    model : ForceModel
        The muscle.
    rest_length : float
        Length at which the contraction is zero [m].
    pressures : sequence of float
        Gauge pressures [Pa].
    title : str
        Title of the figure; by default the model's name.
    reference : ForceModel, optional
        Another model, drawn dotted at the same pressures.

    Raises
    ------
    DomainError
        If the model covers no length near the rest length at these pressures.
    """
    lengths, forces = _drawn_lengths(model, rest_length, pressures)
    contraction = 100.0 * (1.0 - lengths / rest_length)
    figure, (left, middle, right) = new_figure(3)
    for pressure, force in zip(pressures, forces, strict=True):
        label = f"{pressure / 1e5:g} bar"
        line = left.plot(contraction, force, label=label)
        if reference is not None:
            dotted = _pointwise(reference.force, lengths, pressure)
            left.plot(contraction, dotted, ":", linewidth=0.9, color=line[0].get_color())
        middle.plot(contraction, 1e-3 * _pointwise(model.stiffness, lengths, pressure))
    right.plot(contraction, 1e6 * _pointwise(model.volume, lengths), color="0.3")
    left.axhline(0.0, color="0.4", linewidth=0.7)
    for axis, label in (
        (left, "force [N]"),
        (middle, "stiffness dF/dL [kN/m]"),
        (right, "gas volume [cm³]"),
    ):
        axis.set_xlabel("contraction [%]")
        axis.set_ylabel(label)
    left.legend(fontsize="x-small", title="gauge pressure", title_fontsize="x-small")
    figure.suptitle(title or model.name, fontsize="medium")
    return figure


def _drawn_lengths(
    model: ForceModel, rest_length: float, pressures: Sequence[float]
) -> tuple[Array, list[Array]]:
    """Lengths from the rest length to just beyond zero force at the last pressure; forces there."""
    shortest, longest = model.length_bounds
    low = max(shortest * (1.0 + 1e-6) + 1e-9, 0.5 * rest_length)
    high = min(longest * (1.0 - 1e-6), 2.2 * rest_length)
    lengths = np.linspace(low, high, 6 * _POINTS)
    forces = np.stack([_pointwise(model.force, lengths, p) for p in pressures])
    if not np.any(np.isfinite(forces)):
        raise DomainError(
            f"model {model.name}: no length in [{low:g}, {high:g}] m and pressure in "
            f"[{min(pressures):g}, {max(pressures):g}] Pa lies in its domain"
        )
    size = np.nanmax(np.abs(forces), axis=0, initial=0.0, where=np.isfinite(forces))
    at_rest = float(np.interp(rest_length, lengths, size))
    pulls = float(np.interp(rest_length, lengths, np.nan_to_num(forces[-1]))) >= 0.0
    if pulls:
        # From the rest length to just past zero force.
        wanted = (lengths <= rest_length) & (forces[-1] >= -0.12 * at_rest)
    else:
        wanted = (lengths >= rest_length) & (forces[-1] <= 0.12 * at_rest)
    kept = lengths[wanted] if np.count_nonzero(wanted) > 2 else lengths
    drawn = np.linspace(float(kept[0]), float(kept[-1]), _POINTS)
    return drawn, [_pointwise(model.force, drawn, p) for p in pressures]


def _pointwise(function: Callable[..., Any], lengths: Array, *pressure: float) -> Array:
    """Values at lengths, NaN outside the model's domain."""
    values = np.full(lengths.shape, math.nan)
    for i, length in enumerate(lengths.tolist()):
        try:
            values[i] = function(*pressure, length)
        except DomainError:
            continue
    return values


def save_figure(figure: Figure, path: str | Path, dots_per_inch: int = 130) -> Path:
    """Write a figure in the format of the file's extension (png, svg, pdf).

    Raises
    ------
    PamError
        For an extension without a format, or a path that cannot be written.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # Write no date, so that the same figure always gives the same file.
        metadata = {"Date": None} if path.suffix == ".svg" else None
        figure.savefig(path, dpi=dots_per_inch, metadata=metadata)
    except (ValueError, OSError) as error:
        raise PamError(f"{path}: cannot be written: {error}") from error
    return path
