"""How large the gap is: per channel in its unit, at one step, at half a second and in free run.

One step hides slow errors and free run adds up early ones, so all are given. The floor of each is
what the channels' noise alone does to it: the difference the same predictions show when one more
draw of that noise is added to the measurements.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pam_gap.fit import Array, mean_squares
from pam_gap.prediction import PredictionProblem

ONE_STEP_BANDWIDTH = 200.0  # rad/s, of the position's pull
UNITS = ("Pa", "Pa", "rad", "N", "N")


@dataclass(frozen=True, slots=True)
class Horizon:
    """One way to predict: its name and how the observer is set for it."""

    name: str
    pull: float
    bandwidth: float
    window: float


HORIZONS = (
    Horizon("one step", 1e-4, ONE_STEP_BANDWIDTH, 0.0),
    Horizon("0.5 s", np.inf, 0.0, 0.5),
    Horizon("free run", np.inf, 0.0, 0.0),
)


@dataclass(frozen=True, slots=True)
class GapFigure:
    """RMS prediction error of one channel over one horizon, in the channel's unit."""

    horizon: str
    channel: str
    unit: str
    before: float
    after: float
    floor: float


def noise_level(problem: PredictionProblem, values: Array, **settings: float) -> Array:
    """J_c that noise alone leaves at these predictions, shape (channels,), at least a little."""
    plain = problem.errors(values[None], **settings)[0]  # type: ignore[arg-type]
    noisy = problem.errors(values[None], noise_seed=12345, **settings)[0]  # type: ignore[arg-type]
    return np.maximum(mean_squares(noisy - plain, problem.counted), 0.05)


def gap_figures(
    problem: PredictionProblem, before: Array, after: Array, rows: np.ndarray | None = None
) -> list[GapFigure]:
    """The gap of two plants over every horizon.

    Parameters
    ----------
    problem : PredictionProblem
        Rig and recordings.
    before, after : ndarray, shape (n_parameters,)
        Full parameter vectors of the written and the improved plant.
    rows : ndarray of bool, optional
        Rows that count; default all after the start.
    """
    chosen = problem.counted if rows is None else rows
    scale = np.sqrt(np.mean([data.block_deviation**2 for data in problem.data], axis=0))
    figures = []
    for horizon in HORIZONS:
        settings = {
            "horizon": horizon.pull,
            "position_bandwidth": horizon.bandwidth,
            "window_time": horizon.window,
        }
        both = problem.errors(np.array([before, after]), **settings)  # type: ignore[arg-type]
        rms = np.sqrt(mean_squares(both, chosen))
        floor = np.sqrt(noise_level(problem, after, **settings))
        for c in np.nonzero(problem.present)[0]:
            figures.append(
                GapFigure(
                    horizon.name,
                    problem.names[c],
                    UNITS[c],
                    float(rms[0, c] * scale[c]),
                    float(rms[1, c] * scale[c]),
                    float(floor[c] * scale[c]),
                )
            )
    return figures
