"""The decision from held-out scores: the accepted hypothesis, its rivals, and the verdict.

Everything here depends only on scores and rules, so that a diagnosis can be decided again with
other rules from the scores that it kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np

from pam_gap.inference.score import Score
from pam_gap.inference.selection import bootstrap_weights, confidence_set, contains
from pam_gap.inference.verdict import (
    Evidence,
    accepts_further,
    closed_by_channel,
    decide,
    has_gap,
    is_rival,
    prefers_simple,
)
from pam_gap.prediction.fit import Array
from pam_gap.rules.decision_rules import DecisionRules


@dataclass(frozen=True, slots=True)
class Decision[S: Score]:
    """The result of a decision.

    Attributes
    ----------
    verdict : str
        none, named, ambiguous or unknown.
    chosen : Score or None
        The accepted hypothesis.
    rivals : tuple of Score
        Hypotheses that the data do not distinguish from it.
    tried : tuple of Score
        All final scores.
    """

    verdict: str
    chosen: S | None
    rivals: tuple[S, ...]
    tried: tuple[S, ...]

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

    def set_floor(self, scores: Sequence[Score]) -> None:
        """Set the floor against which hypotheses are judged, from the scores of all of them.

        An ordinary background is assumed up to what the best hypothesis leaves above the noise,
        with some margin. Hypotheses with effects of ordinary size do not count, because these
        belong to the background themselves. A background acts on all channels together, so that
        one share of it, the geometric mean over the channels, holds for all. A rig that some
        hypothesis explains down to the noise thus has no background, and is judged against the
        noise alone.
        """
        usual = self.background[self.present]
        self.floor = self.noise
        if not (usual > 0.0).all():
            return
        plain = [score for score in scores if not score.ordinary]
        best = min(plain, key=lambda score: score.level(self.noise, self.present))
        left = np.maximum((best.mean_square - self.noise)[self.present], 1e-9 * usual)
        share = self.rules.background_reach * float(np.exp(np.mean(np.log(left / usual))))
        self.floor = self.noise + min(share, 1.0) * self.background

    def far_beyond(self, nominal: Score, tried: Sequence[Score]) -> frozenset[str]:
        """Effects that are causes although their size is ordinary.

        Alone, they remove most of an error that is far beyond what an ordinary background leaves.
        """
        usual = (self.noise + self.background) * self.rules.ordinary_reach**2
        if not (nominal.mean_square > usual)[self.present].any():
            return frozenset()
        return frozenset(
            effect
            for score in tried
            if len(score.effects) == 1
            and self._mean_share(nominal, score, usual) >= self.rules.most_of_the_gap
            for effect in score.ordinary
        )

    def level(self, score: Score) -> float:
        """Level of a held-out score."""
        return score.level(self.floor, self.present)

    @property
    def ranking_floor(self) -> Array:
        """Floor by which hypotheses with equally many causes are compared.

        It contains only a part of the background, because hypotheses that all leave less than an
        ordinary background can still differ clearly.
        """
        return self.noise + self.rules.ranking_share * (self.floor - self.noise)

    def rank(self, score: Score) -> float:
        """Level of a held-out score over the floor by which hypotheses are compared."""
        return score.level(self.ranking_floor, self.present)

    def priced_rank(self, score: Score) -> float:
        """Rank plus a penalty per free parameter, which prefers the simpler of two equal laws."""
        return self.rank(score) + self.rules.price * score.free_numbers

    def ordinary_share(self, nominal: Score, tried: Sequence[Score]) -> float:
        """Share of a gap that matters which effects of ordinary size remove; 1 without such a gap.

        A background is a little of everything. Where its usual effects at their ordinary sizes
        remove nothing of a gap, its small size alone is no reason to take it for a background.
        """
        level = nominal.level(self.noise, self.present)
        if not has_gap(level, int(self.present.sum()), self.rules) or not self.is_material(
            nominal, unexplained=True, floor=self.noise
        ):
            return 1.0
        usual = [score for score in tried if not score.causes]
        return max((self._mean_share(nominal, score, self.noise) for score in usual), default=0.0)

    def usual[S: Score](self, nominal: Score, tried: Sequence[S]) -> Score:
        """Score of the best hypothesis without causes: re-tuned, with effects of ordinary size."""
        scores: list[Score] = [nominal, *(s for s in tried if not s.causes)]
        return min(scores, key=self.rank)

    def _mean_share(self, first: Score, second: Score, floor: Array) -> float:
        """Share of the RMS error above the noise that the second of two scores removes.

        It is the mean over the channels in which the first one exceeds `floor`, weighted by the
        logarithm of how far; 1 if it exceeds it in none.
        """
        weight = np.log(np.maximum(first.over_floor(floor, self.present), 1.0))
        if not weight.any():
            return 1.0
        before = first.over_floor(self.noise, self.present)
        after = second.over_floor(self.noise, self.present)
        share = np.maximum(before - np.maximum(after, 1.0), 0.0) / np.maximum(before - 1.0, 1e-9)
        return float(np.average(share, weights=weight))

    def explains_alone(self, nominal: Score, chosen: Score) -> bool:
        """Whether a hypothesis also passes where sensor noise alone is assumed."""
        before, after = (s.over_floor(self.noise, self.present) for s in (nominal, chosen))
        evidence = Evidence(
            chosen.causes,
            nominal.level(self.noise, self.present),
            chosen.level(self.noise, self.present),
            int(self.present.sum()),
            closed_by_channel(before, after, self.rules),
        )
        left = self.is_material(chosen, unexplained=True, floor=self.noise)
        return decide(evidence, (), self.rules, left) != "unknown"

    def share_beside(self, chosen: Score, tried: Sequence[Score]) -> float:
        """Share of what causes leave above the noise that effects of ordinary size remove.

        On a rig with a background they remove a part of it. What the wrong cause leaves on a rig
        without one, they do not. It is 1 if the causes were not scored alone.
        """
        same = [s for s in tried if set(s.causes) == set(chosen.causes)]
        alone = [s for s in same if not s.ordinary]
        if not alone:
            return 1.0
        first = min(alone, key=self.rank)
        shares = (self._mean_share(first, s, self.noise) for s in same if s.ordinary)
        return max(shares, default=0.0)

    def share_removed(self, usual: Score, chosen: Score) -> float:
        """Share of the RMS error above the noise that the causes of a hypothesis remove.

        It is the mean over the channels in which an ordinary rig would leave less, weighted by how
        far the error stands out. The background is no part of the floor here: a cause must remove
        most of the error, and not merely as much of it as stands out.

        Parameters
        ----------
        usual : Score
            Score of the rig without causes.
        chosen : Score
            Score of the hypothesis.
        """
        return self._mean_share(usual, chosen, self.floor)

    def choose[S: Score](self, nominal: Score, scores: Sequence[S]) -> S | None:
        """The accepted hypothesis: the one with the fewest causes that no other clearly beats."""
        before = self.level(nominal)
        usual = [s for s in scores if s.size == 0]
        accepted: S | None = min(usual, key=self.rank, default=None)
        for size in count(1):
            rivals = [s for s in scores if s.size == size]
            if not rivals:
                break
            best = min(rivals, key=self.priced_rank)
            for simple in sorted(rivals, key=self.rank):
                if contains(best.effects, simple.effects) and prefers_simple(
                    self.rank(simple), self.rank(best), self.rank(nominal), self.rules
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
        return min(alike, key=self.rank, default=accepted)

    def rivals[S: Score](self, chosen: S, scores: Sequence[S], nominal: Score) -> list[S]:
        """Hypotheses with as many causes that the data do not distinguish from the chosen one.

        A rival must achieve a fair share of the improvement by the chosen one's last cause. A
        richer law that contains the chosen one is a rival if its level is slightly lower.
        Hypotheses that differ only in effects of ordinary size are the same answer.
        """
        level = self.rank(chosen)
        smaller: list[Score] = [nominal, *(s for s in scores if s.size < chosen.size)]
        part = self.rules.rival_part
        limit = part * level + (1.0 - part) * min(self.rank(s) for s in smaller)
        alike: dict[tuple[str, ...], S] = {}
        for s in sorted(scores, key=self.rank):
            if (
                s.size == chosen.size > 0
                and self.rank(s) < limit
                and set(s.causes) != set(chosen.causes)
                and (
                    not contains(s.causes, chosen.causes)
                    or level - self.rank(s) > self.rules.no_gain
                )
            ):
                alike.setdefault(tuple(sorted(s.causes)), s)
        others = list(alike.values())
        floor = self.ranking_floor
        inside = confidence_set([chosen, *others], floor, self.present, self.rules)[1:]
        before = self.rank(nominal)
        return [
            s
            for s, tied in zip(others, inside, strict=True)
            if is_rival(level, self.rank(s), before, tied, self.rules)
        ]

    def decide[S: Score](
        self, nominal: Score, tried: Sequence[S], settle: Callable[[S], S]
    ) -> Decision[S]:
        """Choose a hypothesis, complete the fits of close ones, choose again, and give the verdict.

        Parameters
        ----------
        nominal : Score
            Score of the re-tuned plant without effects.
        tried : sequence of Score
            Scores of the hypotheses.
        settle : callable
            Completes the fit of a hypothesis and returns its score.
        """
        self.set_floor([nominal, *tried])
        chosen = self.choose(nominal, tried)
        if chosen is not None:
            close = [chosen, *self.rivals(chosen, tried, nominal)]
            others = [score for score in tried if not any(score is one for one in close)]
            tried = [*map(settle, close), *others]
            self.set_floor([nominal, *tried])
            chosen = self.choose(nominal, tried)
        before = self.level(nominal)
        channels = int(self.present.sum())
        usual = self.usual(nominal, tried)
        matters = has_gap(self.level(usual), channels, self.rules) and self.is_material(nominal)
        if chosen is None or not matters:
            strange = self.ordinary_share(nominal, tried) < self.rules.ordinary_explains
            verdict = "unknown" if strange and chosen is not None else "none"
            return Decision(verdict, chosen, (), tuple(tried))
        over_floor = nominal.over_floor(self.floor, self.present)
        closed = closed_by_channel(
            over_floor, chosen.over_floor(self.floor, self.present), self.rules
        )
        if not (over_floor > self.rules.gap_of_channel).any():
            closed = 1.0 - self.level(chosen) / before  # no channel has a gap wide enough to count
        evidence = Evidence(chosen.causes, before, self.level(chosen), channels, closed)
        rivals = self.rivals(chosen, tried, nominal)
        left = self.is_material(chosen, unexplained=True)
        verdict = decide(evidence, [r.label for r in rivals], self.rules, left)
        if verdict != "unknown" and (
            self.share_removed(usual, chosen) < self.rules.most_of_the_gap
            or not (
                self.explains_alone(nominal, chosen)
                or self.share_beside(chosen, tried) >= self.rules.ordinary_beside
            )
        ):
            verdict = "unknown"
        if verdict == "unknown" and not self.is_material(nominal, unexplained=True):
            verdict = "none"
        return Decision(verdict, chosen, tuple(rivals), tuple(tried))

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
