"""How large the gap of each channel is: over one step, over 0.5 s and in a free run.

A one-step prediction hides slow errors, and a free run accumulates early ones. Therefore both are
given, with a horizon between them. The floor of each figure is the effect of sensor noise alone:
the change of the same predictions when one more draw of that noise is added to the measurements.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pam_gap.prediction.channel_order import UNITS
from pam_gap.prediction.fit import Array, mean_squares
from pam_gap.prediction.problem import PredictionProblem, PredictionSettings

ONE_STEP_BANDWIDTH = 200.0  # rad/s, of the correction of the position


@dataclass(frozen=True, slots=True)
class Horizon:
    """A prediction horizon and its name."""

    name: str
    settings: PredictionSettings


HORIZONS = (
    Horizon("one step", PredictionSettings(1e-4, position_bandwidth=ONE_STEP_BANDWIDTH)),
    Horizon("0.5 s", PredictionSettings(np.inf, window_time=0.5)),
    Horizon("free run", PredictionSettings(np.inf)),
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


def noise_level(
    problem: PredictionProblem, values: Array, settings: PredictionSettings | None = None
) -> Array:
    """Mean squared error of these predictions due to noise alone, shape (channels,)."""
    settings = problem.usual if settings is None else settings
    plain = problem.errors(values[None], settings)[0]
    noisy = problem.errors(values[None], replace(settings, noise_seed=12345))[0]
    least = problem.rules.prediction.least_floor
    return np.maximum(mean_squares(noisy - plain, problem.counted), least)


def gap_figures(problem: PredictionProblem, before: Array, after: Array) -> list[GapFigure]:
    """The gap of two plants over every horizon.

    Parameters
    ----------
    problem : PredictionProblem
        Rig and recordings.
    before, after : ndarray, shape (n_parameters,)
        Full parameter vectors of the plant in the rig file and of the improved plant.
    """
    scale = np.sqrt(np.mean([data.block_deviation**2 for data in problem.data], axis=0))
    figures = []
    for horizon in HORIZONS:
        both = problem.errors(np.array([before, after]), horizon.settings)
        rms = np.sqrt(mean_squares(both, problem.counted))
        floor = np.sqrt(noise_level(problem, after, horizon.settings))
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
