"""The decision, in one place: one `Evidence` in, one frozen `Verdict` out.

Nothing here fits or simulates anything. A running diagnosis and the one that decides kept evidence
again call the same functions. Before the decision, `close_calls` says which hypotheses are so close
that their fits have to be completed first.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pam_gap.inference.confidence import Interval, for_another_motion, gap_closed
from pam_gap.inference.decision import Decision, Judge
from pam_gap.inference.evidence import Evidence
from pam_gap.inference.named_effects import named_effects
from pam_gap.inference.probabilities import agreed, probabilities
from pam_gap.inference.score import Score
from pam_gap.inference.search_growth import grows
from pam_gap.prediction.locate import worst_stage
from pam_gap.rules import Rules
from pam_model.effects import EFFECTS


@dataclass(frozen=True, slots=True)
class Verdict[S: Score]:
    """What the evidence says."""

    # the verdict in one word, the accepted hypothesis, its rivals, and all scores
    decision: Decision[S]
    judge: Judge  # with the floor against which the hypotheses were judged
    stage: str | None  # stage of the first effect; for `unknown`, the one with the largest gap
    effects: tuple[str, ...]  # effects that the verdict names, strongest first
    # sets of effects between which the data cannot distinguish
    indistinguishable: tuple[tuple[str, ...], ...]
    candidates: tuple[tuple[str, float], ...]  # every candidate with its weight, strongest first
    probabilities: Mapping[str, float]  # probability of each explanation, largest first
    # whether a diagnosis with these rules would have had the same evidence: the search would have
    # stopped at the same size, and the fit of every close hypothesis was completed
    is_exact: bool

    @property
    def named(self) -> S | None:
        """The hypothesis that the verdict names; None without a cause."""
        return self.decision.chosen if self.decision.is_named else None


def judge_of(evidence: Evidence[Any], rules: Rules) -> Judge:
    """The judge of the hypotheses of this evidence; its floor is not set yet."""
    return Judge(
        evidence.floor, evidence.present, rules.decision, evidence.motion, evidence.background
    )


def close_calls(evidence: Evidence[Any], judge: Judge) -> tuple[int, ...]:
    """Places in `tried` of the hypotheses whose fits have to be completed before the decision.

    They are the hypothesis that would be accepted and its rivals; the floor of the judge is set.
    """
    close = judge.close_calls(evidence.nominal, evidence.tried, evidence.unlisted)
    return tuple(next(k for k, one in enumerate(evidence.tried) if one is s) for s in close)


def decide[S: Score](evidence: Evidence[S], rules: Rules) -> Verdict[S]:
    """The verdict about this evidence, with these rules."""
    judge = judge_of(evidence, rules)
    close = close_calls(evidence, judge)
    tried = [evidence.settled.get(k, evidence.tried[k]) for k in close]
    tried += [score for k, score in enumerate(evidence.tried) if k not in close]
    nominal, singles = evidence.nominal, evidence.singles
    decision = agreed(judge, nominal, judge.decide(nominal, tried, evidence.unlisted))
    effects, groups = named_effects(decision, singles)
    stage: str | None = EFFECTS[effects[0]].stage if effects else None
    if decision.verdict == "unknown":
        stage = worst_stage(evidence.stages, rules.prediction.stage_from)
    return Verdict(
        decision=decision,
        judge=judge,
        stage=stage,
        effects=effects,
        indistinguishable=groups,
        candidates=judge.weights(decision, singles),
        probabilities=probabilities(judge, nominal, decision),
        is_exact=all(k in evidence.settled for k in close)
        and all(
            grows(step, rules.search, rules.decision) == went_on
            for step, went_on in evidence.growth
        ),
    )


def closed_by[S: Score](
    evidence: Evidence[S], verdict: Verdict[S], rules: Rules
) -> Interval | None:
    """Share of the gap that the improved rig file closes under another motion; None without it."""
    shown: Score | None = verdict.named
    if shown is not None and shown.label == evidence.improved_for:
        shown = evidence.improved
    if shown is None:
        return None
    written, floor, present = evidence.written, evidence.floor, evidence.present
    return for_another_motion(
        gap_closed(written, shown, floor, present, rules.decision),
        written,
        floor,
        present,
        rules.decision,
        has_background=verdict.judge.has_background,
    )


def decided_answer(evidence: Evidence[Any], verdict: Verdict[Any], rules: Rules) -> dict[str, Any]:
    """The part of diagnosis.json that the decision determines."""
    closed = closed_by(evidence, verdict, rules)
    return {
        "verdict": verdict.decision.verdict,
        "stage": verdict.stage,
        "effects": list(verdict.effects),
        "candidates": [list(pair) for pair in verdict.candidates],
        "indistinguishable": [list(group) for group in verdict.indistinguishable],
        "probabilities": dict(verdict.probabilities),
        "closed": None
        if closed is None
        else {"value": closed.value, "low": closed.low, "high": closed.high},
    }
