"""An ordinary background is no cause: it raises the floor."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pam_gap.inference.candidates import candidates_for, nuisances_for, ordinary_sizes
from pam_gap.inference.decide import Verdict, cut_off_rivals, decide
from pam_gap.inference.evidence import Evidence
from pam_gap.inference.judge import Judge
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


def ordinary(one: Score, *effects: str) -> Score:
    return replace(one, ordinary=effects)


def evidence(
    nominal: Score,
    *tried: Score,
    background: np.ndarray = BACKGROUND,
    unlisted: tuple[Score, ...] = (),
    motion: float = 0.0,
) -> Evidence[Score]:
    return Evidence(
        floor=np.ones(CHANNELS),
        background=background,
        present=PRESENT,
        motion=np.full(CHANNELS, motion**2),
        written=nominal,
        nominal=nominal,
        tried=tried,
        singles=tuple(EFFECTS),
        stages=(),
        unlisted=unlisted,
    )


def decided(
    nominal: Score,
    *tried: Score,
    background: np.ndarray = BACKGROUND,
    unlisted: tuple[Score, ...] = (),
) -> Verdict[Score]:
    found = decide(evidence(nominal, *tried, background=background, unlisted=unlisted), DEFAULT)
    assert sum(found.probabilities.values()) == pytest.approx(1.0)
    return found


def test_a_delay_that_leads_is_named_although_the_background_remains() -> None:
    nominal = score((), (33.0, 74.0, 90.0))
    tried = (
        score(("command_delay",), (4.0, 8.0, 30.0)),
        ordinary(score(("command_delay", "hysteresis"), (3.5, 7.0, 20.0)), "hysteresis"),
        score(("valve_lag",), (20.0, 40.0, 70.0)),
    )
    found = decided(nominal, *tried)
    assert (found.verdict, found.effects) == ("named", ("command_delay",))
    assert found.probabilities["command_delay"] > 0.8


def test_a_good_rig_with_a_background_is_told_none() -> None:
    nominal = score((), (7.0, 7.5, 35.0))
    fitted = ordinary(score(("hysteresis",), (5.5, 6.0, 25.0)), "hysteresis")
    delay = score(("command_delay",), (4.0, 7.0, 30.0))
    found = decided(nominal, fitted, delay)
    assert found.verdict == "none"
    assert found.probabilities["none"] > 0.5


def test_a_background_that_is_larger_than_usual_is_not_called_an_unknown_cause() -> None:
    nominal, found = score((), (10.5, 10.5, 52.0)), score(("payload",), (9.9, 9.9, 49.0))
    assert decided(nominal, found).verdict == "none"
    no = np.zeros(CHANNELS)
    assert decided(nominal, found, background=no).verdict == "unknown"


def test_a_cause_outside_the_table_that_was_fitted_is_said() -> None:
    encoder = replace(score((), (9.5, 9.5, 47.0)), unlisted="an eccentricity of the encoder")
    drift = replace(score((), (32.0, 73.0, 89.0)), unlisted="a drift")
    strong, payload = score((), (33.0, 74.0, 90.0)), score(("payload",), (28.0, 60.0, 80.0))
    found = decided(strong, payload, unlisted=(drift, encoder))
    assert (found.verdict, found.looks_like) == ("unknown", encoder.unlisted)
    found = decided(strong, payload, unlisted=(drift,))
    assert (found.verdict, found.looks_like) == ("unknown", "")


def test_however_sure_it_is_the_cause_outside_the_table_is_said() -> None:
    """With an error of a whole motion, its probability is 1 in all digits."""
    encoder = replace(score((), (9.5, 9.5, 47.0)), unlisted="an eccentricity of the encoder")
    huge, payload = score((), (3e4, 3e4, 3e4)), score(("payload",), (2e4, 2e4, 2e4))
    found = decided(huge, payload, unlisted=(encoder,))
    assert found.probabilities["unknown"] == 1.0
    assert found.looks_like == encoder.unlisted


def test_a_delay_may_leave_a_background_larger_than_usual() -> None:
    """That the law of a delay has only one form says nothing about what else the rig has."""
    nominal, delay = score((), (33.0, 74.0, 90.0)), score(("command_delay",), (15.0, 18.0, 75.0))
    assert decided(nominal, delay).effects == ("command_delay",)


def test_an_effect_outside_the_table_stays_unknown_beside_a_background() -> None:
    nominal = score((), (10.0, 10.0, 900.0))
    closest = score(("payload",), (9.0, 9.0, 700.0))
    found = decided(nominal, closest)
    assert (found.verdict, found.named, found.chosen) == ("unknown", None, closest)


def test_a_further_effect_that_fits_only_the_background_is_not_named() -> None:
    nominal = score((), (33.0, 74.0, 90.0))
    delay = score(("command_delay",), (6.0, 8.0, 38.0))
    pair = score(("command_delay", "coulomb_friction"), (5.0, 6.0, 20.0))
    assert decided(nominal, delay, pair).chosen is delay


def test_a_rival_at_the_end_of_its_range_lowers_the_probability_of_the_others() -> None:
    """It might explain as much with more of it; one that explains little changes nothing."""
    nominal = score((), (33.0, 74.0, 90.0))
    bladder = score(("bladder_elasticity",), (4.0, 8.0, 30.0))

    def probability(rival: Score) -> float:
        return decided(nominal, bladder, rival).probabilities["bladder_elasticity"]

    caps = score(("end_caps",), (6.0, 13.0, 43.0))
    limited = replace(caps, cut_off=("end_caps",))
    assert probability(limited) < probability(caps) - 0.03
    assert probability(replace(caps, cut_off=("leakage",))) == probability(caps)
    weak = score(("end_caps",), (30.0, 70.0, 88.0))
    assert probability(replace(weak, cut_off=("end_caps",))) > probability(weak) - 0.01


def test_only_a_rival_with_a_probability_that_is_shown_is_named() -> None:
    """One whose raised level is still far behind the named cause is no reason for a caution."""
    nominal = score((), (33.0, 74.0, 90.0))
    bladder = score(("bladder_elasticity",), (4.0, 8.0, 30.0))

    def rivals(*others: Score) -> list[Score]:
        kept = evidence(nominal, bladder, *others)
        return cut_off_rivals(kept, decide(kept, DEFAULT), 0.005)

    near = replace(score(("end_caps",), (6.0, 13.0, 43.0)), cut_off=("end_caps",))
    far = replace(score(("tube_restriction",), (25.0, 60.0, 80.0)), cut_off=("tube_restriction",))
    assert rivals(far, near) == [near]
    assert not rivals(replace(near, cut_off=()))


def test_a_second_cause_is_named_where_both_together_are_most_probable() -> None:
    nominal = score((), (33.0, 74.0, 90.0))
    delay = score(("command_delay",), (12.0, 12.0, 50.0))
    for left, named in (
        ((11.0, 11.0, 47.0), ("command_delay",)),
        ((4.0, 4.0, 20.0), ("command_delay", "creep")),
    ):
        assert decided(nominal, delay, score(("command_delay", "creep"), left)).effects == named


def test_a_gap_that_does_not_matter_has_no_cause() -> None:
    """Silence about it costs nothing, however probable a cause is."""
    nominal, found = score((), (1.0, 1.0, 9.0)), score(("viscous_friction",), (1.0, 1.0, 1.0))
    clean = np.zeros(CHANNELS)
    for motion, verdict in ((1e4, "none"), (1e3, "named")):
        kept = evidence(nominal, found, background=clean, motion=motion)
        assert decide(kept, DEFAULT).verdict == verdict
        assert decide(kept, DEFAULT).probabilities["viscous_friction"] > 0.5


def test_the_less_is_left_the_less_of_a_background_counts() -> None:
    judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT, background=BACKGROUND)
    judge.set_floor([score((), (9.0, 9.0, 30.0)), score(("thermal",), (1.0, 1.0, 1.0))])
    assert judge.floor == pytest.approx(np.ones(CHANNELS), abs=0.05)
    judge.set_floor([score((), (90.0, 90.0, 300.0)), score(("thermal",), (50.0, 50.0, 100.0))])
    assert judge.floor == pytest.approx(1.0 + BACKGROUND)


def test_a_channel_at_its_noise_says_little_of_a_background() -> None:
    """The background of a coarse load cell hardly stands out of its noise, and may be below it."""
    judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT)
    seen = np.array([100.0, 100.0, 3.0])
    found = [judge.share_of(np.array([40.0, 40.0, left]), seen) for left in (0.99, 1.05)]
    assert found[0] == pytest.approx(found[1], rel=0.05)
    assert found[0] > 0.3
    assert judge.share_of(np.array([1.1, 1.1, 0.99]), seen) < DEFAULT.search.clean_left


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


def test_a_small_hysteresis_beside_a_cause_is_not_named() -> None:
    nominal = score((), (33.0, 74.0, 190.0))
    delay = score(("command_delay",), (8.0, 9.0, 150.0))
    pair = ordinary(score(("command_delay", "hysteresis"), (4.0, 5.0, 30.0)), "hysteresis")
    found = decided(nominal, delay, pair)
    assert (found.verdict, found.chosen) == ("named", pair)
    assert (found.effects, found.indistinguishable) == (("command_delay",), ())


def test_hypotheses_that_differ_only_in_the_background_are_one_answer() -> None:
    nominal = score((), (33.0, 74.0, 190.0))
    first = ordinary(score(("command_delay", "hysteresis"), (4.0, 5.0, 30.0)), "hysteresis")
    second = ordinary(score(("command_delay", "leakage"), (4.0, 5.0, 30.5)), "leakage")
    found = decided(nominal, first, second)
    assert found.verdict == "named"
    assert found.rivals == ()


def test_a_gap_that_ordinary_effects_explain_is_none_whatever_else_fits() -> None:
    nominal = score((), (12.0, 12.0, 110.0))
    usual = ordinary(score(("hysteresis",), (5.0, 5.0, 30.0)), "hysteresis")
    creep = score(("creep",), (5.0, 5.0, 29.0))
    assert decided(nominal, usual, creep).verdict == "none"
    assert decided(nominal, creep).verdict != "none"


def test_a_cause_that_removes_little_beside_ordinary_effects_is_not_named() -> None:
    nominal = score((), (34.0, 35.0, 155.0))
    usual = ordinary(score(("hysteresis",), (25.6, 27.0, 46.6)), "hysteresis")
    both = ordinary(score(("hysteresis", "thermal"), (22.0, 25.0, 45.0)), "hysteresis")
    floor = np.array([18.5, 18.5, 68.0]) ** 2
    assert decided(nominal, usual, both, background=floor).named is None


def test_lengths_have_a_tolerance_of_their_own() -> None:
    rig = replace(ELBOW, parameter_tolerance=0.05, length_tolerance=0.005)
    prior = {n.free.name: n.free.prior for n in nuisances_for(rig, rig.joints[0])}
    assert prior["agonist.neutral_length"] == prior["joint.pulley_radius"]
    assert prior["agonist.valve.sonic_conductance"] == pytest.approx(
        10.0 * prior["joint.pulley_radius"]
    )
    same = replace(ELBOW, parameter_tolerance=0.05)
    assert len({n.free.prior for n in nuisances_for(same, same.joints[0])}) == 1
