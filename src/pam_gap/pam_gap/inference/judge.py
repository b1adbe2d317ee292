"""Levels of hypotheses over noise and an ordinary background, and whether an error matters.

The search asks here how far it has come, and the answer what matters. Which causes are named
follows from `pam_gap.inference.posterior`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pam_gap.inference.evidence import Evidence
from pam_gap.inference.score import Score
from pam_gap.prediction.fit import Array
from pam_gap.rules import Rules


class Judge:
    """Measures hypotheses with one set of rules.

    Parameters
    ----------
    noise : ndarray, shape (channels,)
        Mean squared error due to noise alone.
    present : ndarray of bool, shape (channels,)
        Channels that are judged.
    rules : Rules
        Constants.
    motion : ndarray, shape (channels,), optional
        Squared range of each channel in units of its whitened errors; without it, every gap above
        the noise matters.
    background : ndarray, shape (channels,), optional
        Mean squared error that an ordinary background can leave, from `background.discrepancy`;
        none by default. It may be set later.
    """

    def __init__(
        self,
        noise: Array,
        present: np.ndarray,
        rules: Rules,
        motion: Array | None = None,
        background: Array | None = None,
    ) -> None:
        self.noise = noise
        self.background: Array = np.zeros_like(noise) if background is None else background
        self.floor = noise
        self.present = present
        self.rules = rules
        self.motion = np.zeros_like(noise) if motion is None else motion

    def is_material(self, score: Score, *, unexplained: bool = False) -> bool:
        """Whether a score leaves an error that matters in any channel, by its share of the motion.

        Parameters
        ----------
        score : Score
            Score of a hypothesis. The floor is subtracted, since noise is no gap.
        unexplained : bool
            Whether the error is one that no effect explains, for which the limit is larger.
        """
        share = self.rules.decision.material_share
        if unexplained:
            share *= self.rules.decision.unexplained_factor
        limit = share**2 * self.motion
        return bool((score.mean_square - self.floor > limit)[self.present].any())

    def background_share(self, scores: Sequence[Score], background: Array) -> float:
        """Share of a background that counts, from what the best hypothesis leaves of it.

        A background acts on all channels together, so that one share of it, the mean over the
        channels, holds for all; a margin is added. A channel whose background hardly stands out of
        its noise is then no proof of the others. Hypotheses with effects of ordinary size do not
        count, because these belong to the background themselves.

        Parameters
        ----------
        scores : sequence of Score
            Scores of all hypotheses.
        background : ndarray, shape (channels,)
            Mean squared error that an ordinary background can leave, above 0 where present.
        """
        plain = [score for score in scores if not score.ordinary]
        best = min(plain, key=lambda score: score.level(self.noise, self.present))
        return self.share_of(best.mean_square, background)

    def share_of(self, mean_square: Array, background: Array) -> float:
        """The same for the mean squares that one hypothesis leaves, shape (channels,)."""
        usual = background[self.present]
        left = np.maximum((mean_square - self.noise)[self.present], 0.0)
        return self.rules.decision.background_reach * float(np.mean(left / usual))

    def set_floor(self, scores: Sequence[Score]) -> None:
        """Set the floor against which hypotheses are judged, from the scores of all of them.

        An ordinary background is assumed up to what the best hypothesis leaves above the noise,
        with some margin.
        """
        self.floor = self.noise
        if (self.background[self.present] > 0.0).all():
            share = self.background_share(scores, self.background)
            self.floor = self.noise + min(share, 1.0) * self.background

    @property
    def has_background(self) -> bool:
        """Whether an ordinary background is assumed; `set_floor` decides it."""
        return bool((self.floor > self.noise)[self.present].any())

    def level(self, score: Score) -> float:
        """Level of a held-out score."""
        return score.level(self.floor, self.present)

    def priced_level(self, score: Score) -> float:
        """Level plus a penalty per free parameter, which prefers the simpler of two equal laws."""
        return self.level(score) + self.rules.search.price * score.free_numbers

    def usual[S: Score](self, nominal: Score, tried: Sequence[S]) -> Score:
        """Score of the best hypothesis without causes: re-tuned, with effects of ordinary size."""
        scores: list[Score] = [nominal, *(s for s in tried if not s.causes)]
        return min(scores, key=self.level)

    def share_removed(self, usual: Score, chosen: Score, floor: Array | None = None) -> float:
        """Share of the RMS error above the noise that the causes of a hypothesis remove.

        It is the mean over the channels in which the rig without causes stands out of the floor,
        weighted by the logarithm of how far; 1 if it does in none. The background is no part of
        the error here: a cause must remove most of it, and not merely as much as stands out.

        Parameters
        ----------
        usual : Score
            Score of the rig without causes.
        chosen : Score
            Score of the hypothesis.
        floor : ndarray, shape (channels,), optional
            Floor out of which a channel must stand to count; that of the judge by default.
        """
        limit = self.floor if floor is None else floor
        weight = np.log(np.maximum(usual.over_floor(limit, self.present), 1.0))
        if not weight.any():
            return 1.0
        before = usual.over_floor(self.noise, self.present)
        after = np.maximum(chosen.over_floor(self.noise, self.present), 1.0)
        share = np.maximum(before - after, 0.0) / np.maximum(before - 1.0, 1e-9)
        return float(np.average(share, weights=weight))


def judge_of(evidence: Evidence[Any], rules: Rules) -> Judge:
    """The judge of the hypotheses of this evidence, with its floor."""
    judge = Judge(evidence.floor, evidence.present, rules, evidence.motion, evidence.background)
    judge.set_floor([evidence.nominal, *evidence.tried, *evidence.unlisted])
    return judge
