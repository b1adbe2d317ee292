"""One joint from recordings to a diagnosis: locate, name, close."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from pam_gap.candidates import applicable, candidates_for
from pam_gap.confidence import (
    Interval,
    for_another_motion,
    gap_closed,
    parameter_intervals,
)
from pam_gap.diagnosis import ChannelGap, Diagnosis, FoundParameter, ScoredCandidate
from pam_gap.fit import Array, FitResult
from pam_gap.gap_figures import UNITS, gap_figures, noise_level
from pam_gap.held_out import Folds, HeldOut, block_sums, make_folds, score_all
from pam_gap.hypothesis import Hypothesis, HypothesisFitter
from pam_gap.improved_rig import improve_rig
from pam_gap.locate import Location, locate
from pam_gap.next_experiment import Proposal, propose
from pam_gap.prediction import PredictionProblem
from pam_gap.recording import SHUT, Recording, RecordingError
from pam_gap.search import Progress, Search, SearchResult, silent
from pam_gap.selection import bootstrap_weights, confidence_set, contains, levels
from pam_gap.unknown_test import explain_leftover
from pam_gap.verdict import (
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
from pam_model.effects import EFFECTS
from pam_model.rig import Rig

FINALISTS = 8
MOST_EFFECTS = 3
CLOSEST = 3
"""Hypotheses that the experiment after `unknown` is to part."""
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
        return float(levels(score.sums.sum(0), score.counts.sum(0), self.floor, self.present))

    def priced_level(self, score: HeldOut) -> float:
        """Level with what the free numbers cost: of two that leave the same, the simpler leads."""
        free = sum(len(member.free) for member in score.hypothesis.members)
        return self.held_out_level(score) + PRICE * free

    def over_floor(self, score: HeldOut) -> Array:
        """RMS error over floor of each channel that is there."""
        ratio: Array = np.sqrt(score.mean_square / self.floor)[self.present]
        return ratio

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
                closed_by_channel(self.over_floor(nominal), self.over_floor(chosen)),
            )
            rivals = self.rivals(chosen, tried, nominal)
            verdict = decide(evidence, [r.hypothesis.label for r in rivals])
        nominal_vector = self.fitter.vector((), result.nominal.result.values)
        location = locate(self.problem, nominal_vector, result.nominal.result.errors)
        self.progress("gap figures", 0.96)
        diagnosis = self.answer(verdict, result, written, nominal, tried, chosen, rivals, location)
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

    def strongest_first(self, effects: Sequence[str], result: SearchResult) -> tuple[str, ...]:
        """Effects in the order of what each explains alone."""
        order = [h.effects[0] for h in result.by_size[0]]
        return tuple(sorted(dict.fromkeys(effects), key=order.index))

    def answer(
        self,
        verdict: str,
        result: SearchResult,
        written: HeldOut,
        nominal: HeldOut,
        tried: Sequence[HeldOut],
        chosen: HeldOut | None,
        rivals: Sequence[HeldOut],
        location: Location,
    ) -> Diagnosis:
        """Put what was found into the contract's form."""
        is_named = verdict in ("named", "ambiguous") and chosen is not None
        final = chosen if is_named and chosen is not None else nominal
        effects: tuple[str, ...] = ()
        groups: list[tuple[str, ...]] = []
        if is_named and chosen is not None:
            own = self.strongest_first(chosen.hypothesis.effects, result)
            others: list[str] = []
            for rival in rivals:
                missing = [e for e in own if e not in rival.hypothesis.effects]
                new = [e for e in rival.hypothesis.effects if e not in own]
                others += new
                groups.append((*missing, *new))
            effects = tuple(dict.fromkeys((*own, *others)))
        stage: str | None = EFFECTS[effects[0]].stage if effects else None
        if verdict == "unknown":
            stage = location.worst
        values = self.fitter.vector(final.hypothesis.members, final.hypothesis.result.values)
        return Diagnosis(
            verdict=verdict,
            stage=stage,
            effects=effects,
            candidates=self.weights(result, tried, chosen if is_named else None),
            indistinguishable=merged_groups(groups),
            parameters=self.parameters(final.hypothesis) if is_named else {},
            gap=self.gap(written, final),
            closed=for_another_motion(
                gap_closed(written, final, self.floor, self.present),
                written,
                self.floor,
                self.present,
            )
            if is_named
            else None,
            next_experiment="",
            joint=self.rig.joints[self.joint].name,
            ranking=self.ranking(nominal, tried),
            location=location,
            horizons=tuple(gap_figures(self.problem, self.problem.base.values, values)),
            improved=self.improved(final.hypothesis) if is_named else None,
            written_values=self.problem.base.values,
            improved_values=values,
            survivors=(final.hypothesis, *(r.hypothesis for r in rivals)) if is_named else (),
            facts={
                "level_before": self.held_out_level(nominal),
                "level_after": self.held_out_level(final),
            },
        )

    def weights(
        self, result: SearchResult, tried: Sequence[HeldOut], chosen: HeldOut | None
    ) -> tuple[tuple[str, float], ...]:
        """Every candidate with its weight: bootstrap shares of hypotheses of the accepted size."""
        size = len(chosen.hypothesis.members) if chosen is not None else 1
        same = [s for s in tried if len(s.hypothesis.members) == size]
        weight: dict[str, float] = {}
        if same:
            shares = bootstrap_weights(same, self.floor, self.present)
            for score, share in zip(same, shares, strict=True):
                for effect in score.hypothesis.effects:
                    weight[effect] = weight.get(effect, 0.0) + float(share)
        first = self.strongest_first(chosen.hypothesis.effects, result) if chosen else ()
        for h in result.by_size[0]:
            weight.setdefault(h.effects[0], 0.0)
        order = [h.effects[0] for h in result.by_size[0]]
        names = sorted(
            weight, key=lambda e: (e not in first, first.index(e) if e in first else 0,
                                   -weight[e], order.index(e))
        )  # fmt: skip
        return tuple((name, min(weight[name], 1.0)) for name in names)

    def parameters(self, h: Hypothesis) -> dict[str, dict[str, FoundParameter]]:
        """Parameters of the named effects with intervals and units."""
        intervals = parameter_intervals(self.fitter, self.folds, h)
        at = len(self.fitter.nuisances)
        found: dict[str, dict[str, FoundParameter]] = {}
        for member in h.members:
            entry: dict[str, FoundParameter] = {}
            for parameter in member.free:
                key = parameter.name.partition(".")[0]
                name = f"{parameter.name}.{member.side}" if member.side else parameter.name
                unit = EFFECTS[member.effect].parameters[key].unit
                entry[name] = FoundParameter(intervals[at], unit)
                at += 1
            found[member.effect] = entry
        return found

    def gap(self, before: HeldOut, after: HeldOut) -> dict[str, ChannelGap]:
        """RMS prediction error of each channel on held-out data."""
        scale = np.sqrt(np.mean([d.block_deviation**2 for d in self.problem.data], axis=0))
        return {
            self.problem.names[c]: ChannelGap(
                float(np.sqrt(before.mean_square[c]) * scale[c]),
                float(np.sqrt(after.mean_square[c]) * scale[c]),
                float(np.sqrt(self.floor[c]) * scale[c]),
                UNITS[c],
            )
            for c in np.nonzero(self.present)[0]
        }

    def ranking(self, nominal: HeldOut, tried: Sequence[HeldOut]) -> tuple[ScoredCandidate, ...]:
        """Scored hypotheses, best first, with what each leaves of the gap."""
        entries = []
        ranked = sorted(tried, key=self.held_out_level)
        shares: Array = (
            bootstrap_weights(ranked, self.floor, self.present) if ranked else np.zeros(0)
        )
        for score, share in zip(ranked, shares, strict=True):
            closed = gap_closed(nominal, score, self.floor, self.present)
            remaining = Interval(1.0 - closed.value, 1.0 - closed.high, 1.0 - closed.low)
            entries.append(
                ScoredCandidate(
                    score.hypothesis.effects,
                    float(share),
                    remaining,
                    self.objections(score),
                    self.held_out_level(score),
                    tuple(self.over_floor(score).tolist()),
                )
            )
        return tuple(entries)

    def objections(self, score: HeldOut) -> str:
        """What speaks against a hypothesis beside its error: bounds, folds that disagree."""
        free, _, _ = self.fitter.problem_parts(score.hypothesis.members)
        notes = []
        for i in range(len(self.fitter.nuisances), len(free)):
            parameter, value = free[i], float(score.hypothesis.result.values[i])
            reach = 1e-3 * (parameter.high - parameter.low)
            if value >= parameter.high - reach:
                notes.append(f"{parameter.name} at its upper bound")
            first, second = (float(fold[i]) for fold in score.fold_values)
            if abs(first - second) > 0.5 * (abs(first) + abs(second)) > 0.5 * parameter.size:
                notes.append(f"{parameter.name} differs between folds")
        return "; ".join(notes)

    def improved(self, h: Hypothesis) -> Rig:
        """The rig with what was found written into it."""
        _, targets, factor = self.fitter.problem_parts(h.members)
        return improve_rig(self.rig, self.joint, h, targets, factor)


def advice(verdict: str, proposal: Proposal | None, present: np.ndarray) -> str:
    """What to record next, in words; empty where nothing more is needed."""
    if proposal is not None:
        return proposal.sentence()
    if verdict == "ambiguous":
        return "the same motion with load cells and at another gravity angle"
    if verdict == "unknown":
        sensors = "" if present[3:].any() else " with load cells"
        return f"holds and slow reversals over the whole range{sensors}, to see what it depends on"
    return ""


def merged_groups(groups: Sequence[tuple[str, ...]]) -> tuple[tuple[str, ...], ...]:
    """Sets that share a member, joined."""
    merged: list[list[str]] = []
    for group in groups:
        home = next((m for m in merged if set(m) & set(group)), None)
        if home is None:
            merged.append(list(dict.fromkeys(group)))
        else:
            home += [e for e in group if e not in home]
    return tuple(tuple(group) for group in merged)
