"""An ordinary background is no cause: it raises the floor."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pam_gap.inference.candidates import candidates_for, nuisances_for, ordinary_sizes
from pam_gap.inference.decision import Decision, Judge
from pam_gap.inference.named_effects import named_effects
from pam_gap.inference.probabilities import (
    agreed,
    cause_probabilities,
    cut_off_rivals,
    probabilities,
)
from pam_gap.inference.score import Score
from pam_gap.rules import DEFAULT
from pam_model.effects import EFFECTS
from pam_model.rig import load_rig
from pam_model.rig.types import ValveKind

ELBOW = load_rig(Path(__file__).parents[2] / "config" / "elbow.yaml")
CHANNELS, BLOCKS = 3, 16
PRESENT = np.ones(CHANNELS, dtype=bool)
BACKGROUND = np.array([8.0, 8.0, 40.0]) ** 2


def score(effects: tuple[str, ...], rms: tuple[float, float, float]) -> Score:
    counts = np.full((BLOCKS, CHANNELS), 40.0)
    spread = np.linspace(0.9, 1.1, BLOCKS)[:, None]
    sums = counts * np.array(rms) ** 2 * spread
    return Score(effects, " + ".join(effects), len(effects), sums, counts)


def decided(nominal: Score, *tried: Score, background: np.ndarray = BACKGROUND) -> Decision[Score]:
    judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT.decision, background=background)
    return judge.decide(nominal, tried)


def test_a_delay_that_leads_is_named_although_the_background_remains() -> None:
    nominal = score((), (33.0, 74.0, 90.0))
    tried = (
        score(("command_delay",), (4.0, 8.0, 30.0)),
        ordinary(score(("command_delay", "hysteresis"), (3.5, 7.0, 20.0)), "hysteresis"),
        score(("valve_lag",), (20.0, 40.0, 70.0)),
    )
    assert decided(nominal, *tried).verdict == "named"
    assert decided(nominal, *tried, background=np.zeros(CHANNELS)).verdict == "unknown"


def test_a_good_rig_with_a_background_is_told_none() -> None:
    nominal = score((), (7.0, 7.5, 35.0))
    fitted = ordinary(score(("hysteresis",), (5.5, 6.0, 25.0)), "hysteresis")
    assert decided(nominal, fitted).verdict == "none"
    assert decided(nominal, fitted, background=np.zeros(CHANNELS)).verdict != "none"


def test_a_background_that_is_larger_than_usual_is_not_called_an_unknown_cause() -> None:
    nominal, found = score((), (10.5, 10.5, 52.0)), score(("payload",), (9.9, 9.9, 49.0))
    assert decided(nominal, found).verdict == "none"
    assert decided(score((), (15.0, 15.0, 80.0)), found).verdict != "none"
    no = np.zeros(CHANNELS)
    assert decided(nominal, found, background=no).verdict == "unknown"


def test_a_cause_outside_the_table_must_remove_most_of_the_gap() -> None:
    """Of two explanations that explain little, the better one is no reason for `unknown`."""
    nominal, found = score((), (10.5, 10.5, 52.0)), score(("payload",), (9.9, 9.9, 49.0))
    encoder = replace(score((), (9.5, 9.5, 47.0)), unlisted="an eccentricity of the encoder")
    judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT.decision, background=BACKGROUND)
    decision = judge.decide(nominal, [found], [encoder])
    assert (decision.verdict, decision.better) == ("none", None)
    strong = score((), (33.0, 74.0, 90.0))
    decision = judge.decide(strong, [score(("payload",), (20.0, 30.0, 60.0))], [encoder])
    assert (decision.verdict, decision.better) == ("unknown", encoder)


def test_a_cause_outside_the_table_must_be_told_from_an_effect_that_is_as_simple() -> None:
    """Over a part of the range, an eccentric encoder of the right phase is an offset."""
    nominal = score((), (20.0, 20.0, 400.0))
    offset = score(("position_offset",), (9.0, 9.0, 120.0))
    judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT.decision, background=BACKGROUND)

    def verdict(offset: Score, share: np.ndarray) -> str:
        sums = np.where(np.arange(CHANNELS) == 2, share[:, None], 1.0) * offset.sums
        encoder = Score((), "", 2, sums, offset.counts, unlisted="an eccentricity of the encoder")
        return judge.decide(nominal, [offset], [encoder]).verdict

    assert verdict(offset, np.full(BLOCKS, 0.85)) == "named"
    assert verdict(offset, np.full(BLOCKS, 0.4)) == "unknown"
    several_numbers = replace(offset, free_numbers=4)
    assert verdict(several_numbers, np.full(BLOCKS, 0.85)) == "unknown"


def test_a_delay_may_leave_a_background_larger_than_usual() -> None:
    """That the law of a delay has only one form says nothing about what else the rig has."""
    nominal, delay = score((), (33.0, 74.0, 90.0)), score(("command_delay",), (15.0, 18.0, 75.0))
    assert decided(nominal, delay).verdict == "named"


def test_an_effect_outside_the_table_stays_unknown_beside_a_background() -> None:
    nominal = score((), (10.0, 10.0, 900.0))
    closest = score(("payload",), (9.0, 9.0, 700.0))
    assert decided(nominal, closest).verdict == "unknown"


def test_a_further_effect_that_fits_only_the_background_is_not_named() -> None:
    nominal = score((), (33.0, 74.0, 90.0))
    delay = score(("command_delay",), (6.0, 8.0, 38.0))
    pair = score(("command_delay", "coulomb_friction"), (5.0, 6.0, 20.0))
    chosen = decided(nominal, delay, pair).chosen
    assert chosen is not None
    assert chosen.effects == ("command_delay",)


def test_probabilities_follow_the_verdict_and_sum_to_one() -> None:
    nominal = score((), (33.0, 74.0, 90.0))
    delay = score(("command_delay",), (4.0, 8.0, 30.0))
    lag = score(("valve_lag",), (20.0, 40.0, 70.0))
    judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT.decision, background=BACKGROUND)

    def given(nominal: Score, *tried: Score) -> dict[str, float]:
        decision = judge.decide(nominal, tried)
        found = dict(probabilities(judge, nominal, decision))
        assert sum(found.values()) == pytest.approx(1.0)
        assert next(iter(found)) in (decision.verdict, "command_delay")
        return found

    pair = score(("command_delay", "hysteresis"), (3.5, 7.0, 20.0))
    assert given(nominal, delay, lag, ordinary(pair, "hysteresis"))["command_delay"] > 0.8
    usual = ordinary(score(("hysteresis",), (5.0, 5.5, 20.0)), "hysteresis")
    assert 0.5 < given(score((), (7.0, 7.5, 35.0)), delay, usual)["none"] < 0.75
    assert given(nominal, lag)["unknown"] > 0.8


def test_a_rival_at_the_end_of_its_range_lowers_the_probability_of_the_others() -> None:
    """It might explain as much with more of it; one that explains little changes nothing."""
    nominal = score((), (33.0, 74.0, 90.0))
    bladder = score(("bladder_elasticity",), (4.0, 8.0, 30.0))
    judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT.decision, background=BACKGROUND)

    def probability(rival: Score) -> float:
        decision = judge.decide(nominal, [bladder, rival])
        return probabilities(judge, nominal, decision)["bladder_elasticity"]

    caps = score(("end_caps",), (6.0, 13.0, 43.0))
    limited = replace(caps, cut_off=("end_caps",))
    assert probability(limited) < probability(caps) - 0.03
    assert probability(replace(caps, cut_off=("leakage",))) == probability(caps)
    weak = score(("end_caps",), (30.0, 70.0, 88.0))
    assert probability(replace(weak, cut_off=("end_caps",))) == probability(weak)


def test_only_a_rival_with_a_probability_that_is_shown_is_named() -> None:
    """One whose raised level is still far behind the named cause is no reason for a caution."""
    nominal = score((), (33.0, 74.0, 90.0))
    bladder = score(("bladder_elasticity",), (4.0, 8.0, 30.0))
    judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT.decision, background=BACKGROUND)

    def rivals(*others: Score) -> list[Score]:
        decision = judge.decide(nominal, [bladder, *others])
        found = probabilities(judge, nominal, decision)
        return cut_off_rivals(judge, nominal, decision, found, 0.005)

    near = replace(score(("end_caps",), (6.0, 13.0, 43.0)), cut_off=("end_caps",))
    far = replace(score(("tube_restriction",), (16.0, 36.0, 66.0)), cut_off=("tube_restriction",))
    assert rivals(far, near) == [near]
    assert not rivals(replace(near, cut_off=()))


def test_a_cause_can_hide_in_a_background_but_not_in_noise() -> None:
    """Where nothing stands out of a background, a weak cause may still be there."""
    nominal, found = score((), (1.0, 1.0, 1.0)), score(("viscous_friction",), (1.0, 1.0, 1.0))
    stated = {}
    for background in (BACKGROUND, np.zeros(CHANNELS)):
        judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT.decision, background=background)
        decision = judge.decide(nominal, [found])
        assert decision.verdict == "none"
        stated[judge.has_background] = probabilities(judge, nominal, decision)["none"]
    assert 0.5 < stated[True] < 0.8 * stated[False]


def test_the_verdict_agrees_with_the_most_probable_explanation() -> None:
    """A cause that leads all others by far is told, although it removes a little less than half."""
    nominal = score((), (15.0, 15.0, 22.0))
    droop = score(("supply_droop",), (8.1, 8.1, 22.0))
    judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT.decision, background=BACKGROUND)
    lag = score(("valve_lag",), (14.5, 14.5, 22.0))
    decision = judge.decide(nominal, [droop, lag])
    assert judge.share_removed(nominal, droop) < DEFAULT.decision.most_of_the_gap
    assert decision.verdict == "none"
    again = agreed(judge, nominal, decision)
    assert (again.verdict, again.chosen) == ("named", droop)
    assert next(iter(probabilities(judge, nominal, again))) == "supply_droop"
    weak = judge.decide(nominal, [lag])
    assert agreed(judge, nominal, weak) is weak


def test_a_second_cause_is_weighed_against_other_causes_only() -> None:
    """Whether the table explains the gap is another question than whether the second cause does."""
    nominal = score((), (33.0, 33.0, 330.0))
    compliance = score(("cable_compliance",), (18.0, 18.0, 260.0))
    both = score(("cable_compliance", "position_delay"), (16.0, 16.0, 120.0))
    judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT.decision, background=BACKGROUND)
    decision = judge.decide(nominal, [compliance, both])
    stated = probabilities(judge, nominal, decision)
    assert cause_probabilities(stated, {"position_delay"})["position_delay"] < 0.5
    assert stated["unknown"] > 0.2
    assert agreed(judge, nominal, decision).chosen is both


def test_a_second_cause_that_is_rather_absent_is_not_named() -> None:
    nominal = score((), (33.0, 74.0, 90.0))
    delay = score(("command_delay",), (12.0, 12.0, 50.0))
    pair = score(("command_delay", "creep"), (9.55, 9.55, 43.0))
    judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT.decision, background=BACKGROUND)
    decision = judge.decide(nominal, [delay, pair])
    assert decision.chosen is pair
    kept = agreed(judge, nominal, decision)
    assert kept.verdict == "named"
    assert kept.chosen is delay
    clear = replace(pair, sums=0.5 * pair.sums)
    decision = judge.decide(nominal, [delay, clear])
    assert agreed(judge, nominal, decision).chosen is clear


def test_many_improbable_rivals_do_not_outvote_the_most_probable_explanation() -> None:
    """Each is worse than both causes together; only together do they make the second doubtful."""
    nominal = score((), (33.0, 74.0, 90.0))
    delay = score(("command_delay",), (12.0, 12.0, 50.0))
    pair = score(("command_delay", "creep"), (8.0, 8.0, 36.0))
    others = ("thermal", "end_caps", "leakage", "payload", "dead_volume", "viscous_friction")
    rivals = [score(("command_delay", one), (9.6, 9.6, 43.0)) for one in others]
    judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT.decision, background=BACKGROUND)
    decision = judge.decide(nominal, [delay, pair, *rivals])
    assert decision.verdict == "named"
    assert decision.chosen is pair
    found = probabilities(judge, nominal, decision)
    assert next(iter(found)) == "command_delay + creep"
    assert cause_probabilities(found, {"creep"})["creep"] < DEFAULT.decision.likely
    assert agreed(judge, nominal, decision).chosen is pair


def test_a_cause_counts_as_present_in_its_richer_law() -> None:
    """Whether friction falls with speed does not make the friction itself doubtful."""
    nominal = score((), (33.0, 74.0, 90.0))
    delay = score(("command_delay",), (12.0, 12.0, 50.0))
    dry = score(("command_delay", "coulomb_friction"), (9.3, 9.3, 42.0))
    falling = score(("command_delay", "stribeck_friction"), (9.2, 9.2, 42.0))
    judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT.decision, background=BACKGROUND)
    decision = judge.decide(nominal, [delay, dry, falling])
    assert decision.chosen is dry
    assert (
        cause_probabilities(probabilities(judge, nominal, decision), {*dry.causes})[
            "coulomb_friction"
        ]
        < DEFAULT.decision.likely
    )
    assert agreed(judge, nominal, decision).chosen is dry


def test_a_gap_that_does_not_matter_is_most_probably_none() -> None:
    motion = np.full(CHANNELS, 1e4**2)
    judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT.decision, motion)
    nominal, found = score((), (1.0, 1.0, 2.6)), score(("viscous_friction",), (1.0, 1.0, 1.0))
    decision = judge.decide(nominal, [found])
    assert decision.verdict == "none"
    assert probabilities(judge, nominal, decision)["none"] > 0.8


def test_the_less_is_left_the_less_of_a_background_counts() -> None:
    judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT.decision, background=BACKGROUND)
    judge.set_floor([score((), (9.0, 9.0, 30.0)), score(("thermal",), (1.0, 1.0, 1.0))])
    assert judge.floor == pytest.approx(np.ones(CHANNELS), abs=0.05)
    judge.set_floor([score((), (90.0, 90.0, 300.0)), score(("thermal",), (50.0, 50.0, 100.0))])
    assert judge.floor == pytest.approx(1.0 + BACKGROUND)


@pytest.mark.parametrize("valve", ["flow", "pressure_regulator"])
def test_the_background_is_what_the_effects_call_ordinary(valve: ValveKind) -> None:
    """A good regulator vents more slowly than it fills; its exhaust is not restricted."""
    rig = ELBOW
    for muscle in rig.muscles:
        rig = rig.with_muscle(replace(muscle, valve=replace(muscle.valve, kind=valve)))
    joint = rig.joints[0]
    found = {name: size for name, _, size in ordinary_sizes(rig, joint)}
    slow = {"exhaust_restriction"} if valve == "pressure_regulator" else set()
    assert set(found) == {"hysteresis", "creep", "coulomb_friction", "leakage"} | slow
    assert {name for name, size in found.items() if size < 0.0} == slow
    for candidate in candidates_for(rig, joint):
        # A cause starts its search above the largest size that is ordinary.
        assert not any(candidate.is_ordinary(start) for start in candidate.starts)


def test_an_effect_that_the_rig_file_states_has_no_background_besides() -> None:
    joint = replace(ELBOW.joints[0], effects={"coulomb_friction": {"torque": 0.3}})
    rig = ELBOW.with_joint(joint)
    assert "coulomb_friction" in EFFECTS
    assert "coulomb_friction" not in {name for name, _, _ in ordinary_sizes(rig, joint)}


def test_the_size_of_an_effect_of_both_muscles_is_their_mean() -> None:
    hysteresis = next(c for c in candidates_for(ELBOW, ELBOW.joints[0]) if c.effect == "hysteresis")
    shape = hysteresis.starts[0][-1]
    assert hysteresis.is_ordinary(np.array([0.025, 0.01, shape]))
    assert not hysteresis.is_ordinary(np.array([0.03, 0.02, shape]))
    lag = next(c for c in candidates_for(ELBOW, ELBOW.joints[0]) if c.effect == "valve_lag")
    assert not lag.is_ordinary(np.zeros(len(lag.free)))  # a good rig has none of it


def ordinary(one: Score, *effects: str) -> Score:
    return replace(one, ordinary=effects)


def test_a_small_hysteresis_beside_a_cause_is_not_named() -> None:
    nominal = score((), (33.0, 74.0, 190.0))
    delay = score(("command_delay",), (8.0, 9.0, 150.0))
    pair = ordinary(score(("command_delay", "hysteresis"), (4.0, 5.0, 30.0)), "hysteresis")
    decision = decided(nominal, delay, pair)
    assert decision.verdict == "named"
    assert decision.chosen is pair
    assert named_effects(decision, ("command_delay", "hysteresis")) == (("command_delay",), ())


def test_hypotheses_that_differ_only_in_the_background_are_one_answer() -> None:
    nominal = score((), (33.0, 74.0, 190.0))
    first = ordinary(score(("command_delay", "hysteresis"), (4.0, 5.0, 30.0)), "hysteresis")
    second = ordinary(score(("command_delay", "leakage"), (4.0, 5.0, 30.5)), "leakage")
    decision = decided(nominal, first, second)
    assert decision.verdict == "named"
    assert decision.rivals == ()


def test_a_gap_that_ordinary_effects_explain_is_none_whatever_else_fits() -> None:
    nominal = score((), (12.0, 12.0, 110.0))
    usual = ordinary(score(("hysteresis",), (5.0, 5.0, 30.0)), "hysteresis")
    creep = score(("creep",), (5.0, 5.0, 29.0))
    assert decided(nominal, usual, creep).verdict == "none"
    assert decided(nominal, creep).verdict != "none"


def test_a_cause_that_removes_little_beside_ordinary_effects_is_not_named() -> None:
    nominal = score((), (34.0, 35.0, 155.0))
    usual = ordinary(score(("hysteresis",), (25.6, 27.0, 46.6)), "hysteresis")
    both = ordinary(score(("hysteresis", "thermal"), (16.4, 22.8, 42.4)), "hysteresis")
    floor = np.array([18.5, 18.5, 68.0]) ** 2
    assert not decided(nominal, usual, both, background=floor).is_named
    strong = ordinary(score(("hysteresis", "thermal"), (9.0, 8.0, 42.4)), "hysteresis")
    assert decided(nominal, usual, strong, background=floor).verdict == "named"


def test_lengths_have_a_tolerance_of_their_own() -> None:
    rig = replace(ELBOW, parameter_tolerance=0.05, length_tolerance=0.005)
    prior = {n.free.name: n.free.prior for n in nuisances_for(rig, rig.joints[0])}
    assert prior["agonist.neutral_length"] == prior["joint.pulley_radius"]
    assert prior["agonist.valve.sonic_conductance"] == pytest.approx(
        10.0 * prior["joint.pulley_radius"]
    )
    same = replace(ELBOW, parameter_tolerance=0.05)
    assert len({n.free.prior for n in nuisances_for(same, same.joints[0])}) == 1
