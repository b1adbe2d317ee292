"""The search in a long recording: effects are sought in its beginning, all data decide."""

from __future__ import annotations

from pam_gap.inference.held_out import make_folds
from pam_gap.inference.hypothesis import FitTask, Hypothesis, HypothesisFitter
from pam_gap.inference.judge import Judge
from pam_gap.prediction.fit import mean_squares
from pam_gap.prediction.materiality import squared_motion
from pam_gap.search.candidate_search import SearchResult
from pam_gap.search.clean_rig import explained
from pam_gap.search.effect_search import EffectSearch


def search_of_the_beginning(whole: EffectSearch) -> EffectSearch | None:
    """The search in the beginning of all recordings, if that shows what all of them show."""
    rules, problem, fitter = whole.rules.search, whole.problem, whole.fitter
    if problem.is_bench:  # every length that is held counts
        return None
    present = problem.present
    errors = fitter.fit_nominal().simulated
    all_of_it = mean_squares(errors, problem.counted)
    longest, seconds = float(problem.row_time.max()), rules.search_time
    while seconds < rules.search_most * longest:
        small = problem.beginning(seconds)
        shown = mean_squares(errors, problem.counted & (problem.row_time < seconds))
        motion = squared_motion(small)
        is_shown = (shown >= rules.search_shows * all_of_it) & (
            motion >= rules.search_shows**2 * whole.judge.motion
        )
        if is_shown[present].all() and small.n_rows >= rules.search_rows:
            return EffectSearch(
                HypothesisFitter(small, fitter.floor),
                make_folds(small),
                Judge(fitter.floor, present, whole.rules, motion),
                whole.candidates,
                whole.progress,
                confirms=lambda clean: _explains(whole, clean),
            )
        seconds *= 2.0
    return None


def _explains(whole: EffectSearch, clean: Hypothesis) -> bool:
    """Whether what explains the beginning without a background explains all data as well."""
    steps = whole.rules.search.clean_steps
    task = FitTask(clean.members, clean.result.values, steps, is_bare=True)
    return explained(whole.fitter, task, whole.share_of_background) is not None


class BeginningFirst(EffectSearch):
    """The search in the beginning, whose leading hypotheses are fitted to all data.

    All data decide whether one more effect is sought.

    Parameters
    ----------
    whole : EffectSearch
        The search in all data.
    small : EffectSearch
        The search in their beginning, from `search_of_the_beginning`.
    """

    def __init__(self, whole: EffectSearch, small: EffectSearch) -> None:
        super().__init__(whole.fitter, whole.folds, whole.judge, whole.candidates, whole.progress)
        self.small = small

    def run(self) -> SearchResult:
        """Search effects, and count a simulation of the beginning as its share of a whole one."""
        result = super().run()
        small = self.small.problem
        self.problem.simulations += small.n_rows / self.problem.n_rows * small.simulations
        return result

    def begin(self) -> SearchResult:
        """The leading single effects of the search in the beginning, fitted to all data."""
        self.found = found = self.small.begin()
        if self.small.fitter.background is None:
            self.fitter.drop_background()
        if self.small.judge.background.any():
            self.judge.background = self.fitter.discrepancy
        result = SearchResult(self.fitter.fit_nominal(), causes=found.causes)
        self._follow(result)
        first = (h.effects[0] for h in result.by_size[0])
        result.singles = tuple(dict.fromkeys((*first, *found.singles)))
        return result

    def grow(self, result: SearchResult, shares: tuple[float, float]) -> None:
        """Seek one more effect in the beginning, and fit the leading hypotheses to all data."""
        # A longer fit of the base to all data must not be credited to the added effect.
        steps = self.rules.search.settled_steps
        result.by_size[-1][:1] = self.singles.refine(result.by_size[-1][:1], steps)
        self.small.grow(self.found, shares)
        self._follow(result)

    def _follow(self, result: SearchResult) -> None:
        """Fit the leading hypotheses of the last size to all data, and order both by these fits."""
        self.progress("leading hypotheses on all data", 0.84)
        found = self.found
        leading = found.leading(self.rules.search)[-1]
        slopes, steps = result.nominal.result.jacobian, self.rules.search.screening_steps
        fits = self.fitter.fit_all(
            [FitTask(h.members, h.result.values, steps, guess=slopes) for h in leading]
        )
        order = sorted(range(len(fits)), key=lambda k: self.left(fits[k]))
        result.by_size.append([fits[k] for k in order])
        found.by_size[-1][: len(order)] = [leading[k] for k in order]
