"""The diagnosis of one joint: search, held-out scores, decision, next experiment."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Final

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
from pam_gap.inference.candidates import Candidate, shown_candidates
from pam_gap.inference.decide import (
    Verdict,
    close_calls,
    cut_off_rivals,
    decide,
)
from pam_gap.inference.discrepancy_model import share_of_a_flexible_law
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
from pam_gap.inference.judge import Judge, judge_of
from pam_gap.inference.loose_lengths import LooseLengths, loose_lengths
from pam_gap.inference.probabilities import NONE, UNKNOWN
from pam_gap.inference.unlisted import UnlistedFitter
from pam_gap.prediction.bench_joint import bench_problem
from pam_gap.prediction.fit import PlantFit
from pam_gap.prediction.gap_figures import noise_level
from pam_gap.prediction.identifiable import cautions, small_motion, what_is_missing
from pam_gap.prediction.locate import Location, locate
from pam_gap.prediction.materiality import squared_motion
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import Recording
from pam_gap.rules import DEFAULT, Rules
from pam_gap.search.beginning_first import BeginningFirst, search_of_the_beginning
from pam_gap.search.candidate_search import Progress, SearchResult, silent
from pam_gap.search.effect_search import EffectSearch
from pam_gap.search.growth import has_gap
from pam_model.rig import Rig

FLEXIBLE = "a law of the motion that the table of effects does not contain"
NOT_IMPROVED = (
    "No numbers were found with which the simulation is better than with the rig file as written "
    "on data that were not fitted. There is no improved rig file."
)


@dataclass(frozen=True, slots=True)
class DiagnosisOptions:
    """How a diagnosis is made."""

    # number of simulations that run in parallel; 0 for one per processor, at most 4
    threads: int = 0
    progress: Progress = silent  # called with the current task and the completed share, 0 to 1
    rules: Rules = DEFAULT  # hand-set constants of the diagnosis
    # whether the next experiment is sought; for a muscle on a bench, none is
    with_experiment: bool = True

    @property
    def lanes(self) -> int:
        """Number of simulations that run in parallel, at least 1."""
        return self.threads if self.threads > 0 else min(os.cpu_count() or 1, 4)


USUAL: Final = DiagnosisOptions()


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
    options : DiagnosisOptions
        How.
    is_bench : bool
        Whether the joint is the invented one of a muscle on a bench.
    """

    def __init__(
        self,
        rig: Rig,
        joint: int,
        recordings: Sequence[Recording],
        options: DiagnosisOptions = USUAL,
        *,
        is_bench: bool = False,
    ) -> None:
        self.rig = rig
        self.with_experiment = options.with_experiment and not is_bench
        self.rules = options.rules
        self.joint = joint
        self.progress = options.progress
        self.progress("preparing the simulation", 0.0)  # compiles it once on a machine
        make = bench_problem if is_bench else partial(PredictionProblem, joint=joint)
        self.problem = make(rig, recordings=recordings, rules=self.rules, threads=options.lanes)
        self.floor = noise_level(self.problem, self.problem.base.values)
        self.folds: Folds = make_folds(self.problem)
        self.present = self.problem.present
        self.motion = squared_motion(self.problem)
        self._begin()
        self.candidates: Sequence[Candidate] = shown_candidates(self.problem)
        self.evidence: Evidence[HeldOut] | None = None
        self.lengths: LooseLengths | None = None
        self.is_from_the_beginning = False  # whether the last search was

    def _begin(self) -> None:
        """Set the state of a search that has not found anything yet."""
        self.fitter = HypothesisFitter(self.problem, self.floor)
        self.judge = Judge(self.floor, self.present, self.rules, self.motion)

    def written(self) -> HeldOut:
        """Score of the plant as written in the rig file, without any fit."""
        errors = self.problem.errors(self.problem.base.values[None])[0]
        both = self.folds.used
        sums, counts = block_sums(errors, self.folds, both)
        result = PlantFit(np.zeros(0), errors, 0.0, np.zeros((*errors.shape, 0)), 0)
        mean = sums.sum(0) / np.maximum(counts.sum(0), 1.0)
        return HeldOut.of(Hypothesis((), result, mean), sums, counts)

    def effect_search(self) -> EffectSearch:
        """The search for effects in all data."""
        return EffectSearch(self.fitter, self.folds, self.judge, self.candidates, self.progress)

    def search(self, *, in_all_data: bool = False) -> SearchResult:
        """Search effects, in the beginning of the recordings first if that shows enough."""
        self.progress("re-tuning nominal parameters", 0.0)
        whole = self.effect_search()
        small = None if in_all_data else search_of_the_beginning(whole)
        self.is_from_the_beginning = small is not None
        return (BeginningFirst(whole, small) if small else whole).run()

    def searched(self) -> tuple[Evidence[HeldOut], Verdict[HeldOut], Location]:
        """What the search finds, and the verdict.

        What the beginning does not show may be the cause. Before the answer is `unknown`, or a
        `none` that is more probably wrong than right, the effects are therefore sought in all data.
        """
        found = self.decided(self.search())
        verdict, probabilities = found[1].verdict, found[1].probabilities
        is_open = verdict == UNKNOWN or (verdict == NONE and probabilities[NONE] < 0.5)
        if not is_open or not self.is_from_the_beginning:
            return found
        self.progress("seeking effects in all data", 0.0)
        self._begin()
        return self.decided(self.search(in_all_data=True))

    def decided(self, result: SearchResult) -> tuple[Evidence[HeldOut], Verdict[HeldOut], Location]:
        """What a search has found, and the verdict."""
        evidence, location = self.evidence_of(result)
        return evidence, decide(evidence, self.rules), location

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
            self.fitter.drop_background()
            scores = bare
        self.judge.background = np.zeros_like(self.floor)
        return scores

    def unlisted_scores(
        self, scores: Sequence[HeldOut], nominal: Hypothesis, singles: Sequence[Hypothesis]
    ) -> list[HeldOut]:
        """Held-out scores of causes outside the table, where there is a gap to explain."""
        self.judge.set_floor(scores)
        if not has_gap(self.judge.level(scores[0]), int(self.present.sum()), self.rules.search):
            return []
        self.progress("causes outside the table", 0.9)
        usual = [score for score in scores if score.ordinary]
        best = min(usual, key=self.judge.priced_level, default=scores[0])
        beside = best.hypothesis.only(best.ordinary)
        return UnlistedFitter(self.fitter, self.folds).scores(nominal, singles, beside)

    def flexible(self, nominal: HeldOut) -> HeldOut | None:
        """Held-out score of a flexible law of the signals, in place of any law of the table.

        None for a muscle on a bench: whatever is smooth follows a few lengths that are held.
        """
        if self.problem.is_bench:
            return None
        errors = nominal.hypothesis.result.errors
        share = share_of_a_flexible_law(self.problem, self.folds, errors)
        return replace(nominal, sums=nominal.sums * (1.0 - share), unlisted=FLEXIBLE)

    def not_identifiable(self, missing: Sequence[str]) -> Diagnosis:
        """The answer for recordings that do not hold enough; nothing is searched."""
        base = self.problem.base.values
        location = None
        if self.present.any() and self.problem.counted.any():
            location = locate(self.problem, base, self.problem.errors(base[None])[0])
        return not_identifiable(self.fitter, missing, self.written(), location)

    def proposal(
        self, verdict: Verdict[HeldOut], survivors: Sequence[Hypothesis]
    ) -> Proposal | None:
        """The next experiment, if the verdict leaves something open."""
        if not self.with_experiment or verdict.verdict not in ("ambiguous", UNKNOWN):
            return None
        self.progress("next experiment", 0.97)
        if verdict.verdict == UNKNOWN:  # the hypotheses that come closest
            ranked = sorted(verdict.tried, key=self.judge.level)
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
        evidence, verdict, location = self.searched()
        self.judge = verdict.judge
        self.progress("gap figures", 0.96)
        named = verdict.named
        if named is not None:
            improved = improved_fit(
                self.fitter, self.folds, named, self.candidates, evidence.written
            )
            evidence = replace(evidence, improved=improved, improved_for=named.label)
        self.evidence = evidence
        shown = evidence.nominal if named is None else named
        self.lengths = loose_lengths(self.fitter, shown.hypothesis)
        diagnosis = AnswerForm(self.fitter, self.folds, evidence, verdict).fill(location)
        proposal = self.proposal(verdict, diagnosis.survivors)
        self.progress("done", 1.0)
        rivals = [
            score.hypothesis.at_the_end for score in cut_off_rivals(evidence, verdict, LEAST_SHOWN)
        ]
        return replace(
            diagnosis,
            proposal=proposal,
            next_experiment=advice(diagnosis.verdict, proposal, self.problem),
            facts=self._facts(verdict, evidence.nominal, started),
            cautions=self._cautions(verdict, evidence, rivals),
            at_the_end=effects_at_the_end(rivals),
            not_shown=not_shown(self.problem, self.candidates, self.floor),
        )

    def evidence_of(self, result: SearchResult) -> tuple[Evidence[HeldOut], Location]:
        """All that the verdict depends on, with completed fits, and where the gap arises."""
        self.progress("held-out scores", 0.86)
        written = self.written()
        nominal, *found = scores = self.scores(
            [result.nominal, *chain(*result.leading(self.rules.search))]
        )
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
            tried=tuple(score.with_causes(result.causes) for score in found),
            singles=result.singles,
            stages=location.stages,
            unlisted=tuple(unlisted),
            flexible=self.flexible(nominal),
        )
        self.progress("verdict", 0.93)
        self.judge = judge_of(evidence, self.rules)
        settled = {
            k: self.settled(evidence.tried[k]).with_causes(result.causes)
            for k in close_calls(evidence, self.rules)
        }
        return replace(evidence, settled=settled), location

    def _facts(
        self, verdict: Verdict[HeldOut], nominal: HeldOut, started: float
    ) -> dict[str, float]:
        """Figures about the diagnosis itself, for diagnosis.json."""
        chosen = verdict.chosen
        told = verdict.named or nominal
        facts = {
            "level_before": self.judge.level(nominal),
            "level_after": self.judge.level(told),
        }
        if chosen is not None:
            errors = chosen.hypothesis.result.errors
            leftover = share_of_a_flexible_law(self.problem, self.folds, errors)
            facts["leftover_explained"] = float(leftover[self.present].max())
        return facts | {
            "seconds": time.monotonic() - started,
            "simulations": self.problem.simulations,
        }
