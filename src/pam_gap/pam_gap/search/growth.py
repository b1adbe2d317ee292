"""Whether the search seeks one more effect, from levels alone."""

from __future__ import annotations

from pam_gap.rules.search_rules import SearchRules


def has_gap(level: float, channels: int, rules: SearchRules) -> bool:
    """Whether a hypothesis leaves an error in which more is worth looking for."""
    return level > rules.no_gap * channels


def accepts_further(
    level_first: float,
    level_second: float,
    level_before: float,
    level_runner_up: float,
    rules: SearchRules,
) -> bool:
    """Whether the last effect was worth looking for one more.

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
    rules : SearchRules
        Constants.
    """
    gain = level_first - level_second
    return gain > rules.further_gain and (
        gain > rules.further_share * (level_before - level_first)
        or gain > rules.further_rest * level_first
        or gain > rules.further_alone * max(level_first - level_runner_up, 0.0)
    )
