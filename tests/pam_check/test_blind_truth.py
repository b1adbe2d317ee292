"""The withheld check stands on a second plant: it must be right, and it must be another one."""

import math

import numpy as np
import pytest

from pam_check.blind.cases import rig_parameters
from pam_check.blind.draw import Draw
from pam_check.blind.effect_cases import KNOWN, OUTSIDE, case_of, stage_of
from pam_check.blind.score import CLEAR_GAP, reported_set, score, share
from pam_check.blind.truth_plant import (
    PressureExcitation,
    Sensors,
    TruthJoint,
    TruthMuscle,
    run_truth,
)
from pam_model.effects import EFFECTS
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import initial_state, simulate
from pam_model.rig import rig_from_parameters

JOINT = TruthJoint(0.03, 0.05, 0.25, 4.9, 0.0, -1.0, 1.0, 293.15, 101325.0, 701325.0)
MUSCLE = TruthMuscle(0.2758, 1.856, 0.24996, 0.225, 2e-5, 4e-9, 0.3, 0.005)
QUIET = Sensors(0.0, 1e-3, 0.0, 1e-9, 0.0, 1e-6)
pytest.importorskip("numba", reason="the truth plant is some 300 times slower without numba")


def motion(seconds: float = 8.0, dt: float = 0.002) -> PressureExcitation:
    time = np.arange(round(seconds / dt)) * dt
    return PressureExcitation(
        np.full(time.size, 2.4e5),
        7e4 * np.sin(2 * math.pi * 0.4 * time) * np.clip(time, 0, 1),
        np.zeros(time.size),
        dt,
    )


def test_without_effects_two_independent_plants_agree() -> None:
    """Mass and energy at 0.05 ms against pressure in RK4: the same rig within the noise."""
    truth = run_truth(JOINT, (MUSCLE, MUSCLE), motion(), QUIET, np.random.default_rng(0))
    rig = rig_from_parameters(rig_parameters(JOINT, MUSCLE, 0.0))
    parameters = PlantParameters.from_rig(rig)
    start = initial_state(parameters, pressures=(2.4e5, 2.4e5), position=0.0)
    ours = simulate(parameters, truth.commands, 0.002, start)
    assert np.abs(ours.position - truth.true_position).max() < 5e-4
    assert np.abs(ours.pressures - truth.true_pressures).max() < 300.0
    assert np.ptp(truth.true_position) > 0.3


@pytest.mark.parametrize("name", [*KNOWN, *OUTSIDE])
def test_every_hidden_effect_shows(name: str) -> None:
    """A drawn effect changes what is recorded, or hiding it would prove nothing."""
    draw = Draw(np.random.default_rng(5), JOINT, [MUSCLE, MUSCLE])
    case_of(name).draw(draw)
    muscles = (draw.muscles[0], draw.muscles[1])
    hidden = run_truth(draw.joint, muscles, motion(), QUIET, np.random.default_rng(0))
    plain = run_truth(
        JOINT,
        (MUSCLE, MUSCLE),
        motion(),
        QUIET,
        np.random.default_rng(0),
        fixed_commands=hidden.commands,
    )
    change_p = np.abs(hidden.pressures - plain.pressures).max() / 250.0
    change_q = np.abs(hidden.position - plain.position).max() / 3e-4
    assert max(change_p, change_q) > CLEAR_GAP


def test_the_draws_cover_the_table_of_effects() -> None:
    assert set(KNOWN) == set(EFFECTS)
    assert not set(OUTSIDE) & set(EFFECTS)


def test_closed_chamber_keeps_its_gas() -> None:
    """Valves shut, no leak: P V stays constant at constant temperature."""
    flat = motion(3.0)
    still = np.zeros((flat.level.size, 2))
    run = run_truth(
        JOINT._replace(gravity_angle=0.5),
        (MUSCLE, MUSCLE),
        flat,
        QUIET,
        np.random.default_rng(0),
        fixed_commands=still,
    )
    length = MUSCLE.neutral_length - JOINT.pulley_radius * run.true_position
    volume = MUSCLE.dead_volume + length * (MUSCLE.thread_length**2 - length**2) / (
        4 * math.pi * MUSCLE.turns**2
    )
    product = (run.true_pressures[:, 0] + JOINT.ambient_pressure) * volume
    assert np.ptp(run.true_position) > 0.01
    assert np.ptp(product) / product.mean() < 1e-3


def label(kind: str, effects: list[str], case: str = "000") -> dict[str, object]:
    stages = [stage_of(e) for e in effects]
    return {
        "case": case, "kind": kind, "effects": effects, "stages": stages, "gap_over_floor": 9.0,
    }  # fmt: skip


def answer(verdict: str, effects: list[str], groups: list[list[str]] | None = None) -> dict:
    return {
        "verdict": verdict,
        "effects": effects,
        "indistinguishable": groups or [],
        "stage": stage_of(effects[0]) if effects else None,
        "candidates": [[e, 0.5] for e in effects],
    }


def test_scoring_counts_right_wrong_and_missing_answers() -> None:
    labels = [
        label("one", ["leakage"], "000"),
        label("one", ["payload"], "001"),
        label("none", [], "002"),
        label("outside", ["backlash"], "003"),
        label("two", ["leakage", "payload"], "004"),
        label("one", ["creep"], "005"),
    ]
    answers = {
        "000": answer("named", ["leakage"]),
        "001": answer("ambiguous", ["pulley_radius"], [["pulley_radius", "payload"]]),
        "002": answer("named", ["creep"]),
        "003": answer("unknown", []),
        "004": answer("named", ["leakage", "creep"]),
    }
    result = score(labels, answers)["shares"]
    assert (result["top1"]["hits"], result["top1"]["of"]) == (1, 3)
    assert result["truth_in_set"]["hits"] == 2
    assert result["false_name_on_clean"]["hits"] == 1
    assert result["unknown_recall"]["hits"] == 1
    assert (result["both_of_two"]["hits"], result["one_of_two"]["hits"]) == (0, 1)


def test_a_set_the_answer_does_not_name_is_not_reported() -> None:
    assert reported_set(answer("named", ["creep"], [["leakage", "payload"]])) == {"creep"}


def test_share_interval_holds_the_share() -> None:
    for hits in range(11):
        entry = share([True] * hits + [False] * (10 - hits))
        low, high = entry.interval
        assert low <= entry.value <= high


def test_scores_are_given_by_strength_and_a_leftover_counts_outside_the_table() -> None:
    labels = [
        label("one", ["leakage"], "000") | {"strength": 12.0},
        label("one", ["payload"], "001") | {"strength": 4.0},
        label("one", ["creep"], "002") | {"strength": 1.5},
        label("two", ["leakage", "payload"], "003") | {"strength": 4.0},
        label("outside", ["backlash"], "004") | {"strength": 4.0},
        label("outside", ["torque_ripple"], "005") | {"strength": 4.0},
    ]
    answers = {
        "000": answer("named", ["leakage"]),
        "001": answer("ambiguous", ["creep"], [["creep", "payload"]]),
        "002": answer("named", ["payload"]),
        "003": answer("named", ["leakage"]),
        "004": answer("none", []) | {"leftover": {"material": True}},
        "005": answer("none", []) | {"leftover": {"material": False}},
    }
    shares = score(labels, answers)["shares"]

    def counts(name: str) -> tuple[int, int]:
        return shares[name]["hits"], shares[name]["of"]

    assert counts("top1_strong") == (1, 1)
    assert (counts("top1_medium"), counts("truth_in_set_medium")) == ((0, 1), (1, 1))
    assert (counts("false_name_medium"), counts("false_name_weak")) == ((0, 1), (1, 1))
    assert counts("both_of_two_medium") == (0, 1)
    assert (counts("unknown_recall"), counts("outside_unknown_or_leftover")) == ((0, 2), (1, 2))
