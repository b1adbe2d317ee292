"""An ordinary background is no cause: it raises the floor, and it is fitted without being named."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pam_gap.inference.candidates import background_for, candidates_for
from pam_gap.inference.decision import Decision, Judge
from pam_gap.inference.probabilities import probabilities
from pam_gap.inference.score import Score
from pam_gap.rules import DEFAULT
from pam_model.effects import EFFECTS
from pam_model.rig import load_rig

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
    return judge.decide(nominal, tried, lambda one: one)


def test_a_delay_that_leads_is_named_although_the_background_remains() -> None:
    nominal = score((), (33.0, 74.0, 90.0))
    tried = (
        score(("command_delay",), (4.0, 8.0, 30.0)),
        score(("valve_lag",), (20.0, 40.0, 70.0)),
    )
    assert decided(nominal, *tried).verdict == "named"
    assert decided(nominal, *tried, background=np.zeros(CHANNELS)).verdict == "unknown"


def test_a_good_rig_with_a_background_is_told_none() -> None:
    nominal = score((), (7.0, 7.5, 35.0))
    fitted = score(("hysteresis",), (6.5, 7.0, 25.0))
    assert decided(nominal, fitted).verdict == "none"
    assert decided(nominal, fitted, background=np.zeros(CHANNELS)).verdict != "none"


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
        decision = judge.decide(nominal, tried, lambda one: one)
        found = dict(probabilities(judge, nominal, decision))
        assert sum(found.values()) == pytest.approx(1.0)
        assert next(iter(found)) in (decision.verdict, "command_delay")
        return found

    assert given(nominal, delay, lag)["command_delay"] > 0.8
    assert given(score((), (7.0, 7.5, 35.0)), delay)["none"] > 0.8
    assert given(nominal, lag)["unknown"] > 0.8


def test_a_gap_that_does_not_matter_is_most_probably_none() -> None:
    motion = np.full(CHANNELS, 1e4**2)
    judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT.decision, motion)
    nominal, found = score((), (1.0, 1.0, 2.6)), score(("viscous_friction",), (1.0, 1.0, 1.0))
    decision = judge.decide(nominal, [found], lambda one: one)
    assert decision.verdict == "none"
    assert probabilities(judge, nominal, decision)["none"] > 0.8


def test_a_rig_that_is_explained_down_to_the_noise_is_judged_against_the_noise() -> None:
    judge = Judge(np.ones(CHANNELS), PRESENT, DEFAULT.decision, background=BACKGROUND)
    judge.set_floor([score((), (9.0, 9.0, 30.0)), score(("thermal",), (1.0, 1.0, 1.0))])
    assert judge.floor == pytest.approx(np.ones(CHANNELS), abs=0.05)
    judge.set_floor([score((), (90.0, 90.0, 300.0)), score(("thermal",), (50.0, 50.0, 100.0))])
    assert judge.floor == pytest.approx(1.0 + BACKGROUND)


def test_the_background_is_what_the_effects_call_ordinary() -> None:
    joint = ELBOW.joints[0]
    found = {nuisance.effect for nuisance in background_for(ELBOW, joint)}
    assert found == {"hysteresis", "creep", "coulomb_friction", "leakage"}
    for nuisance in background_for(ELBOW, joint):
        # A cause starts its search above the largest size that is ordinary.
        key = nuisance.targets[0].rsplit(".", 1)[1]
        candidate = next(c for c in candidates_for(ELBOW, joint) if c.effect == nuisance.effect)
        places = [k for k, p in enumerate(candidate.free) if p.name.startswith(key)]
        assert all(start[k] > nuisance.free.high for start in candidate.starts for k in places)


def test_an_effect_that_the_rig_file_states_has_no_background_besides() -> None:
    joint = replace(ELBOW.joints[0], effects={"coulomb_friction": {"torque": 0.3}})
    rig = ELBOW.with_joint(joint)
    assert "coulomb_friction" in EFFECTS
    assert "coulomb_friction" not in {n.effect for n in background_for(rig, joint)}
