"""The search of a diagnosis: single effects, the background, then one more effect at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pam_gap.inference.candidates import Candidate
from pam_gap.inference.held_out import Folds, HeldOut, block_sums
from pam_gap.inference.hypothesis import FitTask, Hypothesis, HypothesisFitter
from pam_gap.inference.judge import Judge
from pam_gap.inference.score import level
from pam_gap.prediction.fit import Array
from pam_gap.search.candidate_search import (
    CandidateSearch,
    Progress,
    SearchResult,
    silent,
)
from pam_gap.search.clean_rig import clean_explanation
from pam_gap.search.growth import accepts_further, has_gap


def always(explanation: Hypothesis) -> bool:
    """Accept every explanation."""
    return True


class EffectSearch:
    """The search for the effects of one joint.

    Parameters
    ----------
    fitter : HypothesisFitter
        Fits the hypotheses. It fits them without a background once none is found.
    folds : Folds
        Blocks of the data of the fitter's problem.
    judge : Judge
        Judges the gaps. It gets the background that is found.
    candidates : sequence of Candidate
        The effects that may be found.
    progress : callable, optional
        Called with the current task and the completed share.
    confirms : callable, optional
        Whether an explanation without a background counts; every one by default.
    """

    def __init__(
        self,
        fitter: HypothesisFitter,
        folds: Folds,
        judge: Judge,
        candidates: Sequence[Candidate],
        progress: Progress = silent,
        confirms: Callable[[Hypothesis], bool] = always,
    ) -> None:
        self.problem = fitter.problem
        self.rules = fitter.rules
        self.fitter = fitter
        self.folds = folds
        self.judge = judge
        self.candidates = tuple(candidates)
        self.progress = progress
        self.confirms = confirms
        self.singles = CandidateSearch(fitter, candidates, progress)

    def run(self) -> SearchResult:
        """Search single effects, then further effects while they improve the fit enough."""
        result = self.begin()
        shares = (0.4, 0.75)
        while self._goes_on(result):
            self.grow(result, shares)
            shares = (0.75, 0.85)
        return result

    def begin(self) -> SearchResult:
        """Search single effects, and decide whether the recordings show a background."""
        causes = self.far_beyond()
        if causes:
            self.fitter.drop_background()
        result = self.singles.singles()
        if self.clean_explanation(result) is not None:
            self.fitter.drop_background()
            result = self.singles.again(result)
        else:
            self.judge.background = self.fitter.discrepancy
        result.causes = causes
        result.singles = tuple(h.effects[0] for h in result.by_size[0])
        return result

    def grow(self, result: SearchResult, shares: tuple[float, float]) -> None:
        """Add the hypotheses with one more effect."""
        self.singles.grow(result, shares)
        if len(result.by_size) == 2 and self._is_gap(result.by_size[1][0]):
            self.singles.pair_up(result, shares[1])

    def far_beyond(self) -> frozenset[str]:
        """Effects that are causes although their size is ordinary.

        Alone, they remove most of an error that is far beyond what an ordinary background leaves on
        such a rig. They must not be fitted as a background then.
        """
        self.progress("re-tuning nominal parameters", 0.0)
        self.fitter.fit_nominal()
        bare, background = self.fitter.bare, self.fitter.background
        reach, present = self.rules.decision.ordinary_reach, self.problem.present
        usual = (self.fitter.floor + self.fitter.whole_background) * reach**2
        if bare is None or background is None or not (bare.mean_square > usual)[present].any():
            return frozenset()
        steps, values = self.rules.search.refine_steps, bare.result.values
        fits = self.fitter.fit_all(
            [
                FitTask(
                    (candidate,), np.concatenate([values, start]), steps,
                    cached=bare.result.jacobian, is_bare=True,
                )
                for candidate in self.candidates
                if candidate.effect in background.effects
                for start in candidate.starts
            ]
        )  # fmt: skip
        nominal, most = self.in_sample(bare), self.rules.decision.most_of_the_gap
        return frozenset(
            effect
            for one in fits
            if self.judge.share_removed(nominal, self.in_sample(one), usual) >= most
            for effect in one.ordinary
        )

    def in_sample(self, hypothesis: Hypothesis) -> HeldOut:
        """Score of a hypothesis on the data to which it was fitted."""
        sums, counts = block_sums(hypothesis.result.errors, self.folds, self.folds.used)
        return HeldOut.of(hypothesis, sums, counts)

    def clean_explanation(self, result: SearchResult) -> Hypothesis | None:
        """One or two causes that explain the recordings without any background, if there are."""
        whole = self.fitter.whole_background
        if self.fitter.background is None or not (whole[self.problem.present] > 0.0).all():
            return None
        self.progress("one or two effects, no background", 0.36)
        return clean_explanation(
            self.fitter, result.nominal, result.by_size[0], self.share_of_background, self.confirms
        )

    def share_of_background(self, mean_square: Array) -> float:
        """Mean squares over noise as a share of a whole ordinary background."""
        return self.judge.share_of(mean_square, background=self.fitter.whole_background)

    def left(self, h: Hypothesis) -> float:
        """Level of a hypothesis over noise and background."""
        floor = self.fitter.floor + self.judge.background
        return level(h.mean_square, floor, self.problem.present)

    def _is_gap(self, best: Hypothesis) -> bool:
        """Whether what a hypothesis leaves is itself a gap, and matters."""
        floor, present = self.fitter.floor + self.judge.background, self.problem.present
        limit = self.rules.decision.material_share**2 * self.judge.motion
        matters = bool((best.mean_square - floor > limit)[present].any())
        return matters and has_gap(self.left(best), int(present.sum()), self.rules.search)

    def _goes_on(self, result: SearchResult) -> bool:
        """Whether one more effect is sought.

        It is sought while what is left is itself a gap that matters, and the last effect was worth
        looking further.
        """
        rules, left = self.rules, self.left
        size, best = len(result.by_size), result.by_size[-1][0]
        if size >= rules.search.most_effects or not self._is_gap(best):
            return False
        if size == 1:
            return True
        previous = left(result.by_size[-2][0])
        others = (left(h) for h in result.by_size[-1] if h.effects != best.effects)
        runner_up = min(others, default=previous)
        return accepts_further(previous, left(best), left(result.nominal), runner_up, rules.search)
