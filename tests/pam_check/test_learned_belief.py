"""The weights that are learned in place of the statement: what they can learn, and from whom."""

from __future__ import annotations

import numpy as np
import pytest

from pam_check.blind.learned_belief import LearningRig, learned, surprise_of_learned


def rigs(count: int, sign: float, seed: int) -> list[LearningRig]:
    """Rigs with three hypotheses; that with the largest (or smallest) value is right."""
    draw = np.random.default_rng(seed)
    made = []
    for _ in range(count):
        values = draw.normal(size=(3, 2))
        best = int(np.argmax(sign * values[:, 0]))
        made.append(LearningRig(values, np.where(np.arange(3) == best, 0.0, -np.inf)))
    return made


def test_what_shows_the_hidden_cause_gets_the_weight() -> None:
    weights = learned(rigs(200, 1.0, 3))
    assert weights[0] > 5.0 * abs(weights[1])


def test_a_rig_is_judged_by_weights_of_other_rigs() -> None:
    """Of two kinds with opposite laws, weights of one are worse than chance for the other."""
    both = rigs(60, 1.0, 1) + rigs(60, -1.0, 2)
    kinds = [0] * 60 + [1] * 60
    chance = np.log(3.0)
    assert surprise_of_learned(both, kinds) > 1.5 * chance
    same = rigs(120, 1.0, 1)
    assert surprise_of_learned(same, [k % 3 for k in range(120)]) < 0.5 * chance


def test_what_no_hypothesis_names_counts_as_least_probable_and_teaches_nothing() -> None:
    lost = LearningRig(np.eye(3), np.full(3, -np.inf))
    known = rigs(50, 1.0, 5)
    features = [LearningRig(np.column_stack([r.features, np.zeros(3)]), r.right) for r in known]
    with_lost, without = learned([*features, lost]), learned(features)
    assert with_lost == pytest.approx(without, rel=0.1, abs=0.1)
