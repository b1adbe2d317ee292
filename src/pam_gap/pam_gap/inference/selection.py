"""Which hypotheses the held-out data cannot tell apart, and how strongly it speaks for each.

Losses of score blocks are compared by Hansen, Lunde and Nason's Model Confidence Set (Econometrica
79, 2011) with a block bootstrap over time; weights are the shares of bootstrap samples in which a
hypothesis leaves least. A hypothesis that contains a simpler one has to beat it clearly.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pam_gap.inference.held_out import HeldOut
from pam_gap.inference.model_confidence_set import circular_blocks, mcs_p_values
from pam_gap.prediction.fit import Array
from pam_model.effects import EFFECTS

CONFIDENCE_SIZE = 0.10
BOOTSTRAPS = 500
BLOCK_LENGTH = 4  # score blocks that are resampled together

NESTED = {
    (effect.search.richer.than, effect.name)
    for effect in EFFECTS.values()
    if effect.search.richer is not None
}
"""(simple, rich): the rich effect takes the simple one's form for some of its values."""


def resampled_blocks(n_blocks: int, generator: np.random.Generator) -> np.ndarray:
    """Indices of one circular block bootstrap sample of the score blocks."""
    length = max(1, min(BLOCK_LENGTH, n_blocks // 4))
    return circular_blocks(n_blocks, length, generator)


def levels(sums: Array, counts: Array, floor: Array, present: np.ndarray) -> Array:
    """Sum of log J over channels from block sums, leading axes kept."""
    mean = sums / np.maximum(counts, 1.0) / floor
    value: Array = np.log(np.maximum(mean, 1.0))[..., present].sum(axis=-1)
    return value


def held_out_level(score: HeldOut, floor: Array, present: np.ndarray) -> float:
    """Level of a held-out score: the sum over its channels of log mean square over floor."""
    return float(levels(score.sums.sum(0), score.counts.sum(0), floor, present))


def bootstrap_weights(
    scores: Sequence[HeldOut], floor: Array, present: np.ndarray, seed: int = 0
) -> Array:
    """Share of bootstrap samples in which each hypothesis leaves least; sums to 1."""
    generator = np.random.default_rng(seed)
    sums = np.array([s.sums for s in scores])
    counts = np.array([s.counts for s in scores])
    wins = np.zeros(len(scores))
    for _ in range(BOOTSTRAPS):
        at = resampled_blocks(sums.shape[1], generator)
        value = levels(sums[:, at].sum(axis=1), counts[:, at].sum(axis=1), floor, present)
        # Equal to the rounding of the scores: the prize is shared.
        best = value <= value.min() + 1e-3
        wins += best / best.sum()
    return wins / BOOTSTRAPS


def confidence_set(scores: Sequence[HeldOut], floor: Array, present: np.ndarray) -> list[bool]:
    """Whether each hypothesis belongs to the Model Confidence Set.

    The loss of a block is the sum over channels of its mean square over that of the best
    hypothesis in the channel (never below the floor), so that channels weigh alike.
    """
    if len(scores) < 2:
        return [True] * len(scores)
    overall = np.array([levels(s.sums.sum(0), s.counts.sum(0), floor, present) for s in scores])
    best = scores[int(np.argmin(overall))]
    weight = 1.0 / np.maximum(best.mean_square, floor)
    losses = np.array(
        [
            np.nansum(
                (s.sums / np.where(s.counts > 0, s.counts, np.nan) * weight)[:, present], axis=1
            )
            for s in scores
        ]
    ).T
    keep = (scores[0].counts[:, present] > 0).all(axis=1)
    losses = losses[keep]
    if len(losses) < 8:
        return [bool(value <= overall.min() + 0.5) for value in overall]
    p_values = mcs_p_values(
        losses, block_length=max(2, min(BLOCK_LENGTH, len(losses) // 4)), draws=BOOTSTRAPS
    )
    return [bool(p > CONFIDENCE_SIZE) for p in p_values]


def contains(rich: Sequence[str], simple: Sequence[str]) -> bool:
    """Whether the effects `rich` include those of `simple`, or forms that include them."""
    left = list(rich)
    for effect in simple:
        match = next(
            (r for r in left if r == effect or (effect, r) in NESTED),
            None,
        )
        if match is None:
            return False
        left.remove(match)
    return tuple(rich) != tuple(simple)
