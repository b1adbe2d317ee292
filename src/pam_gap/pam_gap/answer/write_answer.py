"""Turns the decision of a diagnosis into the answer with the fields of diagnosis.json."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pam_gap.answer.diagnosis import ChannelGap, Diagnosis, FoundParameter, ScoredCandidate
from pam_gap.answer.improved_rig import improve_rig
from pam_gap.answer.user_units import spoken
from pam_gap.experiments.next_experiment import Proposal
from pam_gap.inference.confidence import (
    NORMAL_90,
    Interval,
    floor_reach,
    gap_closed,
    parameter_intervals,
)
from pam_gap.inference.decide import Verdict, closed_by
from pam_gap.inference.evidence import Evidence
from pam_gap.inference.held_out import Folds, HeldOut
from pam_gap.inference.hypothesis import Hypothesis, HypothesisFitter
from pam_gap.prediction.channel_order import BOTH_FORCES, UNITS
from pam_gap.prediction.fit import Array
from pam_gap.prediction.gap_figures import gap_figures
from pam_gap.prediction.locate import Location
from pam_gap.prediction.materiality import GapSize, gap_sizes
from pam_gap.prediction.problem import PredictionProblem
from pam_model.effects import EFFECTS
from pam_model.plant.parameters import RIG_PLACES
from pam_model.rig import Rig

ON_A_BENCH = (
    "Hold further lengths, from the longest to the shortest at which the muscle still pulls. At "
    "each, raise the pressure slowly from zero to the highest and lower it again; then hold the "
    "highest for a minute, and move the length slowly back and forth at two pressures."
)
"""What separates causes in a muscle: length, pressure and time, each changed alone."""


class AnswerForm:
    """Fills in the answer about one joint."""

    def __init__(
        self,
        fitter: HypothesisFitter,
        folds: Folds,
        evidence: Evidence[HeldOut],
        verdict: Verdict[HeldOut],
    ) -> None:
        self.fitter = fitter
        self.folds = folds
        self.evidence = evidence
        self.verdict = verdict
        self.judge = verdict.judge
        self.rules = verdict.judge.rules.decision
        self.problem = fitter.problem
        self.floor = fitter.floor
        self.present = self.problem.present
        self.rig, self.joint = self.problem.rig, self.problem.joint

    def fill(self, location: Location) -> Diagnosis:
        """Return the answer with all fields that follow from the verdict.

        The improved rig file, and what it closes, are those of the fit that a rig file can hold
        (`Evidence.improved`).
        """
        evidence, verdict = self.evidence, self.verdict
        named, shown = verdict.named, evidence.improved
        chosen = evidence.nominal if named is None else named
        final = shown or chosen
        is_unknown = verdict.verdict == "unknown"
        ordinary: tuple[str, ...] = ()
        if verdict.chosen is not None:
            fitted = final.effects if shown is not None else verdict.chosen.effects
            ordinary = tuple(e for e in fitted if e not in verdict.chosen.causes)
        ranking = self.ranking(evidence.nominal, verdict.tried)
        values = self.fitter.vector(final.hypothesis.members, final.hypothesis.result.values)
        return Diagnosis(
            verdict=verdict.verdict,
            stage=verdict.stage,
            effects=verdict.effects,
            candidates=verdict.candidates,
            indistinguishable=verdict.indistinguishable,
            parameters={}
            if named is None
            else self.parameters(final.hypothesis, chosen.hypothesis),
            gap=gap_of(self.fitter, evidence.written, final),
            sizes=self.sizes(evidence.written, evidence.nominal, final),
            material_share=self.rules.material_share,
            unexplained_share=self.rules.material_share * self.rules.unexplained_factor,
            closed=closed_by(evidence, verdict, self.problem.rules),
            next_experiment="",
            probabilities=verdict.probabilities,
            joint=self.rig.joints[self.joint].name,
            ranking=ranking,
            preferred=""
            if named is None
            else why_preferred(chosen.effects, ranking, self.judge.rules.search.price),
            looks_like=verdict.looks_like,
            location=location,
            horizons=tuple(gap_figures(self.problem, self.problem.base.values, values)),
            improved=None if shown is None else self.improved(shown.hypothesis),
            retuned=self.improved(final.hypothesis) if is_unknown else None,
            ordinary=ordinary,
            withheld=self.folds.withheld,
            written_values=self.problem.base.values,
            improved_values=values,
            closest_values=self.closest(verdict.tried) if is_unknown else None,
            survivors=()
            if named is None
            else (chosen.hypothesis, *(r.hypothesis for r in verdict.rivals)),
        )

    def closest(self, tried: Sequence[HeldOut]) -> Array | None:
        """Values of the plant with the effects that leave the smallest error."""
        if not tried:
            return None
        best = min(tried, key=self.judge.level).hypothesis
        return self.fitter.vector(best.members, best.result.values)

    def parameters(
        self, shown: Hypothesis, chosen: Hypothesis
    ) -> dict[str, dict[str, FoundParameter]]:
        """Parameters of the causes with units; values of `shown`, intervals that span both fits.

        No interval is narrower than the laws are exact: a law that errs by a share of the change
        that it makes may err by the same share of its size.

        With an ordinary background the two fits differ: `shown` holds only what a rig file can,
        and makes up for the rest (a spool's play by a longer delay); `chosen` contains the rest in
        amounts that compete with the causes. The true value is usually between both.
        """
        own = self.intervals(shown)
        other = own if shown is chosen else self.intervals(chosen)
        found: dict[str, dict[str, FoundParameter]] = {}
        for member in chosen.members:
            entry = found.setdefault(member.effect, {})
            for name, targets in zip(member.parameter_names, member.targets, strict=True):
                parameter = EFFECTS[member.effect].parameters[RIG_PLACES[targets[0]].key]
                interval = own[member.effect, name]
                size = interval.value - (0.0 if parameter.is_shape else parameter.neutral)
                least = NORMAL_90 * self.judge.rules.statement.sharp_law_error * abs(size)
                spanned = interval.spanning(other[member.effect, name]).reaching(least)
                entry[name] = FoundParameter(spanned, parameter.unit)
        return found

    def intervals(self, h: Hypothesis) -> dict[tuple[str, str], Interval]:
        """Intervals of the effects of a fit, by effect and name of the parameter."""
        intervals = parameter_intervals(self.fitter, self.folds, h)[len(self.fitter.nuisances) :]
        names = [(member.effect, name) for member in h.members for name in member.parameter_names]
        return dict(zip(names, intervals, strict=True))

    def sizes(self, written: HeldOut, nominal: HeldOut, final: HeldOut) -> tuple[GapSize, ...]:
        """The gap of each channel in its unit and as a share of the motion."""
        squares = [score.simulated.mean_square for score in (written, nominal, final)]
        share = self.rules.material_share
        most = share * self.rules.unexplained_factor
        assumed = self.judge.has_background
        background = self.fitter.whole_background if assumed else np.zeros_like(self.floor)
        return gap_sizes(self.problem, self.floor, share, most, squares, background)

    def ranking(self, nominal: HeldOut, tried: Sequence[HeldOut]) -> tuple[ScoredCandidate, ...]:
        """Scored hypotheses, best first, with the share of the gap that remains with each."""
        entries = []
        ranked = sorted(tried, key=self.judge.level)
        for score in ranked:
            closed = gap_closed(nominal, score, self.floor, self.present, self.rules)
            left = 1.0 - closed.value
            reach = floor_reach(nominal, self.floor, self.present, self.rules)
            remaining = Interval(
                left,
                max(min(1.0 - closed.high, left - reach), 0.0),
                max(1.0 - closed.low, left + reach),
            )
            entries.append(
                ScoredCandidate(
                    score.hypothesis.effects,
                    remaining,
                    self.objections(score),
                    self.judge.level(score),
                    tuple(score.over_floor(self.floor, self.present).tolist()),
                    score.label,
                )
            )
        return tuple(entries)

    def objections(self, score: HeldOut) -> str:
        """Reasons to doubt a hypothesis: a parameter at its bound, or folds that disagree."""
        free, _, _ = self.fitter.problem_parts(score.hypothesis.members)
        notes = []
        for i in range(len(self.fitter.nuisances), len(free)):
            parameter, value = free[i], float(score.hypothesis.result.values[i])
            reach = self.rules.bound_reach * (parameter.high - parameter.low)
            if value >= parameter.high - reach:
                notes.append(f"{parameter.name} is at its upper bound")
            fitted = np.array([float(fold[i]) for fold in score.fold_values])
            usual = float(np.mean(np.abs(fitted)))
            apart = 2.0 * self.rules.fold_disagreement * usual
            if np.ptp(fitted) > apart and usual > 0.5 * parameter.size:
                notes.append(f"{parameter.name} differs between folds")
        return "; ".join(notes)

    def improved(self, h: Hypothesis) -> Rig:
        """The rig with the fitted values, except the transport time, which belongs to the log."""
        _, targets, factor = self.fitter.problem_parts(h.members)
        for place, nuisance in enumerate(self.fitter.nuisances):
            if nuisance.is_transport:
                targets[place] = ()
        return improve_rig(self.rig, self.joint, h, targets, factor)


def gap_of(fitter: HypothesisFitter, before: HeldOut, after: HeldOut) -> dict[str, ChannelGap]:
    """RMS prediction error of each channel on held-out data."""
    problem = fitter.problem
    scale = np.sqrt(np.mean([d.block_deviation**2 for d in problem.data], axis=0))
    return {
        problem.names[c]: ChannelGap(
            float(np.sqrt(before.simulated.mean_square[c]) * scale[c]),
            float(np.sqrt(after.simulated.mean_square[c]) * scale[c]),
            float(np.sqrt(fitter.floor[c]) * scale[c]),
            UNITS[c],
        )
        for c in np.nonzero(problem.present)[0]
    }


def not_identifiable(
    fitter: HypothesisFitter, missing: Sequence[str], written: HeldOut, location: Location | None
) -> Diagnosis:
    """The answer for recordings that do not hold enough, with what they lack.

    Parameters
    ----------
    fitter : HypothesisFitter
        The fitter of the diagnosis.
    written : HeldOut
        Score of the plant as written in the rig file.
    location : Location or None
        Where a gap shows, if any data count.
    """
    problem = fitter.problem
    return Diagnosis(
        verdict="not_identifiable",
        stage=None,
        effects=(),
        candidates=(),
        indistinguishable=(),
        parameters={},
        gap=gap_of(fitter, written, written) if location is not None else {},
        closed=None,
        next_experiment=advice("not_identifiable", None, problem),
        joint=problem.rig.joints[problem.joint].name,
        location=location,
        missing=tuple(missing),
        written_values=problem.base.values,
        improved_values=problem.base.values,
    )


def why_preferred(chosen: Sequence[str], ranking: Sequence[ScoredCandidate], price: float) -> str:
    """Why an explanation was preferred to a better fitting one; empty if none fits better.

    Parameters
    ----------
    chosen : sequence of str
        Effects of the explanation.
    ranking : sequence of ScoredCandidate
        All explanations.
    price : float
        Difference of levels that needs no reason.
    """
    own = next((entry for entry in ranking if set(entry.effects) == set(chosen)), None)
    best = min(ranking, key=lambda entry: entry.level, default=None)
    if own is None or best is None or best.level >= own.level - price:
        return ""
    mine, other = (" + ".join(map(spoken, entry.effects)) for entry in (own, best))
    reason = (
        "several causes at once are less probable beforehand than fewer"
        if len(best.effects) > len(own.effects)
        else "it needs fewer free numbers, or leaves no more than its law may"
    )
    levels = f"sum of the log errors {best.level:.2f} against {own.level:.2f}"
    return f"{other} fits this recording better ({levels}). {mine} was preferred because {reason}."


def advice(verdict: str, proposal: Proposal | None, problem: PredictionProblem) -> str:
    """Instruction for the next recording; empty if none is needed."""
    if proposal is not None:
        return proposal.sentence()
    if verdict == "not_identifiable":
        return "Record again, as docs/record_for_diagnosis.md describes."
    if problem.is_bench and verdict in ("ambiguous", "unknown"):
        return ON_A_BENCH
    if verdict == "ambiguous":
        return "Record the same motion again with load cells, and with gravity at another angle."
    if verdict == "unknown":
        sensors = "" if problem.present[BOTH_FORCES].any() else ", with load cells"
        return (
            f"Record holds and slow reversals over the whole range{sensors}: they show what the "
            "remaining error depends on."
        )
    return ""
