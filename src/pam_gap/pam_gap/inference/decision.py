"""The decision from held-out scores: the accepted hypothesis, its rivals, and the verdict.

Everything here depends only on scores and rules, so that a diagnosis can be decided again with
other rules from the scores that it kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np

from pam_gap.inference.score import Score
from pam_gap.inference.selection import bootstrap_weights, confidence_set, contains
from pam_gap.inference.verdict import (
    Figures,
    accepts_further,
    closed_by_channel,
    has_gap,
    is_rival,
    prefers_simple,
    verdict_of,
)
from pam_gap.prediction.fit import Array
from pam_gap.rules.decision_rules import DecisionRules


@dataclass(frozen=True, slots=True)
class Decision[S: Score]:
    """The result of a decision."""

    verdict: str  # none, named, ambiguous or unknown
    chosen: S | None  # the accepted hypothesis
    rivals: tuple[S, ...]  # hypotheses that the data do not distinguish from it
    tried: tuple[S, ...]  # all final scores
    unlisted: tuple[S, ...] = ()  # scores of causes outside the table of effects
    # the one of them that explains the recording better than the accepted hypothesis, if there is
    # one; the verdict is unknown then
    better: S | None = None

    @property
    def is_named(self) -> bool:
        """Whether the verdict names effects."""
        return self.verdict in ("named", "ambiguous")


class Judge:
    """Takes decisions with one set of rules.

    Parameters
    ----------
    noise : ndarray, shape (channels,)
        Mean squared error due to noise alone.
    present : ndarray of bool, shape (channels,)
        Channels that are judged.
    rules : DecisionRules
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
        rules: DecisionRules,
        motion: Array | None = None,
        background: Array | None = None,
    ) -> None:
        self.noise = noise
        self.background: Array = np.zeros_like(noise) if background is None else background
        self.floor = noise
        self.present = present
        self.rules = rules
        self.motion = np.zeros_like(noise) if motion is None else motion

    def is_material(
        self, score: Score, *, unexplained: bool = False, floor: Array | None = None
    ) -> bool:
        """Whether a score leaves an error that matters in any channel, by its share of the motion.

        Parameters
        ----------
        score : Score
            Score of a hypothesis. The floor is subtracted, since noise is no gap.
        unexplained : bool
            Whether the error is one that no effect explains, for which the limit is larger.
        floor : ndarray, shape (channels,), optional
            Mean squared error that is no gap; that of the decision by default.
        """
        share = self.rules.material_share
        if unexplained:
            share *= self.rules.unexplained_factor
        limit = share**2 * self.motion
        usual = self.floor if floor is None else floor
        return bool((score.mean_square - usual > limit)[self.present].any())

    def background_share(self, scores: Sequence[Score], background: Array) -> float:
        """Share of a background that counts, from what the best hypothesis leaves of it.

        A background acts on all channels together, so that one share of it, the geometric mean
        over the channels, holds for all; a margin is added. Hypotheses with effects of ordinary
        size do not count, because these belong to the background themselves.

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
        left = np.maximum((mean_square - self.noise)[self.present], 1e-9 * usual)
        return self.rules.background_reach * float(np.exp(np.mean(np.log(left / usual))))

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
        return self.level(score) + self.rules.price * score.free_numbers

    def energy(self, score: Score) -> float:
        """Priced level plus the fall that every cause must achieve in addition to others."""
        causes = 1 if score.unlisted else score.size
        return self.priced_level(score) + self.rules.further_gain * (causes - 1)

    def better_unlisted[S: Score](
        self, usual: Score, chosen: Score, unlisted: Sequence[S]
    ) -> S | None:
        """The cause outside the table that explains more than a hypothesis; None without any.

        As a cause of the table must, it removes most of the error of the rig without causes. It has
        to be distinguishable from an effect of the table that needs no more free numbers: over a
        part of the range, for example, an eccentric encoder of the right phase is an offset.
        """
        best = min(unlisted, key=self.energy, default=None)
        if best is None or self.energy(best) >= self.energy(chosen):
            return None
        if chosen.size == 1 and chosen.free_numbers <= best.free_numbers:
            tied = all(confidence_set([chosen, best], self.floor, self.present, self.rules))
            level = self.level(best)
            if is_rival(level, self.level(chosen), self.level(usual), tied, self.rules):
                return None
        return best if self.share_removed(usual, best) >= self.rules.most_of_the_gap else None

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
            Floor out of which a channel must stand to count; that of the decision by default.
        """
        limit = self.floor if floor is None else floor
        weight = np.log(np.maximum(usual.over_floor(limit, self.present), 1.0))
        if not weight.any():
            return 1.0
        before = usual.over_floor(self.noise, self.present)
        after = np.maximum(chosen.over_floor(self.noise, self.present), 1.0)
        share = np.maximum(before - after, 0.0) / np.maximum(before - 1.0, 1e-9)
        return float(np.average(share, weights=weight))

    def figures(self, nominal: Score, chosen: Score) -> Figures:
        """The figures on which the verdict about a hypothesis is based."""
        before, after = self.level(nominal), self.level(chosen)
        over_floor = nominal.over_floor(self.floor, self.present)
        closed = closed_by_channel(
            over_floor, chosen.over_floor(self.floor, self.present), self.rules
        )
        if not (over_floor > self.rules.gap_of_channel).any():
            closed = 1.0 - after / max(before, 1e-9)  # no gap of a channel is wide enough to count
        return Figures(
            chosen.causes, before, after, int(self.present.sum()), closed, self.has_background
        )

    def choose[S: Score](self, nominal: Score, scores: Sequence[S]) -> S | None:
        """The accepted hypothesis: the one with the fewest causes that no other clearly beats."""
        before = self.level(nominal)
        usual = [s for s in scores if s.size == 0]
        accepted: S | None = min(usual, key=self.level, default=None)
        for size in count(1):
            rivals = [s for s in scores if s.size == size]
            if not rivals:
                break
            best = min(rivals, key=self.priced_level)
            for simple in sorted(rivals, key=self.level):
                if contains(best.effects, simple.effects) and prefers_simple(
                    self.level(simple), self.level(best), self.level(nominal), self.rules
                ):
                    best = simple
                    break
            if accepted is not None and accepted.causes:
                first = self.level(accepted)
                others = [s for s in rivals if set(s.causes) != set(best.causes)]
                runner_up = min((self.level(s) for s in others), default=first)
                if not accepts_further(first, self.level(best), before, runner_up, self.rules):
                    break
            accepted = best
        return None if accepted is None else self._without_causes(accepted, usual)

    def _without_causes[S: Score](self, accepted: S, usual: Sequence[S]) -> S:
        """The best hypothesis of ordinary effects alone, if the accepted one is hardly better."""
        limit = self.level(accepted) + self.rules.rival_gap
        alike = [s for s in usual if self.level(s) < limit]
        return min(alike, key=self.level, default=accepted)

    def rivals[S: Score](self, chosen: S, scores: Sequence[S], nominal: Score) -> list[S]:
        """Hypotheses with as many causes that the data do not distinguish from the chosen one.

        A rival must achieve a fair share of the improvement by the chosen one's last cause. A
        richer law that contains the chosen one is a rival if its level is slightly lower.
        Hypotheses that differ only in effects of ordinary size are the same answer.
        """
        level = self.level(chosen)
        smaller: list[Score] = [nominal, *(s for s in scores if s.size < chosen.size)]
        part = self.rules.rival_part
        limit = part * level + (1.0 - part) * min(self.level(s) for s in smaller)
        alike: dict[tuple[str, ...], S] = {}
        for s in sorted(scores, key=self.level):
            if (
                s.size == chosen.size > 0
                and self.level(s) < limit
                and set(s.causes) != set(chosen.causes)
                and (
                    not contains(s.causes, chosen.causes)
                    or level - self.level(s) > self.rules.no_gain
                )
            ):
                alike.setdefault(tuple(sorted(s.causes)), s)
        others = list(alike.values())
        floor = self.floor
        inside = confidence_set([chosen, *others], floor, self.present, self.rules)[1:]
        before = self.level(nominal)
        return [
            s
            for s, tied in zip(others, inside, strict=True)
            if is_rival(level, self.level(s), before, tied, self.rules)
        ]

    def close_calls[S: Score](
        self, nominal: Score, tried: Sequence[S], unlisted: Sequence[S] = ()
    ) -> list[S]:
        """The hypothesis that would be accepted and its rivals; none without a hypothesis.

        The floor is set for the hypotheses as they are.
        """
        self.set_floor([nominal, *tried, *unlisted])
        chosen = self.choose(nominal, tried)
        return [] if chosen is None else [chosen, *self.rivals(chosen, tried, nominal)]

    def decide[S: Score](
        self, nominal: Score, tried: Sequence[S], unlisted: Sequence[S] = ()
    ) -> Decision[S]:
        """Choose a hypothesis and give the verdict about it."""
        self.set_floor([nominal, *tried, *unlisted])
        return self.about(nominal, tried, self.choose(nominal, tried), unlisted)

    def about[S: Score](
        self, nominal: Score, tried: Sequence[S], chosen: S | None, unlisted: Sequence[S] = ()
    ) -> Decision[S]:
        """The verdict about a chosen hypothesis; the floor must be set."""
        channels = int(self.present.sum())
        usual = self.usual(nominal, tried)
        matters = has_gap(self.level(usual), channels, self.rules) and self.is_material(nominal)
        if chosen is None or not matters:
            return Decision("none", chosen, (), tuple(tried), tuple(unlisted))
        figures = self.figures(nominal, chosen)
        rivals = self.rivals(chosen, tried, nominal)
        left = self.is_material(chosen, unexplained=True)
        verdict = verdict_of(figures, [r.label for r in rivals], self.rules, left)
        if self.share_removed(usual, chosen) < self.rules.most_of_the_gap:
            verdict = "unknown"
        better = self.better_unlisted(usual, chosen, unlisted)
        if better is not None:
            verdict = "unknown"
        small = not self.is_material(nominal, unexplained=True)
        if self.has_background and better is None:
            small = small or self.level(usual) <= self.rules.no_gap_unexplained * channels
        if verdict == "unknown" and small:
            verdict = "none"
        return Decision(verdict, chosen, tuple(rivals), tuple(tried), tuple(unlisted), better)

    def weights[S: Score](
        self, decision: Decision[S], singles: Sequence[str]
    ) -> tuple[tuple[str, float], ...]:
        """Every candidate with its weight: bootstrap shares of hypotheses of the accepted size.

        Parameters
        ----------
        decision : Decision
            The decision; effects that it names come first.
        singles : sequence of str
            All effects, in the order of their levels as single effects.
        """
        chosen = decision.chosen if decision.is_named else None
        size = chosen.size if chosen is not None else 1
        same = [s for s in decision.tried if s.size == size]
        weight: dict[str, float] = {}
        if same:
            shares = bootstrap_weights(same, self.floor, self.present, self.rules)
            for score, share in zip(same, shares, strict=True):
                for effect in score.causes:
                    weight[effect] = weight.get(effect, 0.0) + float(share)
        first = strongest_first(chosen.causes, singles) if chosen is not None else ()
        for effect in singles:
            weight.setdefault(effect, 0.0)
        order = list(singles)
        names = sorted(
            weight, key=lambda e: (e not in first, first.index(e) if e in first else 0,
                                   -weight[e], order.index(e))
        )  # fmt: skip
        return tuple((name, min(weight[name], 1.0)) for name in names)


def strongest_first(effects: Sequence[str], singles: Sequence[str]) -> tuple[str, ...]:
    """Effects in the order of their levels as single effects."""
    return tuple(sorted(dict.fromkeys(effects), key=list(singles).index))
