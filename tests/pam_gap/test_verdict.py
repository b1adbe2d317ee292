"""What turns scores into a verdict: shares of the gap, rivals, richer laws, order of equals."""

from __future__ import annotations

import numpy as np
import pytest

from pam_gap.inference.decision import Judge
from pam_gap.inference.score import Score
from pam_gap.inference.selection import contains
from pam_gap.inference.verdict import Figures, closed_by_channel, verdict_of
from pam_gap.rules import DEFAULT

BLOCKS = 12
RULES = DEFAULT.decision


def score(effects: tuple[str, ...], level: float, free: int = 1) -> Score:
    """A held-out score of one channel with this level, blocks a little apart."""
    generator = np.random.default_rng(sum(map(len, effects)))
    spread = np.exp(0.01 * generator.standard_normal((BLOCKS, 1)))
    sums = np.exp(level) * spread / spread.mean()
    free_numbers = max(len(effects) - 1, 0) + free
    return Score(effects, " + ".join(effects), free_numbers, sums, np.ones((BLOCKS, 1)))


@pytest.fixture
def judge() -> Judge:
    """One channel whose floor is 1."""
    return Judge(np.ones(1), np.ones(1, dtype=bool), RULES)


def test_a_channel_with_hardly_a_gap_does_not_veto() -> None:
    before, after = np.array([190.0, 190.0, 2.2]), np.array([12.0, 12.0, 3.7])
    assert closed_by_channel(before, after, RULES) > 0.85
    assert closed_by_channel(before[::-1], after[::-1], RULES) == closed_by_channel(
        before, after, RULES
    )


def test_shares_are_those_of_channels_with_a_gap() -> None:
    assert closed_by_channel(np.array([11.0, 1.2]), np.array([1.0, 1.2]), RULES) == 1.0
    assert closed_by_channel(np.array([11.0, 11.0]), np.array([1.0, 11.0]), RULES) == pytest.approx(
        0.5
    )
    assert closed_by_channel(np.array([1.1]), np.array([1.1]), RULES) == 1.0


def test_of_two_that_leave_the_same_the_simpler_leads(judge: Judge) -> None:
    nominal = score((), 5.0)
    scores = [score(("end_caps",), 0.43, free=2), score(("pulley_radius",), 0.45)]
    chosen = judge.choose(nominal, scores)
    assert chosen is not None
    assert chosen.effects == ("pulley_radius",)
    assert [r.effects for r in judge.rivals(chosen, scores, nominal)] == [("end_caps",)]


def test_a_second_effect_must_pay(judge: Judge) -> None:
    nominal = score((), 9.0)
    alone = score(("creep",), 2.0)
    for level, expected in ((1.7, ("creep",)), (0.1, ("creep", "leakage"))):
        chosen = judge.choose(nominal, [alone, score(("creep", "leakage"), level)])
        assert chosen is not None
        assert chosen.effects == expected


def test_a_richer_law_contains_the_simple_one() -> None:
    assert contains(("stribeck_friction", "creep"), ("creep", "coulomb_friction"))
    assert not contains(("coulomb_friction",), ("stribeck_friction",))
    assert not contains(("creep",), ("creep",))


@pytest.mark.parametrize(
    ("rich", "named", "others"),
    [
        (3.95, "coulomb_friction", []),
        (3.5, "coulomb_friction", ["stribeck_friction"]),
        (2.0, "stribeck_friction", []),
    ],
)
def test_a_richer_law_is_a_rival_where_it_leaves_less(
    judge: Judge, rich: float, named: str, others: list[str]
) -> None:
    nominal = score((), 20.0)
    scores = [score(("coulomb_friction",), 4.0), score(("stribeck_friction",), rich, free=4)]
    chosen = judge.choose(nominal, scores)
    assert chosen is not None
    assert chosen.effects == (named,)
    rivals = judge.rivals(chosen, scores, nominal)
    assert [r.effects[0] for r in rivals] == others


def test_no_gap_and_no_gain_are_no_names() -> None:
    assert verdict_of(Figures((), 0.1, 0.1, 3, 0.0), (), RULES) == "none"
    assert verdict_of(Figures(("creep",), 9.0, 8.9, 3, 0.0), (), RULES) == "unknown"
    assert verdict_of(Figures(("creep",), 9.0, 1.0, 3, 0.9), (), RULES) == "named"
    assert verdict_of(Figures(("creep",), 9.0, 1.0, 3, 0.9), ("hysteresis",), RULES) == "ambiguous"
