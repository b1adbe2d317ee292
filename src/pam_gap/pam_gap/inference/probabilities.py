"""Probabilities of the explanations, from their levels.

The explanations exclude each other: `none`, `unknown`, and each set of effects that was scored.
Three questions follow each other. Does anything stand out of noise and background? If so, does the
best hypothesis explain it? If so, which hypothesis is it? The first two are answered by logistic
functions of the distance of levels and shares from the limits of the decision, the third by a Gibbs
distribution over the levels, where every further effect costs the fall that it must achieve to be
accepted. The level of a hypothesis whose size is at the end of its range is an upper bound. With
more of the effect it would lie between this and the best one, and the middle is taken. A likelihood
would be far too sure, because errors are correlated and laws approximate.
All probabilities are therefore raised to a power below 1, which was fitted to drawn rigs (tempered
posteriors: Holmes and Walker, Biometrika 104, 2017; Miller and Dunson, J. Am. Stat. Assoc. 114,
2019; temperature scaling: Guo et al., Int. Conf. Machine Learning, 2017).
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import replace

import numpy as np

from pam_gap.inference.decision import Decision, Judge
from pam_gap.inference.logistic import logistic
from pam_gap.inference.score import Score
from pam_gap.inference.selection import NESTED

NONE, UNKNOWN = "none", "unknown"


def probabilities[S: Score](
    judge: Judge, nominal: Score, decision: Decision[S]
) -> Mapping[str, float]:
    """Probability of each explanation, largest first; the sum is 1.

    Parameters
    ----------
    judge : Judge
        The judge that took the decision.
    nominal : Score
        Score of the re-tuned plant without effects.
    decision : Decision
        The decision, with all scores.
    """
    rules = judge.rules
    if decision.chosen is None:
        return {NONE: 1.0}
    usual = judge.usual(nominal, decision.tried)
    stands_out = judge.level(usual) - rules.no_gap * int(judge.present.sum())
    gap = logistic(stands_out / rules.temperature)
    gap *= _matters(judge, nominal)
    explained = _explains(judge, nominal, decision.chosen)
    removed = judge.share_removed(usual, decision.chosen) - rules.most_of_the_gap
    explained *= logistic(removed / rules.share_temperature)
    energies: dict[str, float] = {}
    least = min(judge.energy(score) for score in (*decision.tried, *decision.unlisted))
    for score in (*decision.tried, *decision.unlisted):
        name = _explanation(score)
        energy = judge.energy(score)
        if is_cut_off(judge, usual, score):
            energy -= rules.cut_off_share * (energy - least)
        energies[name] = min(energy, energies.get(name, np.inf))
    values = np.array(list(energies.values()))
    shares = np.exp(-(values - values.min()) / rules.temperature)
    found = dict(zip(energies, (gap * shares / shares.sum()).tolist(), strict=True))
    beyond = found.pop(UNKNOWN, 0.0)  # of causes outside the table
    unexplained = (gap - beyond) * (1.0 - explained)
    large = _is_large(judge, usual)
    unknown = beyond + unexplained * large
    found = {name: share * explained for name, share in found.items()}
    nothing = 1.0 - gap + unexplained * (1.0 - large) + found.pop(NONE, 0.0)
    if decision.verdict == NONE:  # an unexplained gap that does not matter is none either
        nothing, unknown = nothing + unknown, 0.0
    found |= {NONE: nothing, UNKNOWN: unknown}
    tempered = np.array(list(found.values())) ** (1.0 / rules.tempering)
    found = dict(zip(found, (tempered / tempered.sum()).tolist(), strict=True))
    if judge.has_background:
        found = _with_hidden(found, rules.hidden_share)
    return dict(sorted(found.items(), key=lambda pair: -pair[1]))


def is_cut_off(judge: Judge, usual: Score, score: Score) -> bool:
    """Whether a hypothesis explains most of the gap with a cause at the end of its range."""
    return (
        not {*score.causes}.isdisjoint(score.cut_off)
        and judge.share_removed(usual, score) >= judge.rules.most_of_the_gap
    )


def cut_off_rivals[S: Score](
    judge: Judge, nominal: Score, decision: Decision[S], found: Mapping[str, float], least: float
) -> list[S]:
    """Hypotheses at the end of their range that lower the probability of the named causes.

    Parameters
    ----------
    judge, nominal, decision
        As for `probabilities`.
    found : mapping
        Probability of each explanation.
    least : float
        Probability below which an explanation is no rival.

    Returns
    -------
    list of Score
        Those that share no cause with what is named, the one that explains most first; none if
        nothing is named.
    """
    if decision.chosen is None or not decision.is_named:
        return []
    usual = judge.usual(nominal, decision.tried)
    rivals = [
        score
        for score in decision.tried
        if {*decision.chosen.causes}.isdisjoint(score.causes)
        and is_cut_off(judge, usual, score)
        and found.get(_explanation(score), 0.0) >= least
    ]
    return sorted(rivals, key=judge.level)


def _explanation(score: Score) -> str:
    """The explanation to which a hypothesis belongs, as it is named among the probabilities."""
    return UNKNOWN if score.unlisted else " + ".join(sorted(score.causes)) or NONE


def _with_hidden(found: Mapping[str, float], share: float) -> dict[str, float]:
    """The probabilities if a cause may hide in the background although nothing stands out of it.

    This share of the probability of `none` is divided among the causes in proportion.
    """
    causes = {name: p for name, p in found.items() if name not in (NONE, UNKNOWN)}
    total = sum(causes.values())
    if total <= 0.0:
        return dict(found)
    hidden = share * found[NONE]
    return {
        name: p * (1.0 + hidden / total) if name in causes else p - hidden * (name == NONE)
        for name, p in found.items()
    }


def cause_probabilities(probabilities: Mapping[str, float], named: Set[str]) -> dict[str, float]:
    """The probability that each of the named effects is a cause, largest first.

    Parameters
    ----------
    probabilities : mapping
        Explanation (effects joined by " + ", `unknown` or `none`) -> probability.
    named : set of str
        Effects.

    Returns
    -------
    dict of str to float
        Of each of them the sum over all explanations that contain it.
    """
    found: dict[str, float] = {}
    for explanation, probability in probabilities.items():
        for effect in named & {*explanation.split(" + ")}:
            found[effect] = found.get(effect, 0.0) + probability
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def among_causes(probabilities: Mapping[str, float]) -> dict[str, float]:
    """Probabilities of the explanations by effects of the table, given that one of them is right.

    Parameters
    ----------
    probabilities : mapping
        Explanation -> probability.
    """
    found = {name: p for name, p in probabilities.items() if name not in (NONE, UNKNOWN)}
    total = sum(found.values())
    return {name: p / total for name, p in found.items()} if total > 0.0 else {}


def agreed[S: Score](judge: Judge, nominal: Score, decision: Decision[S]) -> Decision[S]:
    """The decision in agreement with the probabilities of the explanations.

    A verdict without a cause is replaced by the most probable explanation if this has causes, and
    doubtful causes are left out.

    Parameters
    ----------
    judge : Judge
        The judge that took the decision.
    nominal : Score
        Score of the re-tuned plant without effects.
    decision : Decision
        The decision, with all scores.
    """
    if decision.is_named or decision.chosen is None:
        return _without_doubtful_causes(judge, nominal, decision)
    first = next(iter(probabilities(judge, nominal, decision)))
    same = [s for s in decision.tried if s.size and _explanation(s) == first]
    if not same:
        return decision
    chosen = min(same, key=judge.energy)
    rivals = tuple(judge.rivals(chosen, decision.tried, nominal))
    named = replace(
        decision,
        verdict="ambiguous" if rivals else "named",
        chosen=chosen,
        rivals=rivals,
        better=None,
    )
    return _without_doubtful_causes(judge, nominal, named)


def _without_doubtful_causes[S: Score](
    judge: Judge, nominal: Score, decision: Decision[S]
) -> Decision[S]:
    """The decision without those of several named causes that are more likely absent than present.

    A cause of the table has been found; the question here is which of the found ones are real.

    A richer law of a cause, or a simpler one, counts as this cause. The rest must be a hypothesis
    that was scored, be more probable than all causes together, and be named by itself. Otherwise
    many improbable rivals together would outvote the most probable explanation.
    """
    chosen = decision.chosen
    if decision.verdict != "named" or chosen is None or chosen.size < 2:
        return decision
    stated: dict[str, float] = dict.fromkeys(chosen.causes, 0.0)
    found = among_causes(probabilities(judge, nominal, decision))
    for explanation, p in found.items():
        inside = explanation.split(" + ")
        for effect in stated:
            kin = {effect, *(b for a, b in NESTED if a == effect)}
            kin |= {a for a, b in NESTED if b == effect}
            stated[effect] += p * (not kin.isdisjoint(inside))
    likely = {effect for effect, p in stated.items() if p >= judge.rules.likely}
    simpler = [score for score in decision.tried if likely and {*score.causes} == likely]
    if not simpler or len(likely) == chosen.size:
        return decision
    rest = min(simpler, key=judge.level)
    if found.get(_explanation(rest), 0.0) < found.get(_explanation(chosen), 0.0):
        return decision
    again = judge.about(nominal, decision.tried, rest, decision.unlisted)
    return again if again.is_named else decision


def _explains(judge: Judge, nominal: Score, chosen: Score) -> float:
    """Probability that a hypothesis explains the gap, from its distance to the verdict's limits."""
    rules, figures = judge.rules, judge.figures(nominal, chosen)
    most = rules.sharp_left * figures.channels
    limit = min((1.0 - rules.sharp_fall) * figures.level_before, most)
    sharp = (limit - figures.level_after) / rules.temperature
    closed = (figures.closed - rules.closed_at_least) / rules.share_temperature
    if not figures.is_sharp:
        return logistic(closed)
    left = judge.is_material(chosen, unexplained=True)
    return logistic(sharp if left else max(sharp, closed))


def _is_large(judge: Judge, usual: Score) -> float:
    """Probability that an unexplained gap is larger than the background of some good rig."""
    if not judge.has_background:
        return 1.0
    limit = judge.rules.no_gap_unexplained * int(judge.present.sum())
    return logistic((judge.level(usual) - limit) / judge.rules.temperature)


def _matters(judge: Judge, nominal: Score) -> float:
    """Probability that the gap of the re-tuned plant is material in some channel."""
    limit = (judge.rules.material_share**2 * judge.motion)[judge.present]
    excess = np.maximum((nominal.mean_square - judge.floor)[judge.present], 1e-12)
    if not (limit > 0.0).all():
        return 1.0
    return logistic(float(np.log(excess / limit).max()) / judge.rules.temperature)
