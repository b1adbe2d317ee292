"""Which hypotheses the held-out data do not distinguish, and the weight of each.

Losses of score blocks are compared by the Model Confidence Set with a block bootstrap over time;
the weight of a hypothesis is the share of bootstrap samples in which it has the lowest level. A
hypothesis that contains a simpler one must be clearly better.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pam_gap.inference.model_confidence_set import circular_blocks, mcs_p_values
from pam_gap.inference.score import Score, levels
from pam_gap.prediction.fit import Array
from pam_gap.rules.decision_rules import DecisionRules
from pam_model.effects import EFFECTS

NESTED = {
    (effect.search.richer.than, effect.name)
    for effect in EFFECTS.values()
    if effect.search.richer is not None
}
"""Pairs (simple, rich): for some parameter values, the rich law equals the simple one."""


def resampled_blocks(
    n_blocks: int, generator: np.random.Generator, rules: DecisionRules
) -> np.ndarray:
    """Indices of one circular block bootstrap sample of the score blocks."""
    length = max(1, min(rules.bootstrap_blocks, n_blocks // 4))
    return circular_blocks(n_blocks, length, generator)


def bootstrap_weights(
    scores: Sequence[Score],
    floor: Array,
    present: np.ndarray,
    rules: DecisionRules,
) -> Array:
    """Share of bootstrap samples in which each hypothesis has the lowest level; the sum is 1."""
    generator = np.random.default_rng(0)
    sums = np.array([s.sums for s in scores])
    counts = np.array([s.counts for s in scores])
    wins = np.zeros(len(scores))
    for _ in range(rules.bootstraps):
        at = resampled_blocks(sums.shape[1], generator, rules)
        value = levels(sums[:, at].sum(axis=1), counts[:, at].sum(axis=1), floor, present)
        # Hypotheses with equal levels, except for rounding, share the sample.
        best = value <= value.min() + rules.equal_level
        wins += best / best.sum()
    return wins / rules.bootstraps


def confidence_set(
    scores: Sequence[Score], floor: Array, present: np.ndarray, rules: DecisionRules
) -> list[bool]:
    """Whether each hypothesis belongs to the Model Confidence Set.

    The loss of a block is the sum over channels of its mean square over that of the best
    hypothesis in the channel (never below the floor), so that channels weigh alike.
    """
    if len(scores) < 2:
        return [True] * len(scores)
    overall = np.array([s.level(floor, present) for s in scores])
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
    if len(losses) < rules.fewest_blocks:
        return [bool(value <= overall.min() + rules.rival_gap) for value in overall]
    p_values = mcs_p_values(
        losses,
        block_length=max(2, min(rules.bootstrap_blocks, len(losses) // 4)),
        draws=rules.bootstraps,
    )
    return [bool(p > rules.confidence_size) for p in p_values]


def contains(rich: Sequence[str], simple: Sequence[str]) -> bool:
    """Whether the effects `rich` include those of `simple`, or richer laws that contain them."""
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
