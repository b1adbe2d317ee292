"""Another way to the probabilities: weights learned from drawn rigs, in place of the statement.

Every hypothesis that a diagnosis has fitted gets a score, a weighted sum of what it leaves on
held-out data, of its size and its kind, and of the effects that it contains. The probability of a
hypothesis is the softmax of these scores (a conditional logit: McFadden, Conditional logit analysis
of qualitative choice behavior, 1973). The weights are those that make what is hidden most probable
on drawn rigs, with a penalty for large ones; they know nothing of laws, noise or costs. The
comparison is cross-validated: a rig is judged by weights that were learned from other rigs, of the
same kinds and of others.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp

from pam_check.blind.calibrate_statement import believed
from pam_check.blind.score import LEAST_PROBABILITY, hidden_explanation
from pam_check.blind.sensitivity import Campaign
from pam_gap.inference.evidence import Evidence
from pam_gap.inference.probabilities import NONE, UNKNOWN
from pam_gap.inference.score import Score
from pam_gap.prediction.fit import Array
from pam_gap.rules.statement import STATEMENT
from pam_model.command_line import Arguments, Outcome
from pam_model.effects import EFFECTS
from pam_model.errors import PamError

PENALTY = 0.001
"""Weight of the squares of the learned weights, of features of unit spread."""
PARTS = 3
"""Of the cross-validation."""


@dataclass(frozen=True, slots=True)
class LearningRig:
    """What the hypotheses of one rig show, and which of them are right.

    Attributes
    ----------
    features : ndarray, shape (hypotheses, features)
        Of each hypothesis; the last one is any cause outside the table.
    right : ndarray, shape (hypotheses,)
        Log of the share of a hypothesis' probability that goes to what is hidden.
    """

    features: Array
    right: Array


def _right(name: str, hidden: str) -> float:
    """Log of the share of this explanation that is for what is hidden; as in the statement."""
    causes = hidden.split(" + ")
    if name == hidden:
        alone = len(causes) == 1 and hidden not in (NONE, UNKNOWN)
        return log(1.0 - STATEMENT.hidden) if alone else 0.0
    if len(causes) == 2 and name in causes:
        return log(STATEMENT.hidden / (len(EFFECTS) - 1))
    return -np.inf


def _features(left: Array, gap: float, score: Score, kind: str) -> list[float]:
    """Of a hypothesis that leaves these logarithms of mean squares over the usual ones."""
    size = score.size if kind == "table" else 0
    named = set(score.causes) if kind == "table" else set()
    return [
        float(np.mean(np.maximum(left, 0.0))), float(left.max()),
        float(np.mean(np.minimum(left, 0.0))), float(score.free_numbers),
        *(float(size == n and kind == "table") for n in (0, 1, 2)),
        *(float(kind == other) for other in ("fitted", "flexible", "any")),
        float(not named.isdisjoint(score.cut_off)),
        gap * bool(named), gap * (size > 1), gap * (kind != "table"),
        *(float(name in named) for name in sorted(EFFECTS)),
    ]  # fmt: skip


def learning_rig(evidence: Evidence[Score], label: Mapping[str, Any]) -> LearningRig:
    """What there is to learn from one drawn rig."""
    present, hidden = evidence.present, hidden_explanation(label)
    usual = (evidence.floor + evidence.background)[present]
    kinds = [(evidence.nominal, "table"), *((score, "table") for score in evidence.finalists)]
    kinds += [(score, "fitted") for score in evidence.unlisted]
    if evidence.flexible is not None:
        kinds.append((evidence.flexible, "flexible"))
    kinds.append((evidence.nominal, "any"))
    largest = 1e12  # in place of a mean square that is not finite
    without = np.log(np.nan_to_num(evidence.nominal.mean_square[present] / usual, nan=largest))
    rows, right = [], []
    for score, kind in kinds:
        square = np.nan_to_num(score.mean_square[present], nan=largest, posinf=largest)
        rows.append(_features(np.log(square / usual), float(np.mean(without)), score, kind))
        name = " + ".join(sorted(score.causes)) or NONE if kind == "table" else UNKNOWN
        right.append(_right(name, hidden))
    return LearningRig(np.array(rows), np.array(right))


def _log_probability(weights: Array, rig: LearningRig) -> tuple[float, Array]:
    """Log of the probability of what is hidden, and its slope over the weights."""
    scores = rig.features @ weights
    scores = scores - logsumexp(scores)
    found = float(logsumexp(scores + rig.right)) if np.isfinite(rig.right).any() else -np.inf
    if found < log(LEAST_PROBABILITY):
        return log(LEAST_PROBABILITY), np.zeros_like(weights)
    share = np.exp(scores + rig.right - found)
    slope: Array = share @ rig.features - np.exp(scores) @ rig.features
    return found, slope


def learned(rigs: Sequence[LearningRig]) -> Array:
    """The weights that make what is hidden most probable on these rigs."""
    spread = np.minimum(np.std(np.vstack([rig.features for rig in rigs]), axis=0), 3.0)

    def objective(weights: Array) -> tuple[float, Array]:
        values, slopes = zip(*(_log_probability(weights, rig) for rig in rigs), strict=True)
        value = -np.mean(values) + PENALTY * np.sum((weights * spread) ** 2)
        slope = -np.mean(slopes, axis=0) + 2.0 * PENALTY * weights * spread**2
        return float(value), slope

    start = np.zeros(rigs[0].features.shape[1])
    found = minimize(objective, start, jac=True, method="L-BFGS-B", options={"maxiter": 500})
    weights: Array = found.x
    return weights


def surprise_of_learned(rigs: Sequence[LearningRig], parts: Sequence[int]) -> float:
    """Mean surprise on the rigs of each part, by weights learned from all other parts."""
    total = 0.0
    for k in set(parts):
        weights = learned([rig for rig, own in zip(rigs, parts, strict=True) if own != k])
        judged = (rig for rig, own in zip(rigs, parts, strict=True) if own == k)
        total -= sum(_log_probability(weights, rig)[0] for rig in judged)
    return total / len(rigs)


def kind_of(campaign: Campaign) -> str:
    """What rigs a campaign has: with a background, of many kinds, of which plant."""
    drawn = json.loads((campaign.folder / "seal.json").read_text())["drawn"]
    return json.dumps({name: drawn[name] for name in sorted(drawn.keys() - {"cases", "seed"})})


def run(given: Arguments) -> Outcome:
    """Print the surprise of both ways; the command of `pam_check.__main__`.

    Raises
    ------
    PamError
        When the folders contain too few diagnosed rigs, or all of one kind.
    """
    campaigns = [Campaign.read(folder) for folder in given.folders]
    kinds = sorted({kind_of(campaign) for campaign in campaigns})
    rigs, of_kind = [], []
    for campaign in campaigns:
        for label in campaign.labels:
            if label["case"] in campaign.evidence:
                rigs.append(learning_rig(campaign.evidence[label["case"]], label))
                of_kind.append(kinds.index(kind_of(campaign)))
    if len(rigs) < 2 * PARTS or len(kinds) < 2:
        raise PamError(
            f"{len(rigs)} diagnosed rigs of {len(kinds)} kinds (with a background, without, of "
            f"many kinds, second plant); expected at least {2 * PARTS} of two"
        )
    mixed = (np.random.default_rng(1).permutation(len(rigs)) % PARTS).tolist()
    surprise = {
        "statement": believed(campaigns, STATEMENT),
        "learned from other rigs": surprise_of_learned(rigs, mixed),
        "learned from rigs of other kinds": surprise_of_learned(rigs, of_kind),
    }
    weights = int(rigs[0].features.shape[1])
    print(f"mean surprise over {len(rigs)} rigs, {weights} learned weights (smaller is better):")
    for name, value in surprise.items():
        print(f"{name:34s} {value:.3f}")
    return Outcome({"rigs": len(rigs), "weights": weights, "surprise": surprise})
