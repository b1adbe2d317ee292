"""What turns scores into a verdict: shares of the gap, rivals, richer laws, order of equals."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pam_gap.diagnosis_engine import JointDiagnosis
from pam_gap.inference.held_out import HeldOut
from pam_gap.inference.selection import contains
from pam_gap.inference.verdict import Evidence, closed_by_channel, decide

BLOCKS = 12


def score(effects: tuple[str, ...], level: float, free: int = 1) -> HeldOut:
    """A held-out score of one channel with this level, blocks a little apart."""
    generator = np.random.default_rng(sum(map(len, effects)))
    spread = np.exp(0.01 * generator.standard_normal((BLOCKS, 1)))
    sums = np.exp(level) * spread / spread.mean()
    members = tuple(
        SimpleNamespace(effect=e, label=e, free=(None,) * (free if i == 0 else 1))
        for i, e in enumerate(effects)
    )
    hypothesis = SimpleNamespace(effects=effects, members=members, label=" + ".join(effects))
    return HeldOut(hypothesis, sums, np.ones((BLOCKS, 1)), ())


@pytest.fixture
def engine() -> JointDiagnosis:
    """The choosing part alone: one channel whose floor is 1."""
    it = JointDiagnosis.__new__(JointDiagnosis)
    it.floor, it.present = np.ones(1), np.ones(1, dtype=bool)
    return it


def test_a_channel_with_hardly_a_gap_does_not_veto() -> None:
    before, after = np.array([190.0, 190.0, 2.2]), np.array([12.0, 12.0, 3.7])
    assert closed_by_channel(before, after) > 0.85
    assert closed_by_channel(before[::-1], after[::-1]) == closed_by_channel(before, after)


def test_shares_are_those_of_channels_with_a_gap() -> None:
    assert closed_by_channel(np.array([11.0, 1.2]), np.array([1.0, 1.2])) == 1.0
    assert closed_by_channel(np.array([11.0, 11.0]), np.array([1.0, 11.0])) == pytest.approx(0.5)
    assert closed_by_channel(np.array([1.1]), np.array([1.1])) == 1.0


def test_of_two_that_leave_the_same_the_simpler_leads(engine: JointDiagnosis) -> None:
    nominal = score((), 5.0)
    scores = [score(("end_caps",), 0.43, free=2), score(("pulley_radius",), 0.45)]
    chosen = engine.choose(nominal, scores)
    assert chosen is not None
    assert chosen.hypothesis.effects == ("pulley_radius",)
    assert [r.hypothesis.effects for r in engine.rivals(chosen, scores, nominal)] == [("end_caps",)]


def test_a_second_effect_must_pay(engine: JointDiagnosis) -> None:
    nominal = score((), 9.0)
    alone = score(("creep",), 2.0)
    for level, expected in ((1.7, ("creep",)), (0.1, ("creep", "leakage"))):
        chosen = engine.choose(nominal, [alone, score(("creep", "leakage"), level)])
        assert chosen is not None
        assert chosen.hypothesis.effects == expected


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
    engine: JointDiagnosis, rich: float, named: str, others: list[str]
) -> None:
    nominal = score((), 20.0)
    scores = [score(("coulomb_friction",), 4.0), score(("stribeck_friction",), rich, free=4)]
    chosen = engine.choose(nominal, scores)
    assert chosen is not None
    assert chosen.hypothesis.effects == (named,)
    rivals = engine.rivals(chosen, scores, nominal)
    assert [r.hypothesis.effects[0] for r in rivals] == others


def test_no_gap_and_no_gain_are_no_names() -> None:
    assert decide(Evidence((), 0.1, 0.1, 3, 0.0), ()) == "none"
    assert decide(Evidence(("creep",), 9.0, 8.9, 3, 0.0), ()) == "unknown"
    assert decide(Evidence(("creep",), 9.0, 1.0, 3, 0.9), ()) == "named"
    assert decide(Evidence(("creep",), 9.0, 1.0, 3, 0.9), ("hysteresis",)) == "ambiguous"
