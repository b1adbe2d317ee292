"""Probabilities of sets of causes under the statement of belief, and the answer of least cost.

The likelihood of a hypothesis is that of the errors which it leaves on held-out data. The variance
of a channel is unknown: it scatters about that of noise, an ordinary background and the error of
the laws. This is integrated in closed form (Student's t; Gelman et al., Bayesian Data Analysis, 3rd
ed., chapter 3); what all channels of a rig share, the size of its background, is integrated by
quadrature, and a law with several forms may be the right one or err by more or less.
Held-out data take the place of the size priors in an evidence (Fong and Holmes, On the marginal
likelihood and cross-validation, Biometrika 107, 2020). A cause outside the table is a discrepancy
that no member spans (Kennedy and O'Hagan, J. R. Statist. Soc. B 63, 2001).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb, log
from typing import Any

import numpy as np

from pam_gap.inference.candidates import NESTED
from pam_gap.inference.evidence import Evidence
from pam_gap.inference.log_sum_exp import logsumexp
from pam_gap.inference.probabilities import NONE, UNKNOWN
from pam_gap.inference.score import Score
from pam_gap.prediction.fit import Array
from pam_gap.rules import Rules
from pam_gap.rules.statement import Statement
from pam_model.effects import EFFECTS

SEVERAL = frozenset(name for name, effect in EFFECTS.items() if not effect.search.is_sharp)
"""Effects whose law has several forms."""
_SIZES = np.linspace(-3.0, 3.0, 17)
"""Sizes of a background, in standard deviations of its logarithm; close enough for any spread."""
_SIZE_WEIGHTS = np.exp(-0.5 * _SIZES**2) / np.exp(-0.5 * _SIZES**2).sum()
LAW_ERRORS = 6
"""Errors of a law over which is summed; close enough for one decade and a half."""
UNKNOWN_SIZES = 25
"""Sizes of a cause outside the table over which is summed."""
DIVERGED = 1e12
"""Mean square in place of one that is not finite."""
LEAST_KEPT = 1e-3
"""Probability below which an explanation is left out."""
CONSIDERED = 6
"""Sets of causes of which an answer is made, the most probable ones."""
MOST_ALTERNATIVES = 4
"""Sets of causes of which an answer may say that one of them holds."""


def _log_density(left: Array, variance: Array, statement: Statement) -> Array:
    """Log density of each channel's errors, whose variance scatters about one that is given."""
    free, worth = statement.channel_freedom, statement.independent_errors
    density: Array = 0.5 * free * np.log(free * variance)
    density -= 0.5 * (free + worth) * np.log(free * variance + worth * left)
    return density


def _backgrounds(noise: Array, background: Array, statement: Statement) -> Array:
    """Mean squares of noise and background for each size of it, shape (sizes, channels)."""
    sizes = np.exp(statement.background_spread * _SIZES)[:, None]
    found: Array = noise + sizes * background
    return found


def log_likelihood(
    left: Array,
    noise: Array,
    background: Array,
    change: Array,
    is_sharp: np.ndarray,
    statement: Statement,
) -> Array:
    """Log density of the errors that hypotheses leave, up to a constant, shape (hypotheses,).

    Parameters
    ----------
    left, change : ndarray, shape (hypotheses, channels)
        Mean squares that each leaves, and of the change that its causes make.
    noise, background : ndarray, shape (channels,)
        Mean squares of the noise and of what an ordinary background leaves.
    is_sharp : ndarray of bool, shape (hypotheses,)
        Whether the laws of all causes of a hypothesis have one form only.
    statement : Statement
        The statement.
    """
    usual = _backgrounds(noise, background, statement)[:, None, :]
    errors = np.geomspace(statement.sharp_law_error, statement.law_error, LAW_ERRORS)
    variance = usual + (errors**2)[:, None, None, None] * change
    density = _log_density(left, variance, statement).sum(axis=-1)
    known: Array = logsumexp(density, axis=1, b=_SIZE_WEIGHTS[:, None])
    several = logsumexp(known, axis=0) - log(LAW_ERRORS)
    right = statement.right_law
    mixed = np.logaddexp(known[0] + log(right), several + log(1.0 - right))
    found: Array = np.where(is_sharp, known[0], mixed)
    return found


def log_likelihood_of_unknown(
    without: Array, noise: Array, background: Array, statement: Statement
) -> float:
    """Log density of the errors without any cause, up to the same constant, if one is outside.

    Parameters
    ----------
    without : ndarray, shape (channels,)
        Mean squares of these errors.
    noise, background, statement
        As for `log_likelihood`.
    """
    usual = _backgrounds(noise, background, statement)[:, None, :]
    sizes = np.geomspace(statement.least_unknown, statement.largest_unknown, UNKNOWN_SIZES)
    variance = usual + sizes[:, None] ** 2 * (noise + background)
    density = logsumexp(_log_density(without, variance, statement), axis=1) - log(sizes.size)
    return float(logsumexp(density.sum(axis=-1), b=_SIZE_WEIGHTS))


def prior_of_sets(statement: Statement) -> list[float]:
    """Log of the prior of each set of no, one, two and three causes of the table."""
    shares = (statement.nothing, statement.one, statement.two, statement.three)
    return [log(share / comb(len(EFFECTS), size)) for size, share in enumerate(shares)]


def _prior_outside(evidence: Evidence[Any], statement: Statement) -> float:
    """Log of the prior of each kind of cause outside the table: fitted, of a free form, or any."""
    kinds = 1 + bool(evidence.unlisted) + (evidence.flexible is not None)
    return log(statement.outside / kinds)


def _with_more(scores: Sequence[Score], believed: Array) -> Array:
    """Log probabilities of hypotheses, raised where a cause is at the end of its range.

    Physics ends the range, but only roughly. With more of the cause, the hypothesis would be
    something between as probable as it is and as the most probable one: the middle is taken.
    """
    ends = [not {*score.causes}.isdisjoint(score.cut_off) for score in scores]
    return np.where(ends, 0.5 * (believed + believed.max()), believed)


def _beyond_simpler_laws(scores: Sequence[Score], likelihood: Array) -> Array:
    """Log likelihoods in which a richer law counts for what it explains beyond a simpler one.

    For some values of its numbers the richer law is the simpler one (`NESTED`). Where it explains
    no more, it is that law, and no other cause.
    """
    known: dict[frozenset[str], float] = {}
    for score, value in zip(scores, likelihood.tolist(), strict=True):
        if not score.unlisted:
            causes = frozenset(score.causes)
            known[causes] = max(value, known.get(causes, -np.inf))
    found = likelihood.copy()
    for place, score in enumerate(scores):
        causes = frozenset(score.causes)
        for simple, rich in NESTED:
            if rich not in causes or score.unlisted:
                continue
            gain = likelihood[place] - known.get(causes - {rich} | {simple}, -np.inf)
            beyond = np.log(-np.expm1(-gain)) if gain > 0.0 else -np.inf
            found[place] = min(found[place], likelihood[place] + beyond)
    return found


def _beliefs(evidence: Evidence[Any], rules: Rules) -> tuple[dict[str, float], dict[str, float]]:
    """Log of prior times likelihood of each set of causes, and of each kind of cause outside.

    A part of an error that matters is ordinary on every rig. Of several hypotheses with the same
    causes, the likeliest counts. The first cause outside, with an empty name, is any cause at
    all.
    """
    statement = rules.statement
    present = evidence.present
    noise = evidence.floor[present]
    least = (statement.least_background * rules.decision.material_share) ** 2 * evidence.motion
    background = np.maximum(evidence.background, least)[present]
    scores = [evidence.nominal, *evidence.finalists, *evidence.unlisted]
    if evidence.flexible is not None:
        scores.append(evidence.flexible)
    left = np.array([score.mean_square[present] for score in scores])
    left = np.nan_to_num(left, nan=DIVERGED, posinf=DIVERGED)
    over = np.log(np.maximum(left / (noise + background), 1.0)).sum(axis=1)
    usual = [k for k, score in enumerate(scores) if not score.causes and not score.unlisted]
    without = left[min(usual, key=over.__getitem__)]
    change = np.maximum(without - left, 0.0)
    is_sharp = np.array([SEVERAL.isdisjoint(one.causes) and not one.unlisted for one in scores])
    likelihood = log_likelihood(left, noise, background, change, is_sharp, statement)
    likelihood = _beyond_simpler_laws(scores, likelihood)
    likelihood -= statement.number_price * np.array([score.free_numbers for score in scores])
    prior, outside = prior_of_sets(statement), _prior_outside(evidence, statement)
    beforehand = np.array([
        prior[min(score.size, len(prior) - 1)] if not score.unlisted
        else outside - statement.flexible_price * noise.size if score is evidence.flexible
        else outside - log(len(evidence.unlisted))
        for score in scores
    ])  # fmt: skip
    believed = _with_more(scores, likelihood + beforehand)
    beyond = {"": outside + log_likelihood_of_unknown(without, noise, background, statement)}
    sets: dict[str, float] = {}
    for score, value, before in zip(scores, believed.tolist(), beforehand.tolist(), strict=True):
        if score.unlisted:
            beyond[score.unlisted] = value
        else:
            name = " + ".join(sorted(score.causes)) or NONE
            sets[name] = max(value - before, sets.get(name, -np.inf))
    return _with_hidden(sets, statement), beyond


def posterior(evidence: Evidence[Any], rules: Rules) -> dict[str, float]:
    """Probability of each explanation, largest first; their names are those of diagnosis.json.

    A cause may have a second one beside it that is too small to be seen: it leaves the likelihood
    as it is. Explanations that are less probable than `LEAST_KEPT` are left out, but neither `none`
    nor `unknown` is.

    Parameters
    ----------
    evidence : Evidence
        What a search found.
    rules : Rules
        What is believed beforehand, and what matters.
    """
    found, beyond = _beliefs(evidence, rules)
    found[UNKNOWN] = float(logsumexp(np.array([*beyond.values()])))
    values = np.array(list(found.values()))
    shares = np.exp(values - logsumexp(values)).tolist()
    ranked = sorted(zip(found, shares, strict=True), key=lambda pair: -pair[1])
    kept = {n: p for n, p in ranked if p >= LEAST_KEPT or n in (NONE, UNKNOWN)}
    total = sum(kept.values())
    return {name: share / total for name, share in kept.items()}


def most_probable_outside(evidence: Evidence[Any], rules: Rules) -> str:
    """The cause outside the table that makes most of the probability of `unknown`, in words.

    Empty if none of them does, or a law that is not known.
    """
    _, beyond = _beliefs(evidence, rules)
    first = max(beyond, key=beyond.__getitem__)
    share = np.exp(beyond[first] - logsumexp(np.array([*beyond.values()])))
    known = {score.unlisted for score in evidence.unlisted}
    return first if share >= 0.5 and first in known else ""


def _with_hidden(likelihood: Mapping[str, float], statement: Statement) -> dict[str, float]:
    """Log of prior times likelihood of each set of causes, also of those with a hidden cause.

    Parameters
    ----------
    likelihood : mapping
        Set of causes, by name -> log likelihood.
    statement : Statement
        What is believed beforehand.
    """
    prior = prior_of_sets(statement)
    found: dict[str, float] = {}

    def add(name: str, value: float) -> None:
        found[name] = float(np.logaddexp(value, found.get(name, -np.inf)))

    for name, value in likelihood.items():
        causes = [] if name == NONE else name.split(" + ")
        believed = value + prior[min(len(causes), len(prior) - 1)]
        if len(causes) != 1:
            add(name, believed)
            continue
        add(name, believed + log(1.0 - statement.hidden))
        others = sorted(EFFECTS.keys() - {name})
        for other in others:
            second = " + ".join(sorted((name, other)))
            add(second, believed + log(statement.hidden / len(others)))
    return found


type Sets = tuple[frozenset[str], ...]


@dataclass(frozen=True, slots=True)
class Choice:
    """An answer that could be given: a word, and sets of causes, one of which is said to hold."""

    verdict: str
    sets: Sets = ()

    def cost(self, truth: str, statement: Statement) -> float:
        """Cost of this answer if an explanation is the true one."""
        if not self.sets:
            if truth == self.verdict:
                return 0.0
            return statement.silence * (0.5 if truth in (NONE, UNKNOWN) else 1.0)
        if truth in (NONE, UNKNOWN):
            return statement.false_name
        hidden = {*truth.split(" + ")}
        return statement.further_name * (len(self.sets) - 1) + min(
            statement.false_name * len(one - hidden) / len(one)
            + statement.silence * len(hidden - one) / len(hidden)
            for one in self.sets
        )


def least_cost(probabilities: Mapping[str, float], statement: Statement) -> Choice:
    """The answer with the least expected cost.

    Parameters
    ----------
    probabilities : mapping
        Explanation -> probability, largest first.
    statement : Statement
        Its costs.
    """
    names = [name for name in probabilities if name not in (NONE, UNKNOWN)][:CONSIDERED]
    sets = [frozenset(name.split(" + ")) for name in names]
    choices = [Choice(NONE), Choice(UNKNOWN)]
    choices += [Choice("named", (one,)) for one in sets]
    for count in range(2, MOST_ALTERNATIVES + 1):
        choices += [Choice("ambiguous", few) for few in combinations(sets, count)]
    return min(
        choices,
        key=lambda one: sum(p * one.cost(truth, statement) for truth, p in probabilities.items()),
    )
