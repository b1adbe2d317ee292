"""A gap that does not matter is no cause; what matters is told in the user's units."""

from dataclasses import replace

import numpy as np
import pytest

from pam_gap.answer.diagnosis import Diagnosis, FoundParameter, ScoredCandidate
from pam_gap.answer.sentences import verdict_sentence
from pam_gap.answer.user_units import percent, plain, told
from pam_gap.answer.write_answer import why_preferred
from pam_gap.diagnosis_engine import JointDiagnosis
from pam_gap.inference.candidates import candidates_for
from pam_gap.inference.confidence import Interval, parameter_intervals
from pam_gap.inference.decide import decide
from pam_gap.inference.evidence import Evidence
from pam_gap.inference.score import Score
from pam_gap.prediction.materiality import GapSize, gap_sizes, motion_ranges, squared_motion
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.rules import changed
from pam_model.rig import Rig

from .conftest import Maker

POSITION = "joint_states.elbow.position"


def score(effects: tuple[str, ...], rms: float) -> Score:
    counts = np.full((30, 3), 40.0)
    return Score(effects, " + ".join(effects), len(effects), counts * rms**2, counts)


def decided(nominal: float, left: float, motion: float, share: float = 0.001) -> str:
    """The verdict for errors of so many floors, in channels that moved by `motion` floors."""
    kept = Evidence(
        floor=np.ones(3),
        background=np.zeros(3),
        present=np.ones(3, dtype=bool),
        motion=np.full(3, motion**2),
        written=score((), nominal),
        nominal=score((), nominal),
        tried=(score(("position_offset",), left), score(("leakage",), nominal)),
        singles=("position_offset", "leakage"),
        stages=(),
    )
    return decide(kept, changed("decision.material_share", share)).verdict


@pytest.mark.parametrize(
    ("nominal", "left", "motion", "share", "verdict"),
    [
        (4.0, 1.0, 10000.0, 0.001, "none"),  # 4 floors are 0.04 % of the motion
        (4.0, 1.0, 10000.0, 0.0, "named"),
        (4.0, 1.0, 1000.0, 0.001, "named"),
        (4.0, 3.5, 2000.0, 0.001, "none"),  # 0.2 % that nothing explains
        (4.0, 3.5, 1000.0, 0.001, "unknown"),  # 0.4 % that nothing explains
        (100.0, 8.0, 1000.0, 0.001, "named"),  # what is left is said: 0.8 % of the motion
        (100.0, 8.0, 10000.0, 0.001, "named"),  # 8 floors do not matter here
        (1.05, 1.0, 0.0, 0.001, "none"),
    ],
)
def test_small_gaps_are_no_cause_and_small_rests_no_reason_for_unknown(
    nominal: float, left: float, motion: float, share: float, verdict: str
) -> None:
    """A demo with nothing hidden was `unknown`, for 0.3 mrad of a motion of 0.7 rad."""
    assert decided(nominal, left, motion, share) == verdict


def test_the_limit_belongs_to_each_channel(rig: Rig, record: Maker) -> None:
    problem = PredictionProblem(rig, 0, [record()])
    ranges, squares = motion_ranges(problem), squared_motion(problem)
    assert 0.2 < ranges[2] < 2.0  # rad
    assert 5e4 < ranges[0] < 6e5  # Pa
    floor, square = np.ones(5), np.zeros(5)
    square[2] = 1.0 + 0.003**2 * squares[2]
    position, *others = gap_sizes(problem, floor, 0.002, 0.006, [square + 1.0, square, square])
    assert position.channel == POSITION
    assert position.is_material
    assert position.share == pytest.approx(0.003)
    assert position.retuned == pytest.approx(0.003 * ranges[2])
    assert not any(size.is_material for size in others)


SIZE = GapSize(POSITION, "rad", "joint", 0.7, 0.0071, 0.0066, 0.0009, 1e-4, 0.0007, 0.0021)
NAMED = Diagnosis(
    "named", "joint", ("coulomb_friction",), (), (),
    {"coulomb_friction": {"torque": FoundParameter(Interval(1.12, 1.05, 1.18), "N m")}},
    {}, Interval(0.99, 0.9, 1.0), "", sizes=(SIZE,), material_share=0.001,
)  # fmt: skip


def test_the_answer_says_where_what_and_how_much() -> None:
    assert verdict_sentence(NAMED) == (
        "The cause is Coulomb friction at the joint stage: torque 1.12 N m (1.05 to 1.18). It "
        "explains 87 % of an error of 7.1 mrad at joint_states.elbow.position."
    )


def test_an_interval_is_never_shown_without_width() -> None:
    """A report said "torque 1.12 N m (1.12 to 1.12)"."""
    narrow = FoundParameter(Interval(1.1181, 1.1172, 1.1189), "N m")
    found = replace(NAMED, parameters={"coulomb_friction": {"torque": narrow}})
    assert "torque 1.118 N m (1.117 to 1.119)." in verdict_sentence(found)


def test_a_large_error_is_told_without_powers_of_ten() -> None:
    best = ScoredCandidate(("payload",), Interval(0.57, 0.4, 0.7), over_floor=(243.0,))
    unknown = replace(NAMED, verdict="unknown", effects=(), parameters={}, ranking=(best,))
    assert "an RMS error of 240 times the noise floor" in verdict_sentence(unknown)


def test_what_remains_is_said_if_it_matters() -> None:
    rest = replace(NAMED, sizes=(replace(SIZE, after=0.0022),))
    assert verdict_sentence(rest).endswith(
        "explains 69 % of an error of 7.1 mrad at joint_states.elbow.position. 2.2 mrad at "
        "joint_states.elbow.position remain unexplained, 0.31 % of its range."
    )
    left = rest.to_json()["leftover"]
    assert left["material"] is True
    assert (left["stage"], left["channel"], left["unit"]) == ("joint", POSITION, "rad")
    assert left["rms"] == pytest.approx(0.0022)
    assert NAMED.to_json()["leftover"]["material"] is False


def test_a_gap_that_does_not_matter_is_told_with_its_size_and_limit() -> None:
    small = replace(SIZE, before=0.0004, retuned=0.0003, after=0.0003)
    none = replace(NAMED, verdict="none", stage=None, effects=(), parameters={}, sizes=(small,))
    assert verdict_sentence(none) == (
        "The gap is too small to need a cause: the rig file, re-tuned within its tolerance, is "
        "wrong by 0.3 mrad at joint_states.elbow.position, 0.043 % of its range of 0.7 "
        "rad. This is below the limit of 0.1 % (0.7 mrad)."
    )
    larger = replace(none, sizes=(replace(small, retuned=0.0012),))
    assert verdict_sentence(larger).endswith(
        "No known effect explains this, and it is below the limit of 0.3 % (2.1 mrad)."
    )
    assert none.to_json()["materiality"]["limit"] == 0.001
    assert none.to_json()["materiality"]["material"] is False


def test_an_unknown_cause_says_how_large_the_gap_is_and_what_comes_closest() -> None:
    best = ScoredCandidate(("payload",), Interval(0.57, 0.4, 0.7), over_floor=(7.3,))
    unknown = replace(NAMED, verdict="unknown", effects=(), parameters={}, ranking=(best,))
    assert (
        "is unknown: the rig file, re-tuned within its tolerance, is wrong by 6.6 mrad at "
        "joint_states.elbow.position, 0.94 % of its range; the closest explanation removes 43 % "
        "of the gap; the best known effect (payload) still leaves"
    ) in verdict_sentence(unknown)


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [(3.01e-4, "rad", "0.3 mrad"), (0.7, "rad", "0.7 rad"), (1.23e5, "Pa", "120 kPa"),
     (150.0, "Pa", "150 Pa"), (-1e-9, "s", "-1e-06 ms"), (-0.0, "s", "0 ms"), (12.0, "N", "12 N"),
     (0.05, "-", "0.05")],
)  # fmt: skip
def test_values_are_told_in_units_that_people_use(value: float, unit: str, text: str) -> None:
    assert told(value, unit) == text


def test_numbers_have_no_needless_exponent() -> None:
    assert [plain(v) for v in (12345.0, 0.5, -0.0)] == ["12300", "0.5", "0"]
    assert [percent(v) for v in (0.99, 0.0007, 0.5)] == ["99 %", "0.07 %", "50 %"]


def test_a_better_fit_that_was_not_preferred_is_explained() -> None:
    """A cause was named while a pair left far less, without a word."""
    width = Interval(0.1, 0.05, 0.2)
    pair = ScoredCandidate(("creep", "hysteresis"), width, level=1.1)
    own = ScoredCandidate(("hysteresis",), width, level=1.4)
    text = why_preferred(("hysteresis",), [pair, own], 0.05)
    assert "creep + hysteresis fits this recording better" in text
    assert "%" not in text  # the probability of a cause is the only one that the page states
    assert "several causes at once are less probable beforehand" in text
    assert "(sum of the log errors 1.10 against 1.40)" in text
    assert why_preferred(("creep", "hysteresis"), [pair, own], 0.05) == ""
    assert why_preferred(("hysteresis",), [pair, own], 0.5) == ""
    single = replace(pair, effects=("creep",))
    assert "it needs fewer free numbers" in why_preferred(("hysteresis",), [single, own], 0.05)


def test_no_interval_has_zero_width(rig: Rig, record: Maker) -> None:
    """Neither at a bound, nor where all blocks agree."""
    engine = JointDiagnosis(rig, 0, [record({"coulomb_friction.torque": 0.6})])
    friction = next(c for c in candidates_for(rig, rig.joints[0]) if c.effect == "coulomb_friction")
    centres = [nuisance.free.centre for nuisance in engine.fitter.nuisances]
    start = np.concatenate([centres, friction.starts[0]])
    found = engine.fitter.fit((friction,), start, max_iterations=4)
    for place in ("found", "bound"):
        if place == "bound":
            found.result.values[len(centres) :] = [p.high for p in friction.free]
        for entry in parameter_intervals(engine.fitter, engine.folds, found):
            assert entry.high > entry.low, place
            assert entry.low <= entry.value <= entry.high
