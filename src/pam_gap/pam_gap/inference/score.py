"""The held-out score of a hypothesis, which is all that a decision needs.

The level of a score is the sum over channels of the logarithm of the mean squared error over the
noise floor, never below 0 in a channel. A difference of levels is twice the log likelihood ratio
per observation of two Gaussian models whose variances are not known.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from pam_gap.prediction.fit import Array


def levels(sums: Array, counts: Array, floor: Array, present: np.ndarray) -> Array:
    """Level from sums of squares and counts, shape (..., channels); leading axes are kept."""
    mean = sums / np.maximum(counts, 1.0) / floor
    value: Array = np.log(np.maximum(mean, 1.0))[..., present].sum(axis=-1)
    return value


def level(mean_square: Array, floor: Array, present: np.ndarray) -> float:
    """Sum over channels of the log mean square over the floor, at least 0 in a channel."""
    return float(np.sum(np.log(np.maximum(mean_square / floor, 1.0))[present]))


@dataclass(frozen=True, slots=True)
class Score:
    """The remaining error of one hypothesis on data that were not used for its fit.

    Attributes
    ----------
    effects : tuple of str
        Effects of the hypothesis; empty for the nominal plant.
    label : str
        The effects, with the side of one-sided effects.
    free_numbers : int
        Number of free parameters of the effects.
    sums, counts : ndarray, shape (n_blocks, channels)
        Sum of squared whitened errors, and number of rows, of each score block.
    ordinary : tuple of str
        Those of the effects that are no larger than on an ordinary good rig, and thus no causes.
    simulated_sums : ndarray, shape (n_blocks, channels), optional
        The sums for the simulation alone, whose errors contain an ordinary background; without
        it, no background was fitted.
    unlisted : str
        Cause outside the table of effects that the hypothesis contains, as text.
    cut_off : tuple of str
        Effects whose size is at the far end of the range that is searched; with more of them the
        hypothesis might explain more.
    """

    effects: tuple[str, ...]
    label: str
    free_numbers: int
    sums: Array
    counts: Array
    ordinary: tuple[str, ...] = field(default=(), kw_only=True)
    simulated_sums: Array | None = field(default=None, kw_only=True)
    unlisted: str = field(default="", kw_only=True)
    cut_off: tuple[str, ...] = field(default=(), kw_only=True)

    @property
    def simulated(self) -> Self:
        """The score of the simulation alone, without the amounts of an ordinary background."""
        return self if self.simulated_sums is None else replace(self, sums=self.simulated_sums)

    @property
    def causes(self) -> tuple[str, ...]:
        """Effects that stand out of an ordinary background."""
        return tuple(effect for effect in self.effects if effect not in self.ordinary)

    def with_causes(self, causes: Collection[str]) -> Self:
        """The same score with these effects as causes, whatever their size."""
        return replace(self, ordinary=tuple(e for e in self.ordinary if e not in causes))

    @property
    def size(self) -> int:
        """Number of causes; effects of ordinary size cost a hypothesis nothing."""
        return len(self.causes)

    @property
    def mean_square(self) -> Array:
        """Mean squared whitened error on held-out data, shape (channels,)."""
        mean: Array = self.sums.sum(axis=0) / np.maximum(self.counts.sum(axis=0), 1.0)
        return mean

    def over_floor(self, floor: Array, present: np.ndarray) -> Array:
        """RMS error over floor of each recorded channel."""
        ratio: Array = np.sqrt(self.mean_square / floor)[present]
        return ratio

    def level(self, floor: Array, present: np.ndarray) -> float:
        """Level over all blocks."""
        return float(levels(self.sums.sum(0), self.counts.sum(0), floor, present))
