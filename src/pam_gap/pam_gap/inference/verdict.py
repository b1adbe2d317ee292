"""From levels to a verdict: none, named, ambiguous or unknown.

A candidate is judged by its remaining error relative to its rivals, not by whether the error
reaches the noise, because the true effect need not follow the candidate's formula. Levels are those
of `score.Score`, on held-out data. The constants are in `pam_gap.rules.decision_rules`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pam_gap.prediction.fit import Array
from pam_gap.rules.decision_rules import DecisionRules
from pam_model.effects import EFFECTS

SHARP = frozenset(name for name, effect in EFFECTS.items() if effect.search.is_sharp)
"""Effects whose law has only one form, so that a remaining error must have another cause."""


@dataclass(frozen=True, slots=True)
class Figures:
    """The figures on which a verdict is based."""

    effects: tuple[str, ...]  # effects of the best accepted hypothesis
    # level_before, level_after: held-out levels of the re-tuned nominal plant and of the best
    # hypothesis
    level_before: float
    level_after: float
    channels: int  # number of channels
    closed: float  # share of the RMS gap closed on held-out data, mean over the channels with a gap
    # whether an ordinary background is assumed, whose laws are approximate
    has_background: bool = False

    @property
    def is_sharp(self) -> bool:
        """Whether the laws of all effects have only one form, and nothing else should remain.

        A background remains in addition to an effect, whatever the law of the effect.
        """
        return not self.has_background and all(effect in SHARP for effect in self.effects)


def has_gap(level_before: float, channels: int, rules: DecisionRules) -> bool:
    """Whether the re-tuned nominal plant leaves an error to explain."""
    return level_before > rules.no_gap * channels


def accepts_further(
    level_first: float,
    level_second: float,
    level_before: float,
    level_runner_up: float,
    rules: DecisionRules,
) -> bool:
    """Whether one more effect is accepted.

    A first effect whose law differs from the true one leaves a model error, which other effects can
    absorb. A further effect must therefore reduce the level by a fair share of the reduction before
    it, or of the remaining level, or by far more than the next best effect in its place.

    Parameters
    ----------
    level_first : float
        Level without the further effect.
    level_second : float
        Level with it.
    level_before : float
        Level of the re-tuned nominal plant.
    level_runner_up : float
        Level with the next best effect in its place.
    rules : DecisionRules
        Constants.
    """
    gain = level_first - level_second
    return gain > rules.further_gain and (
        gain > rules.further_share * (level_before - level_first)
        or gain > rules.further_rest * level_first
        or gain > rules.further_alone * max(level_first - level_runner_up, 0.0)
    )


def prefers_simple(
    level_simple: float, level_rich: float, level_before: float, rules: DecisionRules
) -> bool:
    """Whether a simpler law of the same effects is kept although a richer one has a lower level."""
    gain = level_simple - level_rich
    return gain < max(rules.simpler_gain, rules.simpler_share * (level_before - level_rich))


def is_rival(
    level_best: float, level: float, level_before: float, tied: bool, rules: DecisionRules
) -> bool:
    """Whether a hypothesis of equal size is tied with the best, or too close to it to decide."""
    behind = level - level_best
    reach = max(rules.rival_gap, rules.rival_share * (level_before - level_best))
    return behind < reach or (tied and behind < rules.rival_tied * reach)


def is_unknown(figures: Figures, rules: DecisionRules) -> bool:
    """Whether the best hypothesis leaves more error than its own law can explain."""
    fall = 1.0 - figures.level_after / figures.level_before
    if figures.is_sharp:
        limit = rules.sharp_left * figures.channels
        return fall < rules.sharp_fall or figures.level_after > limit
    return figures.closed < rules.closed_at_least


def verdict_of(
    figures: Figures, rivals: Sequence[str], rules: DecisionRules, leaves_material: bool = True
) -> str:
    """The verdict.

    Parameters
    ----------
    figures : Figures
        Those of the best accepted hypothesis.
    rivals : sequence of str
        Hypotheses that the data do not distinguish from it.
    rules : DecisionRules
        Constants.
    leaves_material : bool
        Whether the error that it leaves matters. If it does not and most of the gap is explained,
        it does not lead to `unknown`.
    """
    gain = figures.level_before - figures.level_after
    if not has_gap(figures.level_before, figures.channels, rules):
        return "none"
    if not figures.effects or gain < rules.no_gain:
        return "unknown"
    explains_most = figures.closed >= rules.closed_at_least and not leaves_material
    if is_unknown(figures, rules) and not explains_most:
        return "unknown"
    return "ambiguous" if rivals else "named"


def closed_by_channel(before: Array, after: Array, rules: DecisionRules) -> float:
    """Share of the gap closed, mean over channels weighted by the logarithm of their gap.

    Thus neither a channel with low noise nor one with almost no gap outweighs the others.

    Parameters
    ----------
    before, after : ndarray, shape (channels,)
        RMS error over floor.
    rules : DecisionRules
        Constants.
    """
    wide = before > rules.gap_of_channel
    if not wide.any():
        return 1.0
    share = (before - np.maximum(after, 1.0))[wide] / (before - 1.0)[wide]
    return float(np.average(np.maximum(share, 0.0), weights=np.log(before[wide])))
