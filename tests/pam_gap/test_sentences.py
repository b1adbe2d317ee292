"""The verdict in one sentence."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pam_gap.answer.diagnosis import Diagnosis, ScoredCandidate
from pam_gap.answer.sentences import verdict_sentence
from pam_gap.inference.confidence import Interval

CLOSED = Interval(0.94, 0.9, 0.97)
FOUND = Diagnosis("named", "muscle", ("hysteresis",), (), (), {}, {}, CLOSED, "")


def test_a_cause_is_named_with_what_it_explains() -> None:
    assert verdict_sentence(FOUND) == (
        "The cause is hysteresis at the muscle stage. It closes 94 % of the gap on held-out data."
    )


@pytest.mark.parametrize(
    ("groups", "words"),
    [
        ((("hysteresis", "coulomb_friction"),), "between hysteresis and coulomb friction."),
        ((("a", "b", "c"), ("d", "e")), "between a, b and c; nor between d and e."),
    ],
)
def test_sets_that_cannot_be_distinguished_are_listed(
    groups: tuple[tuple[str, ...], ...], words: str
) -> None:
    ambiguous = replace(FOUND, verdict="ambiguous", indistinguishable=groups)
    assert f"this recording cannot distinguish {words}" in verdict_sentence(ambiguous)


def test_an_unknown_cause_says_what_the_best_known_effect_leaves() -> None:
    best = ScoredCandidate(
        ("dead_volume", "leakage"), 0.9, CLOSED, level=4.0, over_floor=(2.0, 7.3, 1.1)
    )
    unknown = replace(FOUND, verdict="unknown", effects=(), closed=None, ranking=(best,))
    assert verdict_sentence(unknown) == (
        "Cause unknown at the muscle stage: the best known effect (dead volume with leakage) still "
        "leaves an error of 7.3 times the noise floor, which is more than its law should leave."
    )


def test_nothing_to_explain_is_said() -> None:
    none = replace(FOUND, verdict="none", stage=None, effects=(), closed=None)
    assert verdict_sentence(none).startswith("No effect is needed")
