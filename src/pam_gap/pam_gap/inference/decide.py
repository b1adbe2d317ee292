"""The decision, in one place: one `Evidence` in, one frozen `Verdict` out.

The posterior under the statement of belief gives the probability of every explanation, and the
answer is the one with the least expected cost. Nothing here fits or simulates anything. A running
diagnosis and the one that decides kept evidence again call the same functions. Before the decision,
`close_calls` says which hypotheses are so probable that their fits have to be completed first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from pam_gap.inference.confidence import Interval, for_another_motion, gap_closed
from pam_gap.inference.evidence import Evidence
from pam_gap.inference.judge import Judge, judge_of
from pam_gap.inference.posterior import (
    Choice,
    least_cost,
    most_probable_outside,
    posterior,
)
from pam_gap.inference.probabilities import NONE, UNKNOWN, cause_probabilities
from pam_gap.inference.score import Score
from pam_gap.prediction.locate import worst_stage
from pam_gap.rules import Rules
from pam_model.effects import EFFECTS


@dataclass(frozen=True, slots=True)
class Verdict[S: Score]:
    """What the evidence says."""

    verdict: str  # none, named, ambiguous or unknown
    judge: Judge  # with the floor over which levels are measured
    # the hypothesis of the most probable set of causes that the verdict names; without a name, the
    # rig without causes for `none` and the one that leaves least for `unknown`
    chosen: S | None
    rivals: tuple[S, ...]  # those of the other sets of an ambiguous answer
    tried: tuple[S, ...]  # all final scores
    stage: str | None  # stage of the first effect; for `unknown`, the one with the largest gap
    effects: tuple[str, ...]  # effects that the verdict names, most probable first
    # sets of effects between which the data cannot distinguish; an effect alone in its set may be
    # present or not
    indistinguishable: tuple[tuple[str, ...], ...]
    # every effect with its probability: the named ones first, then the most probable first
    candidates: tuple[tuple[str, float], ...]
    probabilities: Mapping[str, float]  # probability of each explanation, largest first
    looks_like: str  # for `unknown`: the cause outside the table that it probably is, in words
    is_exact: bool  # whether the fit of every hypothesis that had to be completed was completed

    @property
    def named(self) -> S | None:
        """The hypothesis that the verdict names; None without a cause."""
        return self.chosen if self.effects else None


def explanation(score: Score) -> str:
    """The explanation to which a hypothesis belongs, as it is named among the probabilities."""
    return UNKNOWN if score.unlisted else " + ".join(sorted(score.causes)) or NONE


def _hypothesis[S: Score](name: str, scores: Sequence[S], judge: Judge) -> S | None:
    """Of the hypotheses of one explanation, the one that leaves least for its free numbers."""
    same = [score for score in scores if explanation(score) == name]
    return min(same, key=judge.priced_level, default=None)


def close_calls(evidence: Evidence[Any], rules: Rules) -> tuple[int, ...]:
    """Places in `tried` of the hypotheses whose fits have to be completed before the decision.

    They are those of every explanation that is probable enough with the fits as they are.
    """
    found = posterior(replace(evidence, settled={}), rules)
    judge, scores = judge_of(evidence, rules), (evidence.nominal, *evidence.tried)
    probable = [name for name, p in found.items() if p >= rules.search.completed_from]
    close = [_hypothesis(name, scores, judge) for name in probable]
    return tuple(
        place for place, score in enumerate(evidence.tried) if any(score is one for one in close)
    )


def _least_cost(found: Mapping[str, float], nominal: Score, judge: Judge) -> Choice:
    """The answer with the least expected cost; what does not matter costs nothing to leave out."""
    statement = judge.rules.statement
    if not judge.is_material(nominal):
        statement = replace(statement, silence=0.0)
    choice = least_cost(found, statement)
    if choice.verdict == UNKNOWN and not judge.is_material(nominal, unexplained=True):
        return Choice(NONE)
    return choice


def _strongest_first(causes: Mapping[str, float], singles: Sequence[str]) -> dict[str, float]:
    """Causes, the most probable first; of equally probable ones, the one that is stronger alone."""
    place = {effect: k for k, effect in enumerate(singles)}
    ranked = sorted(causes, key=lambda e: (-round(causes[e], 6), place.get(e, len(place)), e))
    return {effect: causes[effect] for effect in ranked}


def _open_sets(choice: Choice, effects: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """The effects that are in some of the sets of an answer only, as sets of alternatives."""
    if not choice.sets:
        return ()
    certain = frozenset.intersection(*choice.sets)
    left = tuple(effect for effect in effects if effect not in certain)
    if certain in choice.sets:  # nothing more may be the answer as well
        return tuple((effect,) for effect in left)
    return (left,)


def decide[S: Score](evidence: Evidence[S], rules: Rules) -> Verdict[S]:
    """The verdict about this evidence, with these rules."""
    judge, nominal = judge_of(evidence, rules), evidence.nominal
    tried = evidence.finalists
    found = posterior(evidence, rules)
    choice = _least_cost(found, nominal, judge)
    causes = _strongest_first(cause_probabilities(found, {*EFFECTS}), evidence.singles)
    # a cause may be more probable than the set in which it stands alone
    sets = sorted(choice.sets, key=lambda one: -max(causes.get(effect, 0.0) for effect in one))
    named = [[e for e in causes if e in one] for one in sets]
    effects = tuple(dict.fromkeys(e for one in named for e in one))
    names = [" + ".join(sorted(one)) for one in sets]
    if choice.verdict == NONE:
        names = [NONE]
    fits = [_hypothesis(name, [nominal, *tried], judge) for name in names]
    if choice.verdict == UNKNOWN:
        fits = [min(tried, key=judge.priced_level, default=None)]
    known = [fit for fit in fits if fit is not None]
    stage: str | None = EFFECTS[effects[0]].stage if effects else None
    if choice.verdict == UNKNOWN:
        stage = worst_stage(evidence.stages, rules.prediction.stage_from)
    like = most_probable_outside(evidence, rules) if choice.verdict == UNKNOWN else ""
    order = dict.fromkeys((*effects, *causes, *evidence.singles))
    return Verdict(
        verdict=choice.verdict,
        judge=judge,
        chosen=known[0] if known else None,
        rivals=tuple(known[1:]),
        tried=tried,
        stage=stage,
        effects=effects,
        indistinguishable=_open_sets(choice, effects),
        candidates=tuple((effect, causes.get(effect, 0.0)) for effect in order),
        probabilities=found,
        looks_like=like,
        is_exact=all(k in evidence.settled for k in close_calls(evidence, rules)),
    )


def cut_off_rivals[S: Score](evidence: Evidence[Any], verdict: Verdict[S], least: float) -> list[S]:
    """Hypotheses at the end of their range that lower the probability of the named causes.

    Parameters
    ----------
    evidence : Evidence
        What the search found.
    verdict : Verdict
        The verdict about it.
    least : float
        Probability below which an explanation is no rival.

    Returns
    -------
    list of Score
        Those that explain most of the gap and share no cause with what is named, the one that
        explains most first; none if nothing is named.
    """
    named = verdict.named
    if named is None:
        return []
    judge = verdict.judge
    usual, most = judge.usual(evidence.nominal, verdict.tried), judge.rules.decision.most_of_the_gap
    rivals = [
        score
        for score in verdict.tried
        if {*named.causes}.isdisjoint(score.causes)
        and not {*score.causes}.isdisjoint(score.cut_off)
        and judge.share_removed(usual, score) >= most
        and verdict.probabilities.get(explanation(score), 0.0) >= least
    ]
    return sorted(rivals, key=judge.level)


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
        "verdict": verdict.verdict,
        "stage": verdict.stage,
        "effects": list(verdict.effects),
        "candidates": [list(pair) for pair in verdict.candidates],
        "indistinguishable": [list(group) for group in verdict.indistinguishable],
        "probabilities": dict(verdict.probabilities),
        "closed": None
        if closed is None
        else {"value": closed.value, "low": closed.low, "high": closed.high},
    }
