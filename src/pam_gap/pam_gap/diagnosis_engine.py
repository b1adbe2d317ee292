"""One joint from recordings to a diagnosis: search, score, choose, tell apart, propose."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from pam_gap.answer.diagnosis import Diagnosis
from pam_gap.answer.write_answer import AnswerForm, advice
from pam_gap.experiments.next_experiment import propose
from pam_gap.inference.candidates import applicable, candidates_for
from pam_gap.inference.held_out import (
    Folds,
    HeldOut,
    block_sums,
    make_folds,
    score_all,
    score_held_out,
)
from pam_gap.inference.hypothesis import Hypothesis, HypothesisFitter
from pam_gap.inference.search import Progress, Search, SearchResult, silent
from pam_gap.inference.selection import confidence_set, contains, held_out_level
from pam_gap.inference.unknown_test import explain_leftover
from pam_gap.inference.verdict import (
    NO_GAIN,
    PRICE,
    Evidence,
    accepts_further,
    closed_by_channel,
    decide,
    has_gap,
    is_rival,
    prefers_simple,
)
from pam_gap.prediction.fit import FitResult
from pam_gap.prediction.gap_figures import noise_level
from pam_gap.prediction.locate import locate
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import SHUT, Recording, RecordingError
from pam_model.rig import Rig

FINALISTS = 8
MOST_EFFECTS = 3
CLOSEST = 3
"""Hypotheses that the experiment after `unknown` is to part."""
RESTARTS = 3
"""Times a hypothesis is fitted anew at most before it is reported."""
LEFT_TO_EXPLAIN = 2.5
"""RMS error over floor of the worst channel from which a further effect is sought."""


class JointDiagnosis:
    """The diagnosis of one joint, step by step; `run` does them all.

    Parameters
    ----------
    rig : Rig
        As written.
    joint : int
        Which of its joints.
    recordings : sequence of Recording
        Of this rig.
    threads : int
        Simulations run at once.
    progress : callable
        Told what is being done and the share done.
    """

    def __init__(
        self,
        rig: Rig,
        joint: int,
        recordings: Sequence[Recording],
        *,
        threads: int = 1,
        progress: Progress = silent,
    ) -> None:
        self.rig = rig
        self.joint = joint
        self.progress = progress
        self.problem = PredictionProblem(rig, joint, recordings, threads=threads)
        self.floor = noise_level(self.problem, self.problem.base.values)
        self.fitter = HypothesisFitter(self.problem, self.floor)
        self.folds: Folds = make_folds(self.problem)
        self.present = self.problem.present
        if not self.present.any():
            raise RecordingError(
                f"{recordings[0].source}: neither valve commands nor position nor pulls beside "
                "the pressures; a diagnosis needs at least one of them"
            )

    def held_out_level(self, score: HeldOut) -> float:
        """Level of a held-out score."""
        return held_out_level(score, self.floor, self.present)

    def priced_level(self, score: HeldOut) -> float:
        """Level with what the free numbers cost: of two that leave the same, the simpler leads."""
        free = sum(len(member.free) for member in score.hypothesis.members)
        return self.held_out_level(score) + PRICE * free

    def written(self) -> HeldOut:
        """The plant as written, which was fitted to nothing."""
        errors = self.problem.errors(self.problem.base.values[None])[0]
        both = self.folds.rows[0] | self.folds.rows[1]
        sums, counts = block_sums(errors, self.folds, both)
        result = FitResult(np.zeros(0), errors, 0.0, np.zeros((*errors.shape, 0)), 0)
        mean = sums.sum(0) / np.maximum(counts.sum(0), 1.0)
        return HeldOut(Hypothesis((), result, mean), sums, counts, ())

    def search(self) -> SearchResult:
        """Singles, and more effects while they pay."""
        present = self.present
        candidates = [
            candidate
            for candidate in candidates_for(self.rig, self.rig.joints[self.joint])
            if applicable(
                candidate.effect,
                commands=self.problem.has_commands,
                position=bool(present[2]),
                pulls=bool(present[3:].any()),
                shut=all(d.recording.mounting == SHUT for d in self.problem.data),
            )
        ]
        search = Search(self.fitter, candidates, self.progress)
        result = search.singles()
        before = search.level(result.nominal)
        low, high = 0.4, 0.75
        while len(result.by_size) < MOST_EFFECTS:
            best = result.by_size[-1][0]
            left = np.sqrt(best.mean_square / self.floor)[self.present]
            if search.level(best) < 1.0 or float(left.max()) < LEFT_TO_EXPLAIN:
                break
            if len(result.by_size) > 1:
                previous = result.by_size[-2][0]
                runner_up = min(
                    (search.level(h) for h in result.by_size[-1] if h.effects != best.effects),
                    default=search.level(previous),
                )
                if not accepts_further(
                    search.level(previous), search.level(best), before, runner_up
                ):
                    break
            search.grow(result, (low, high))
            low, high = high, 0.85
        return result

    def finalists(self, result: SearchResult) -> list[Hypothesis]:
        """The hypotheses worth a held-out score."""
        chosen: list[Hypothesis] = []
        for found, share in zip(result.by_size, (FINALISTS, 5, 3), strict=False):
            chosen += found[:share]
        return chosen

    def choose(self, nominal: HeldOut, scores: Sequence[HeldOut]) -> HeldOut | None:
        """The accepted hypothesis: the smallest that no larger one clearly beats."""
        before = self.held_out_level(nominal)
        accepted: HeldOut | None = None
        for size in range(1, MOST_EFFECTS + 1):
            rivals = [s for s in scores if len(s.hypothesis.members) == size]
            if not rivals:
                break
            best = min(rivals, key=self.priced_level)
            for simple in sorted(rivals, key=self.held_out_level):
                if contains(best.hypothesis.effects, simple.hypothesis.effects) and prefers_simple(
                    self.held_out_level(simple), self.held_out_level(best), before
                ):
                    best = simple
                    break
            if accepted is not None:
                first = self.held_out_level(accepted)
                others = [
                    s for s in rivals if set(s.hypothesis.effects) != set(best.hypothesis.effects)
                ]
                runner_up = min(map(self.held_out_level, others), default=first)
                if not accepts_further(first, self.held_out_level(best), before, runner_up):
                    break
            accepted = best
        return accepted

    def settled(self, score: HeldOut) -> HeldOut:
        """A hypothesis at its best.

        Every search starts from the nominal plant re-tuned without effects, where nominal numbers
        stand at the ends of their tolerance to look like the effect, and a fit may be caught there.
        Here they start from what is written, the effects from what was found.
        """
        best = score.hypothesis
        centres = [nuisance.free.centre for nuisance in self.fitter.nuisances]
        for _ in range(RESTARTS):
            start = np.concatenate([centres, best.result.values[len(centres) :]])
            again = self.fitter.fit(best.members, start, max_iterations=25, tolerance=1e-5)
            if not again.result.objective < best.result.objective - 1.0:
                break
            best = again
        if best is score.hypothesis:
            return score
        settled = score_held_out(self.fitter, self.folds, best)
        is_better = self.held_out_level(settled) < self.held_out_level(score)
        return settled if is_better else score

    def rivals(self, chosen: HeldOut, scores: Sequence[HeldOut], nominal: HeldOut) -> list[HeldOut]:
        """Hypotheses of the chosen one's size that the data cannot tell from it.

        A rival must bring at least half of what the chosen one's last effect brings. A richer law
        that the chosen one is a form of is one where it leaves less, though not clearly.
        """
        level = self.held_out_level(chosen)
        size = len(chosen.hypothesis.members)
        smaller = [nominal, *(s for s in scores if len(s.hypothesis.members) < size)]
        limit = 0.5 * (level + min(map(self.held_out_level, smaller)))
        alike = [
            s
            for s in scores
            if len(s.hypothesis.members) == size
            and self.held_out_level(s) < limit
            and set(s.hypothesis.effects) != set(chosen.hypothesis.effects)
            and (
                not contains(s.hypothesis.effects, chosen.hypothesis.effects)
                or level - self.held_out_level(s) > NO_GAIN
            )
        ]
        inside = confidence_set([chosen, *alike], self.floor, self.present)[1:]
        before = self.held_out_level(nominal)
        return [
            s
            for s, tied in zip(alike, inside, strict=True)
            if is_rival(level, self.held_out_level(s), before, tied)
        ]

    def run(self) -> Diagnosis:
        """Diagnose."""
        started = time.monotonic()
        result = self.search()
        self.progress("held-out scores", 0.86)
        written = self.written()
        hypotheses = [result.nominal, *self.finalists(result)]
        scores = score_all(self.fitter, self.folds, hypotheses)
        nominal, tried = scores[0], scores[1:]
        self.progress("verdict", 0.93)
        chosen = self.choose(nominal, tried)
        if chosen is not None:
            close = [chosen, *self.rivals(chosen, tried, nominal)]
            others = [score for score in tried if not any(score is one for one in close)]
            tried = [*map(self.settled, close), *others]
            chosen = self.choose(nominal, tried)
        before = self.held_out_level(nominal)
        channels = int(self.present.sum())
        rivals: list[HeldOut] = []
        verdict = "none"
        if chosen is not None and has_gap(before, channels):
            evidence = Evidence(
                chosen.hypothesis.effects,
                before,
                self.held_out_level(chosen),
                channels,
                closed_by_channel(
                    nominal.over_floor(self.floor, self.present),
                    chosen.over_floor(self.floor, self.present),
                ),
            )
            rivals = self.rivals(chosen, tried, nominal)
            verdict = decide(evidence, [r.hypothesis.label for r in rivals])
        nominal_vector = self.fitter.vector((), result.nominal.result.values)
        location = locate(self.problem, nominal_vector, result.nominal.result.errors)
        self.progress("gap figures", 0.96)
        form = AnswerForm(self.fitter, self.folds)
        diagnosis = form.fill(verdict, result, written, nominal, tried, chosen, rivals, location)
        if verdict in ("ambiguous", "unknown"):
            self.progress("next experiment", 0.97)
            survivors = diagnosis.survivors
            if verdict == "unknown":  # what comes closest
                ranked = sorted(tried, key=self.held_out_level)
                survivors = tuple(s.hypothesis for s in ranked[:CLOSEST])
            diagnosis.proposal = propose(self.fitter, survivors)
        diagnosis.next_experiment = advice(verdict, diagnosis.proposal, self.present)
        if chosen is not None:
            leftover = explain_leftover(self.problem, self.folds, chosen.hypothesis.result.errors)
            diagnosis.facts = dict(diagnosis.facts) | {
                "leftover_explained": float(leftover.explained[self.present].max())
            }
        seconds = time.monotonic() - started
        diagnosis.facts = dict(diagnosis.facts) | {
            "seconds": seconds,
            "simulations": self.problem.simulations,
        }
        self.progress("done", 1.0)
        return diagnosis
