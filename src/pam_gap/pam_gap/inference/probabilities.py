"""Probabilities of the explanations, from their levels.

The explanations exclude each other: `none`, `unknown`, and each set of effects that was scored.
Three questions follow each other. Does anything stand out of noise and background? If so, does the
best hypothesis explain it? If so, which hypothesis is it? The first two are answered by logistic
functions of the distance of levels and shares from the limits of the decision, the third by a Gibbs
distribution over the levels, where every further effect costs the fall that it must achieve to be
accepted. A likelihood would be far too sure, because errors are correlated and laws approximate.
All probabilities are therefore raised to a power below 1, which was fitted to drawn rigs (tempered
posteriors: Holmes and Walker, Biometrika 104, 2017; Miller and Dunson, J. Am. Stat. Assoc. 114,
2019; temperature scaling: Guo et al., Int. Conf. Machine Learning, 2017).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import expit

from pam_gap.inference.decision import Decision, Judge
from pam_gap.inference.score import Score
from pam_gap.inference.verdict import SHARP

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
    gap = float(expit(stands_out / rules.temperature))
    gap *= _matters(judge, nominal)
    explained = _explains(judge, nominal, decision.chosen)
    removed = judge.share_removed(usual, decision.chosen) - rules.most_of_the_gap
    explained *= float(expit(removed / rules.share_temperature))
    energies: dict[str, float] = {}
    for score in decision.tried:
        name = " + ".join(sorted(score.causes)) or NONE
        energy = judge.energy(score)
        energies[name] = min(energy, energies.get(name, np.inf))
    values = np.array(list(energies.values()))
    shares = np.exp(-(values - values.min()) / rules.temperature)
    shares *= gap * explained / shares.sum()
    found = dict(zip(energies, shares.tolist(), strict=True))
    unknown = gap * (1.0 - explained)
    nothing = 1.0 - gap + found.pop(NONE, 0.0)
    if decision.verdict == NONE:  # an unexplained gap that does not matter is none either
        nothing, unknown = nothing + unknown, 0.0
    found |= {NONE: nothing, UNKNOWN: unknown}
    tempered = np.array(list(found.values())) ** (1.0 / rules.tempering)
    found = dict(zip(found, (tempered / tempered.sum()).tolist(), strict=True))
    return dict(sorted(found.items(), key=lambda pair: -pair[1]))


def _explains(judge: Judge, nominal: Score, chosen: Score) -> float:
    """Probability that a hypothesis explains the gap, from its distance to the verdict's limits."""
    rules, evidence = judge.rules, judge.evidence(nominal, chosen)
    limit = min((1.0 - rules.sharp_fall) * evidence.level_before, rules.sharp_left)
    sharp = (limit - evidence.level_after) / rules.temperature
    closed = (evidence.closed - rules.closed_at_least) / rules.share_temperature
    if not all(effect in SHARP for effect in evidence.effects):
        return float(expit(closed))
    left = judge.is_material(chosen, unexplained=True)
    return float(expit(sharp if left else max(sharp, closed)))


def _matters(judge: Judge, nominal: Score) -> float:
    """Probability that the gap of the re-tuned plant is material in some channel."""
    limit = (judge.rules.material_share**2 * judge.motion)[judge.present]
    excess = np.maximum((nominal.mean_square - judge.floor)[judge.present], 1e-12)
    if not (limit > 0.0).all():
        return 1.0
    return float(expit(np.log(excess / limit).max() / judge.rules.temperature))
