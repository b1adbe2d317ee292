"""The verdict in one sentence."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pam_gap.answer.diagnosis import ChannelGap, Diagnosis, ScoredCandidate
from pam_gap.answer.headline import headline
from pam_gap.answer.sentences import verdict_sentence
from pam_gap.inference.confidence import Interval
from pam_gap.prediction.materiality import GapSize

CLOSED = Interval(0.94, 0.9, 0.97)
FOUND = Diagnosis("named", "muscle", ("hysteresis",), (), (), {}, {}, CLOSED, "")


def test_a_cause_is_named_with_what_it_explains() -> None:
    assert verdict_sentence(FOUND) == (
        "The cause is hysteresis at the muscle stage. It explains 94 % of the gap on held-out data."
    )


def test_two_causes_are_named_each_at_its_own_stage() -> None:
    two = replace(FOUND, effects=("hysteresis", "coulomb_friction"))
    assert verdict_sentence(two) == (
        "The causes are hysteresis (muscle stage) and Coulomb friction (joint stage). They "
        "explain 94 % of the gap on held-out data."
    )


def test_a_cause_is_told_with_the_probability_of_all_explanations_that_contain_it() -> None:
    found = {"hysteresis": 0.5, "hysteresis + creep": 0.3, "creep": 0.1, "unknown": 0.1}
    sure = replace(FOUND, probabilities=found)
    assert sure.cause_probabilities == {"hysteresis": 0.8}
    assert sure.to_json()["cause_probabilities"] == {"hysteresis": 0.8}
    assert verdict_sentence(sure).startswith(
        "The cause is hysteresis at the muscle stage, with a probability of 80 %. It explains"
    )


def test_a_cause_that_is_probably_wrong_is_not_told_as_certain() -> None:
    found = {"hysteresis": 0.4, "creep": 0.35, "unknown": 0.25}
    assert verdict_sentence(replace(FOUND, probabilities=found)).startswith(
        "The most probable of several causes is hysteresis at the muscle stage, with a "
        "probability of 40 %."
    )
    two = {"hysteresis + coulomb_friction": 0.3, "hysteresis": 0.6, "none": 0.1}
    both = replace(FOUND, effects=("hysteresis", "coulomb_friction"), probabilities=two)
    assert verdict_sentence(both).startswith(
        "The causes are hysteresis (muscle stage, 90 %) and Coulomb friction (joint stage, 30 %)."
    )


@pytest.mark.parametrize(
    ("groups", "words"),
    [
        (
            (("hysteresis", "coulomb_friction"),),
            "between hysteresis (muscle stage) and Coulomb friction (joint stage).",
        ),
        (
            (("hysteresis", "leakage", "creep"), ("payload", "coulomb_friction")),
            "between hysteresis (muscle stage), leakage (valve stage) and creep (muscle stage), "
            "or between payload (joint stage) and Coulomb friction (joint stage).",
        ),
    ],
)
def test_sets_that_cannot_be_distinguished_are_listed(
    groups: tuple[tuple[str, ...], ...], words: str
) -> None:
    ambiguous = replace(FOUND, verdict="ambiguous", indistinguishable=groups)
    assert f"this recording cannot distinguish {words}" in verdict_sentence(ambiguous)


def test_a_cause_outside_every_set_is_named_beside_them() -> None:
    ambiguous = replace(
        FOUND,
        verdict="ambiguous",
        effects=("payload", "hysteresis", "coulomb_friction"),
        indistinguishable=(("hysteresis", "coulomb_friction"),),
    )
    assert verdict_sentence(ambiguous).startswith(
        "The cause is payload (joint stage), and a further one, for which this recording cannot "
        "distinguish between hysteresis (muscle stage) and Coulomb friction (joint stage). The "
        "best hypothesis explains 94 % of the gap on held-out data."
    )


def test_a_cause_that_may_be_a_further_one_is_told_as_such() -> None:
    ambiguous = replace(
        FOUND,
        verdict="ambiguous",
        effects=("hysteresis", "payload"),
        indistinguishable=(("payload",),),
        probabilities={"hysteresis": 0.5, "hysteresis + payload": 0.5},
    )
    assert verdict_sentence(ambiguous).startswith(
        "The cause is hysteresis (muscle stage, over 99 %). What this recording does not show is "
        "whether there is a further one: payload (joint stage, 50 %)."
    )
    assert headline(ambiguous) == "Hysteresis, perhaps with payload"


def test_an_unknown_cause_says_what_the_best_known_effect_leaves() -> None:
    best = ScoredCandidate(
        ("dead_volume", "leakage"), CLOSED, level=4.0, over_floor=(2.0, 7.3, 1.1)
    )
    unknown = replace(FOUND, verdict="unknown", effects=(), closed=None, ranking=(best,))
    assert verdict_sentence(unknown) == (
        "The cause of the gap at the muscle stage is unknown: the best known effects (dead volume "
        "and leakage) still leave an RMS error of 7.3 times the noise floor in the worst channel, "
        "which is more than these should leave."
    )


def test_a_cause_outside_the_table_is_told_with_the_unknown() -> None:
    best = ScoredCandidate(("position_offset",), CLOSED, level=4.0, over_floor=(2.0,))
    name = "an eccentricity of the encoder"
    unknown = replace(
        FOUND, verdict="unknown", effects=(), closed=None, ranking=(best,), looks_like=name
    )
    assert verdict_sentence(unknown).endswith(
        "is unknown: it looks like an eccentricity of the encoder, which is no effect of the table "
        "but explains more than the best of the table (position offset)."
    )
    assert unknown.to_json()["looks_like"] == name


def test_nothing_to_explain_is_said() -> None:
    gap = {"a": ChannelGap(9.0, 1.2, 1.0, "Pa"), "b": ChannelGap(9.0, 2.0, 2.0, "rad")}
    none = replace(FOUND, verdict="none", stage=None, effects=(), closed=None, gap=gap)
    assert verdict_sentence(none) == (
        "No effect is needed: the rig file, with its parameters re-tuned within their tolerance, "
        "explains the recording down to the noise. The largest RMS error of a channel is 1.2 times "
        "its noise floor."
    )


def size(retuned: float, after: float, background: float) -> GapSize:
    """A gap in mrad of a joint that moves by 1 rad; 1 mrad is the limit, 3 if unexplained."""
    values = (1.0, 0.02, retuned / 1e3, after / 1e3, 1e-5, 1e-3, 3e-3, background / 1e3)
    return GapSize("joint_states.elbow.position", "rad", "joint", *values)


def test_a_gap_of_an_ordinary_background_is_told_as_such() -> None:
    none = replace(
        FOUND,
        verdict="none",
        effects=(),
        closed=None,
        sizes=(size(5.0, 5.0, 6.0),),
        ordinary=("hysteresis",),
    )
    assert verdict_sentence(none) == (
        "Ordinary imperfections: the rig file, re-tuned within its tolerance, is wrong by "
        "5 mrad at joint_states.elbow.position, 0.5 % of its range of 1 rad. This is no more than "
        "the 6 mrad that the small imperfections of a good rig can leave, and no effect exceeds "
        "them clearly. The recording also shows hysteresis of a size that every good rig has."
    )
    larger = verdict_sentence(replace(none, sizes=(size(9.0, 9.0, 6.0),)))
    assert "The small imperfections of a good rig leave 6 mrad or somewhat more" in larger


def test_effects_of_ordinary_size_are_told_beside_the_cause_and_so_is_what_remains() -> None:
    both = replace(FOUND, ordinary=("leakage",), sizes=(size(15.0, 5.0, 6.0),))
    assert verdict_sentence(both) == (
        "The cause is hysteresis at the muscle stage. It explains 75 % of an error of 20 mrad at "
        "joint_states.elbow.position. 5 mrad at joint_states.elbow.position remain unexplained, "
        "0.5 % of its range, no more than ordinary imperfections of a good rig leave. The "
        "recording also shows leakage of a size that every good rig has."
    )
