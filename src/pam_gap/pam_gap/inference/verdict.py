"""From scores to a verdict: none, named, ambiguous, unknown or not identifiable.

A candidate is judged by what it leaves relative to its rivals, never by whether it reaches the
noise: the true effect need not follow the candidate's formula. Levels are sums over channels of
log mean squared error over floor, on held-out data, so that differences of levels are ratios.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pam_gap.prediction.fit import Array
from pam_model.effects import EFFECTS

NO_GAP = 0.35
"""Level per channel up to which a recording is explained by the re-tuned nominal plant."""
NO_GAIN = 0.25
"""Fall of the level below which a first effect may claim no name."""
FURTHER_GAIN = 1.2
"""Fall of the level that a further effect must bring at least."""
FURTHER_SHARE = 0.22
"""And its share of the fall before it: a first effect whose law differs from the true one leaves
something that others can mop up, but a small part."""
FURTHER_REST = 0.5
"""Or its share of what the first effects leave."""
FURTHER_ALONE = 3.0
"""Or how many times it gains what the next best further effect gains: mopping up is what several
can do."""
SIMPLER_GAIN = 1.0
"""Fall of the level that a richer form of the same effect must bring."""
RIVAL_GAP = 0.5
"""Levels closer than this are no decision between two laws that are both approximate."""
RIVAL_SHARE = 0.06
"""Nor is this share of the fall of the level."""
PRICE = 0.05
"""Level that each free number of a hypothesis has to bring when equals are put in order."""
CLOSED_AT_LEAST = 0.60
"""Share of the RMS gap that effects with laws of many forms must close, mean over channels."""
GAP_OF_CHANNEL = 1.5
"""RMS error over floor from which a channel has a gap that can close."""
SHARP_FALL = 0.60
"""Share of the level that effects with laws of one form must take away."""
SHARP = frozenset(name for name, effect in EFFECTS.items() if effect.search.is_sharp)
"""Effects whose law has one form: what they leave unexplained is something else."""
SHARP_LEFT = 3.5
"""Level that a set of sharp effects may leave."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """What a verdict rests on.

    Attributes
    ----------
    effects : tuple of str
        Of the best accepted hypothesis.
    level_before, level_after : float
        Held-out levels of the re-tuned nominal plant and of the best hypothesis.
    channels : int
        Number of channels.
    closed : float
        Share of the RMS gap closed on held-out data, mean over the channels that have one.
    """

    effects: tuple[str, ...]
    level_before: float
    level_after: float
    channels: int
    closed: float


def has_gap(level_before: float, channels: int) -> bool:
    """Whether the re-tuned nominal plant leaves anything to explain."""
    return level_before > NO_GAP * channels


def accepts_further(
    level_first: float, level_second: float, level_before: float, level_runner_up: float
) -> bool:
    """Whether one more effect pays for itself.

    Parameters
    ----------
    level_first : float
        Without it.
    level_second : float
        With it.
    level_before : float
        Of the re-tuned nominal plant.
    level_runner_up : float
        With the next best effect in its place.
    """
    gain = level_first - level_second
    return gain > FURTHER_GAIN and (
        gain > FURTHER_SHARE * (level_before - level_first)
        or gain > FURTHER_REST * level_first
        or gain > FURTHER_ALONE * max(level_first - level_runner_up, 0.0)
    )


def prefers_simple(level_simple: float, level_rich: float, level_before: float) -> bool:
    """Whether a simpler form of the same effects is kept although a richer one leaves less."""
    gain = level_simple - level_rich
    return gain < max(SIMPLER_GAIN, 0.5 * RIVAL_SHARE * (level_before - level_rich))


def is_rival(level_best: float, level: float, level_before: float, tied: bool) -> bool:
    """Whether a hypothesis of equal size is as good as the best: tied, or too close to call."""
    behind = level - level_best
    reach = max(RIVAL_GAP, RIVAL_SHARE * (level_before - level_best))
    return behind < reach or (tied and behind < 2.0 * reach)


def is_unknown(evidence: Evidence) -> bool:
    """Whether the best hypothesis leaves what it had no business to leave."""
    fall = 1.0 - evidence.level_after / evidence.level_before
    if all(effect in SHARP for effect in evidence.effects):
        return fall < SHARP_FALL or evidence.level_after > SHARP_LEFT
    return evidence.closed < CLOSED_AT_LEAST


def decide(evidence: Evidence, rivals: Sequence[str]) -> str:
    """The verdict's word, `rivals` being what the data cannot tell from the best."""
    gain = evidence.level_before - evidence.level_after
    if not has_gap(evidence.level_before, evidence.channels):
        return "none"
    if not evidence.effects or gain < NO_GAIN:
        return "unknown"
    if is_unknown(evidence):
        return "unknown"
    return "ambiguous" if rivals else "named"


def closed_by_channel(before: Array, after: Array) -> float:
    """Share of the gap closed, mean over channels weighted by the logarithm of their gap.

    So no channel outweighs others by its low noise, nor one with hardly a gap those with one.

    Parameters
    ----------
    before, after : ndarray, shape (channels,)
        RMS error over floor.
    """
    wide = before > GAP_OF_CHANNEL
    if not wide.any():
        return 1.0
    share = (before - np.maximum(after, 1.0))[wide] / (before - 1.0)[wide]
    return float(np.average(np.maximum(share, 0.0), weights=np.log(before[wide])))
