"""The diagnosis of one joint: search, held-out scores, decision, next experiment."""

from __future__ import annotations

import time
from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import partial
from itertools import chain

import numpy as np

from pam_gap.answer.diagnosis import Diagnosis
from pam_gap.answer.headline import LEAST_SHOWN
from pam_gap.answer.sentences import (
    SizesAtTheEnd,
    effects_at_the_end,
    rivals_at_the_end,
    sizes_at_the_end,
)
from pam_gap.answer.write_answer import AnswerForm, advice, not_identifiable
from pam_gap.experiments.next_experiment import Proposal, propose
from pam_gap.inference.candidates import Candidate, applicable, candidates_for
from pam_gap.inference.clean_rig import clean_explanation, explained
from pam_gap.inference.decide import Verdict, close_calls, decide, judge_of
from pam_gap.inference.decision import Decision, Judge
from pam_gap.inference.discrepancy_model import explained_leftover
from pam_gap.inference.evidence import Evidence
from pam_gap.inference.excitation import not_shown
from pam_gap.inference.held_out import (
    Folds,
    HeldOut,
    block_sums,
    make_folds,
    score_all,
    score_held_out,
)
from pam_gap.inference.hypothesis import FitTask, Hypothesis, HypothesisFitter
from pam_gap.inference.improved_fit import improved_fit
from pam_gap.inference.loose_lengths import LooseLengths, loose_lengths
from pam_gap.inference.probabilities import cut_off_rivals
from pam_gap.inference.search import CandidateSearch, Progress, SearchResult, level, silent
from pam_gap.inference.search_growth import GrowthStep, grows
from pam_gap.inference.unlisted import UnlistedFitter
from pam_gap.inference.verdict import has_gap
from pam_gap.prediction.bench_joint import bench_problem
from pam_gap.prediction.channel_order import BOTH_FORCES, POSITION
from pam_gap.prediction.fit import Array, PlantFit, mean_squares
from pam_gap.prediction.gap_figures import noise_level
from pam_gap.prediction.identifiable import cautions, small_motion, what_is_missing
from pam_gap.prediction.locate import Location, locate
from pam_gap.prediction.materiality import squared_motion
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import LOCKED, SHUT, Recording
from pam_gap.rules import DEFAULT, Rules
from pam_model.rig import Rig

NOT_IMPROVED = (
    "No numbers were found with which the simulation is better than with the rig file as written "
    "on data that were not fitted. There is no improved rig file."
)


class JointDiagnosis:
    """The diagnosis of one joint; `run` performs all steps.

    Parameters
    ----------
    rig : Rig
        The rig as its file describes it.
    joint : int
        Number of the joint.
    recordings : sequence of Recording
        Recordings of this rig.
    rules : Rules
        Hand-set constants.
    threads : int
        Number of simulations that run in parallel.
    progress : callable
        Called with the current task and the completed share.
    with_experiment : bool
        Whether the most informative next experiment is sought; it takes many simulations.
    is_bench : bool
        Whether the joint is the invented one of a muscle on a bench.
    """

    def __init__(
        self,
        rig: Rig,
        joint: int,
        recordings: Sequence[Recording],
        *,
        rules: Rules = DEFAULT,
        threads: int = 1,
        progress: Progress = silent,
        with_experiment: bool = True,
        is_bench: bool = False,
    ) -> None:
        self.rig = rig
        self.with_experiment = with_experiment and not is_bench
        self.rules = rules
        self.joint = joint
        self.progress = progress
        self.progress("preparing the simulation", 0.0)  # compiles it once on a machine
        make = bench_problem if is_bench else partial(PredictionProblem, joint=joint)
        self.problem = make(rig, recordings=recordings, rules=rules, threads=threads)
        self.floor = noise_level(self.problem, self.problem.base.values)
        self.fitter = HypothesisFitter(self.problem, self.floor)
        self.folds: Folds = make_folds(self.problem)
        self.present = self.problem.present
        self.motion = squared_motion(self.problem)
        self.judge = Judge(self.floor, self.present, rules.decision, self.motion)
        self.causes: frozenset[str] = frozenset()
        self.growth: list[tuple[GrowthStep, bool]] = []
        self.whole: JointDiagnosis | None = None
        """The diagnosis of all data, if this is that of their beginning."""
        self.evidence: Evidence[HeldOut] | None = None
        self.answer: HeldOut | None = None
        self.lengths: LooseLengths | None = None

    def written(self) -> HeldOut:
        """Score of the plant as written in the rig file, without any fit."""
        errors = self.problem.errors(self.problem.base.values[None])[0]
        both = self.folds.used
        sums, counts = block_sums(errors, self.folds, both)
        result = PlantFit(np.zeros(0), errors, 0.0, np.zeros((*errors.shape, 0)), 0)
        mean = sums.sum(0) / np.maximum(counts.sum(0), 1.0)
        return HeldOut.of(Hypothesis((), result, mean), sums, counts)

    def candidates(self) -> list[Candidate]:
        """The effects that the recorded channels and motions can show at all."""
        present = self.present
        return [
            candidate
            for candidate in candidates_for(
                self.rig, self.rig.joints[self.joint], self.problem.sides
            )
            if applicable(
                candidate.effect,
                commands=self.problem.has_commands,
                position=bool(present[POSITION]),
                pulls=bool(present[BOTH_FORCES].any()),
                shut=all(d.recording.mounting == SHUT for d in self.problem.data),
                moves=not all(d.recording.mounting == LOCKED for d in self.problem.data),
            )
        ]

    def in_sample(self, hypothesis: Hypothesis) -> HeldOut:
        """Score of a hypothesis on the data to which it was fitted."""
        both = self.folds.used
        sums, counts = block_sums(hypothesis.result.errors, self.folds, both)
        return HeldOut.of(hypothesis, sums, counts)

    def far_beyond(self) -> frozenset[str]:
        """Effects that are causes although their size is ordinary.

        Alone, they remove most of an error that is far beyond what an ordinary background leaves on
        such a rig. They must not be fitted as a background then.
        """
        self.progress("re-tuning nominal parameters", 0.0)
        self.fitter.fit_nominal()
        bare, background = self.fitter.bare, self.fitter.background
        reach = self.rules.decision.ordinary_reach
        usual = (self.floor + self.fitter.whole_background) * reach**2
        if bare is None or background is None or not (bare.mean_square > usual)[self.present].any():
            return frozenset()
        steps, values = self.rules.search.refine_steps, bare.result.values
        fits = self.fitter.fit_all(
            [
                FitTask(
                    (candidate,), np.concatenate([values, start]), steps,
                    cached=bare.result.jacobian, is_bare=True,
                )
                for candidate in self.candidates()
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

    def begun_search(self) -> tuple[CandidateSearch, SearchResult]:
        """Search single effects, and decide whether the recordings show a background."""
        self.causes = self.far_beyond()
        if self.causes:
            self.fitter.without_background()
        search = CandidateSearch(self.fitter, self.candidates(), self.progress)
        result = search.singles()
        if self.without_background(result) is not None:
            self.fitter.without_background()
            result = search.again(result)
        else:
            self.judge.background = self.fitter.discrepancy
        result.singles = tuple(h.effects[0] for h in result.by_size[0])
        return search, result

    def search(self) -> SearchResult:
        """Search single effects, then further effects while they improve the fit enough.

        In a long recording they are sought in its beginning. What leads there is fitted to all
        data, which decide whether one more effect is sought.
        """
        self.progress("re-tuning nominal parameters", 0.0)
        small = self.on_the_beginning()
        search, found = (small or self).begun_search()
        result = self._begun_like(small, found) if small else found
        low, high = 0.4, 0.75
        while self._goes_on(result):
            if small:
                # A longer fit of the base to all data must not be credited to the added effect.
                whole = CandidateSearch(self.fitter, (), self.progress)
                steps = self.rules.search.settled_steps
                result.by_size[-1][:1] = whole.refine(result.by_size[-1][:1], steps)
            search.grow(found, (low, high))
            if small:
                self._follow(found, result)
            low, high = high, 0.85
        if small:  # what a simulation of the beginning takes of a whole one
            share = small.problem.n_rows / self.problem.n_rows
            self.problem.simulations += share * small.problem.simulations
        return result

    def on_the_beginning(self) -> JointDiagnosis | None:
        """The diagnosis of the beginning of all recordings, if that shows what all of them show."""
        rules, problem = self.rules.search, self.problem
        if problem.is_bench:  # every length that is held counts
            return None
        errors = self.fitter.fit_nominal().simulated
        whole = mean_squares(errors, problem.counted)
        longest, seconds = float(problem.row_time.max()), rules.search_time
        while seconds < rules.search_most * longest:
            small = problem.beginning(seconds)
            shown = mean_squares(errors, problem.counted & (problem.row_time < seconds))
            motion = squared_motion(small)
            is_shown = (shown >= rules.search_shows * whole) & (
                motion >= rules.search_shows**2 * self.motion
            )
            if is_shown[self.present].all() and small.n_rows >= rules.search_rows:
                other = copy(self)
                other.whole = self
                other.problem, other.motion = small, motion
                other.fitter = HypothesisFitter(small, self.floor)
                other.folds = make_folds(small)
                other.judge = Judge(self.floor, self.present, self.rules.decision, motion)
                return other
            seconds *= 2.0
        return None

    def is_explained_by(self, clean: Hypothesis) -> bool:
        """Whether what explains the beginning without a background explains all data as well."""
        task = FitTask(
            clean.members, clean.result.values, self.rules.search.clean_steps, is_bare=True
        )
        return explained(self.fitter, task, self._share_of_background) is not None

    def _begun_like(self, small: JointDiagnosis, found: SearchResult) -> SearchResult:
        """The leading single effects of a search in the beginning, fitted to all data."""
        self.causes = small.causes
        if small.fitter.background is None:
            self.fitter.without_background()
        if small.judge.background.any():
            self.judge.background = self.fitter.discrepancy
        result = SearchResult(self.fitter.fit_nominal())
        self._follow(found, result)
        first = (h.effects[0] for h in result.by_size[0])
        result.singles = tuple(dict.fromkeys((*first, *found.singles)))
        return result

    def _follow(self, found: SearchResult, result: SearchResult) -> None:
        """Fit the leading hypotheses of the last size to all data, and order both by these fits."""
        self.progress("leading hypotheses on all data", 0.84)
        leading = self.leading(found)[-1]
        slopes, steps = result.nominal.result.jacobian, self.rules.search.screening_steps
        fits = self.fitter.fit_all(
            [FitTask(h.members, h.result.values, steps, guess=slopes) for h in leading]
        )
        order = sorted(range(len(fits)), key=lambda k: self._left(fits[k]))
        result.by_size.append([fits[k] for k in order])
        found.by_size[-1][: len(order)] = [leading[k] for k in order]

    def without_background(self, result: SearchResult) -> Hypothesis | None:
        """One or two causes that explain the recordings without any background, if there are."""
        whole = self.fitter.whole_background
        if self.fitter.background is None or not (whole[self.present] > 0.0).all():
            return None
        self.progress("one or two effects, no background", 0.36)
        explains_all = self.whole.is_explained_by if self.whole else lambda _: True
        return clean_explanation(
            self.fitter, result.nominal, result.by_size[0], self._share_of_background, explains_all
        )

    def _share_of_background(self, mean_square: Array) -> float:
        """Mean squares over noise as a share of a whole ordinary background."""
        return self.judge.share_of(mean_square, background=self.fitter.whole_background)

    def _left(self, h: Hypothesis) -> float:
        """Level of a hypothesis over noise and background."""
        return level(h.mean_square, self.floor + self.judge.background, self.present)

    def _goes_on(self, result: SearchResult) -> bool:
        """Whether one more effect is sought; the decision is kept as evidence."""
        best = result.by_size[-1][0]
        size = len(result.by_size)
        floor = self.floor + self.judge.background

        left = self._left
        limit = self.rules.decision.material_share**2 * self.motion
        matters = bool((best.mean_square - floor > limit)[self.present].any())
        step = GrowthStep(size, int(self.present.sum()), matters, left(result.nominal), left(best))
        if size > 1:
            previous = left(result.by_size[-2][0])
            others = (left(h) for h in result.by_size[-1] if h.effects != best.effects)
            step = replace(step, previous=previous, runner_up=min(others, default=previous))
        goes_on = grows(step, self.rules.search, self.rules.decision)
        self.growth.append((step, goes_on))
        return goes_on

    def leading(self, result: SearchResult) -> list[list[Hypothesis]]:
        """The best hypotheses of each size, which get a held-out score."""
        rules = self.rules.search
        shares = (rules.finalists_one, rules.finalists_two, rules.finalists_three)
        return [found[: shares[min(size, 2)]] for size, found in enumerate(result.by_size)]

    def settled(self, score: HeldOut) -> HeldOut:
        """Complete the fit of a hypothesis, from the rig file's numbers, and return its score."""
        rules = self.rules.search
        best = score.hypothesis
        for _ in range(rules.restarts):
            start = self.fitter.from_the_rig_file(best.result.values)
            again = self.fitter.fit(
                best.members,
                start,
                guess=best.result.jacobian,
                max_iterations=rules.restart_steps,
                tolerance=rules.restart_tolerance,
            )
            if not again.result.objective < best.result.objective - rules.restart_gain:
                break
            best = again
        if best is score.hypothesis:
            return score
        settled = score_held_out(self.fitter, self.folds, best)
        return settled if self.judge.level(settled) < self.judge.level(score) else score

    def bare_scores(self, hypotheses: Sequence[Hypothesis]) -> list[HeldOut]:
        """Fit and score hypotheses again without any background."""
        steps = self.rules.search.settled_steps
        fits = self.fitter.fit_all([FitTask.further(h, steps, is_bare=True) for h in hypotheses])
        return score_all(self.fitter, self.folds, fits)

    def scores(self, hypotheses: Sequence[Hypothesis]) -> list[HeldOut]:
        """Held-out scores, those without a background on a rig that shows none.

        If hardly any error remains apart from fitted amounts of a background, either these amounts
        are real, or there is no background. Without one, fitted amounts would imitate causes: the
        simulation alone must explain the recording then. It can, if there is no background.
        """
        scores = score_all(self.fitter, self.folds, hypotheses)
        background, least = self.judge.background, self.rules.decision.background_shows
        if not (background[self.present] > 0.0).all():
            return scores
        if self.judge.background_share(scores, background) >= least:
            return scores
        if self.fitter.background is not None:
            bare = self.bare_scores(hypotheses)
            share = self.judge.background_share(bare, self.fitter.whole_background)
            if share >= self.rules.decision.clean_share:
                return scores
            self.fitter.without_background()
            scores = bare
        self.judge.background = np.zeros_like(self.floor)
        return scores

    def unlisted_scores(
        self, scores: Sequence[HeldOut], nominal: Hypothesis, singles: Sequence[Hypothesis]
    ) -> list[HeldOut]:
        """Held-out scores of causes outside the table, where there is a gap to explain."""
        self.judge.set_floor(scores)
        if not has_gap(self.judge.level(scores[0]), int(self.present.sum()), self.rules.decision):
            return []
        self.progress("causes outside the table", 0.9)
        usual = [score for score in scores if score.ordinary]
        best = min(usual, key=self.judge.priced_level, default=scores[0])
        beside = best.hypothesis.only(best.ordinary)
        return UnlistedFitter(self.fitter, self.folds).scores(nominal, singles, beside)

    def not_identifiable(self, missing: Sequence[str]) -> Diagnosis:
        """The answer for recordings that do not hold enough; nothing is searched."""
        base = self.problem.base.values
        location = None
        if self.present.any() and self.problem.counted.any():
            location = locate(self.problem, base, self.problem.errors(base[None])[0])
        return not_identifiable(self.fitter, missing, self.written(), location)

    def proposal(
        self, decision: Decision[HeldOut], survivors: Sequence[Hypothesis]
    ) -> Proposal | None:
        """The next experiment, if the verdict leaves something open."""
        if not self.with_experiment or decision.verdict not in ("ambiguous", "unknown"):
            return None
        self.progress("next experiment", 0.97)
        if decision.verdict == "unknown":  # the hypotheses that come closest
            ranked = sorted(decision.tried, key=self.judge.level)
            survivors = [s.hypothesis for s in ranked[: self.rules.experiment.closest]]
        return propose(self.fitter, survivors)

    def _cautions(
        self,
        verdict: Verdict[HeldOut],
        evidence: Evidence[HeldOut],
        rivals: Sequence[SizesAtTheEnd],
    ) -> tuple[str, ...]:
        """What makes the answer less certain than it looks, in full sentences."""
        found = cautions(self.problem)
        told = verdict.named
        if told is None:
            found += small_motion(self.problem)
        else:
            if evidence.improved is None:
                found += (NOT_IMPROVED,)
            found += sizes_at_the_end(told.hypothesis.at_the_end)
            found += rivals_at_the_end(rivals)
        return found if self.lengths is None else (*found, self.lengths.caution)

    def run(self) -> Diagnosis:
        """Perform the diagnosis."""
        started = time.monotonic()
        missing = what_is_missing(self.problem)
        if missing:
            return self.not_identifiable(missing)
        evidence, location = self.evidence_of(self.search())
        verdict = decide(evidence, self.rules)
        self.judge = verdict.judge
        self.progress("gap figures", 0.96)
        named = verdict.named
        if named is not None:
            improved = improved_fit(
                self.fitter, self.folds, named, self.candidates(), evidence.written
            )
            evidence = replace(evidence, improved=improved, improved_for=named.label)
        self.evidence = evidence
        self.answer = evidence.nominal if named is None else named
        self.lengths = loose_lengths(self.fitter, self.answer.hypothesis)
        diagnosis = AnswerForm(self.fitter, self.folds, evidence, verdict).fill(location)
        proposal = self.proposal(verdict.decision, diagnosis.survivors)
        self.progress("done", 1.0)
        rivals = [
            score.hypothesis.at_the_end
            for score in cut_off_rivals(
                verdict.judge,
                evidence.nominal,
                verdict.decision,
                verdict.probabilities,
                LEAST_SHOWN,
            )
        ]
        return replace(
            diagnosis,
            proposal=proposal,
            next_experiment=advice(diagnosis.verdict, proposal, self.problem),
            facts=self._facts(verdict, evidence.nominal, started),
            cautions=self._cautions(verdict, evidence, rivals),
            at_the_end=effects_at_the_end(rivals),
            not_shown=not_shown(self.problem, self.candidates(), self.floor),
        )

    def evidence_of(self, result: SearchResult) -> tuple[Evidence[HeldOut], Location]:
        """All that the verdict depends on, with completed fits, and where the gap arises."""
        self.progress("held-out scores", 0.86)
        written = self.written()
        nominal, *found = scores = self.scores([result.nominal, *chain(*self.leading(result))])
        unlisted = self.unlisted_scores(scores, result.nominal, result.by_size[0])
        retuned = nominal.hypothesis
        vector = self.fitter.vector((), retuned.result.values)
        location = locate(self.problem, vector, retuned.simulated)
        evidence = Evidence(
            floor=self.floor,
            background=self.judge.background,
            present=self.present,
            motion=self.motion,
            written=written,
            nominal=nominal,
            tried=tuple(score.with_causes(self.causes) for score in found),
            singles=result.singles,
            stages=location.stages,
            growth=tuple(self.growth),
            unlisted=tuple(unlisted),
        )
        self.progress("verdict", 0.93)
        self.judge = judge_of(evidence, self.rules)
        settled = {
            k: self.settled(evidence.tried[k]).with_causes(self.causes)
            for k in close_calls(evidence, self.judge)
        }
        return replace(evidence, settled=settled), location

    def _facts(
        self, verdict: Verdict[HeldOut], nominal: HeldOut, started: float
    ) -> dict[str, float]:
        """Figures about the diagnosis itself, for diagnosis.json."""
        chosen = verdict.decision.chosen
        told = verdict.named or nominal
        facts = {
            "level_before": self.judge.level(nominal),
            "level_after": self.judge.level(told),
        }
        if chosen is not None:
            leftover = explained_leftover(self.problem, self.folds, chosen.hypothesis.result.errors)
            facts["leftover_explained"] = float(leftover[self.present].max())
        return facts | {
            "seconds": time.monotonic() - started,
            "simulations": self.problem.simulations,
        }
