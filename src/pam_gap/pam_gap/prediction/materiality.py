"""How large a gap is for the user: in the units of the channel and as a share of the motion.

A gap can be far above the noise of good sensors and still not matter for the work of the robot.
Each channel's error is therefore compared with the range in which the channel moved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pam_gap.prediction.channel_order import AGONIST_FORCE, POSITION, UNITS
from pam_gap.prediction.fit import Array
from pam_gap.prediction.problem import PredictionProblem

LOW, HIGH = 2.5, 97.5
"""Percentiles between which a channel is said to move."""


@dataclass(frozen=True, slots=True)
class GapSize:
    """The gap of one channel, in the channel's unit; noise is taken off in squares."""

    # channel, unit: name and unit
    channel: str
    unit: str
    stage: str  # last stage of the simulation before the channel
    motion: float  # range in which the channel moved
    before: float  # RMS error of the rig file as it is written
    retuned: float  # RMS error of the rig file re-tuned within its tolerance
    after: float  # RMS error that the answer leaves
    floor: float  # RMS error that noise alone causes, which the three errors above do not contain
    # limit, limit_unexplained: errors below which a gap does not matter, and one that no effect
    # explains
    limit: float
    limit_unexplained: float
    # RMS error that was taken for an ordinary background; 0 on a rig without one
    background: float = 0.0

    @property
    def share(self) -> float:
        """The gap of the re-tuned rig as a share of the motion."""
        return self.retuned / max(self.motion, 1e-300)

    @property
    def share_left(self) -> float:
        """What the answer leaves as a share of the motion."""
        return self.after / max(self.motion, 1e-300)

    @property
    def explained(self) -> float:
        """Share of the error of the rig file as written that the answer explains, 0 to 1."""
        return float(np.clip(1.0 - self.after / max(self.before, 1e-300), 0.0, 1.0))

    @property
    def is_material(self) -> bool:
        """Whether the gap of the re-tuned rig matters."""
        return self.retuned > self.limit

    @property
    def leaves_material(self) -> bool:
        """Whether what the answer leaves matters."""
        return self.after > self.limit_unexplained

    @property
    def leaves_ordinary(self) -> bool:
        """Whether what the answer leaves is no larger than an ordinary background."""
        return self.after <= self.background


def channel_stage(channel: int) -> str:
    """Last stage of the simulation before a channel, by its index."""
    if channel == POSITION:
        return "joint"
    return "muscle" if channel >= AGONIST_FORCE else "valve"


def scales(problem: PredictionProblem) -> Array:
    """Value of a whitened error of 1 in each channel, in its unit, shape (N_CHANNELS,)."""
    values: Array = np.sqrt(np.mean([d.block_deviation**2 for d in problem.data], axis=0))
    return values


def motion_ranges(problem: PredictionProblem) -> Array:
    """Range in which each channel moved while it counted, in its unit, shape (N_CHANNELS,)."""
    means = np.concatenate(
        [
            data.rows(data.measured)[: int(end - start)]
            for data, start, end in zip(
                problem.data, problem.offsets[:-1], problem.offsets[1:], strict=True
            )
        ]
    )[problem.counted]
    if not len(means):
        return np.zeros(problem.present.size)
    low, high = np.percentile(means, [LOW, HIGH], axis=0)
    ranges: Array = high - low
    return ranges


def squared_motion(problem: PredictionProblem) -> Array:
    """Squared range of each channel in units of its whitened errors, shape (N_CHANNELS,)."""
    scale = np.nan_to_num(scales(problem), nan=1.0)
    squares: Array = (motion_ranges(problem) / np.maximum(scale, 1e-300)) ** 2
    return squares


def gap_sizes(
    problem: PredictionProblem,
    floor: Array,
    share: float,
    share_unexplained: float,
    mean_squares: Sequence[Array],
    background: Array | None = None,
) -> tuple[GapSize, ...]:
    """The gap of every compared channel, the one with the largest share of its motion first.

    Parameters
    ----------
    problem : PredictionProblem
        Rig and recordings.
    floor : ndarray, shape (N_CHANNELS,)
        Mean squared whitened error due to noise alone.
    share, share_unexplained : float
        Shares of the motion below which a gap does not matter, and one that no effect explains.
    mean_squares : sequence of three ndarrays, shape (N_CHANNELS,)
        Mean squared whitened errors of the rig file as written, re-tuned, and of the answer.
    background : ndarray, shape (N_CHANNELS,), optional
        Mean squared whitened error that was taken for an ordinary background; none by default.
    """
    usual = np.zeros_like(floor) if background is None else background
    scale, ranges = scales(problem), motion_ranges(problem)
    found = []
    for c in np.nonzero(problem.present)[0].tolist():
        before, retuned, after = (
            float(np.sqrt(max(float(square[c] - floor[c]), 0.0)) * scale[c])
            for square in mean_squares
        )
        found.append(
            GapSize(
                problem.names[c],
                UNITS[c],
                channel_stage(c),
                float(ranges[c]),
                before,
                retuned,
                after,
                float(np.sqrt(floor[c]) * scale[c]),
                share * float(ranges[c]),
                share_unexplained * float(ranges[c]),
                float(np.sqrt(usual[c]) * scale[c]),
            )
        )
    return tuple(sorted(found, key=lambda gap: -gap.share))
