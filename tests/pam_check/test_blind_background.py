"""Drawn rigs with an ordinary background: each part of it is small, the hidden effect is not."""

import numpy as np
import pytest

from pam_check.blind.background import (
    FULL_SCALE,
    MOST_ENDS,
    add_background,
    area,
    weaker,
)
from pam_check.blind.cases import to_table, written_rig
from pam_check.blind.draw import Draw
from pam_check.blind.effect_cases import case_of
from pam_check.blind.rough import WEAKEST, alone, draw_rough_rig, uneven
from pam_check.blind.strength import channels, gap, strength
from pam_check.blind.truth_plant import Sensors, SupplyWander, TruthJoint, TruthMuscle, slow_noise
from pam_check.blind.variety import Variety

JOINT = TruthJoint(0.03, 0.05, 0.25, 4.9, 0.0, -1.0, 1.0, 293.15, 101325.0, 701325.0)
MUSCLE = TruthMuscle(0.2758, 1.856, 0.24996, 0.225, 2e-5, 4e-9, 0.3, 0.005)


def drawn(seed: int = 3) -> Draw:
    return Draw(np.random.default_rng(seed), JOINT, [MUSCLE, MUSCLE])


def test_every_part_of_the_background_is_harmless() -> None:
    for seed in range(20):
        rig = drawn(seed)
        add_background(rig)
        holding = JOINT.pulley_radius * area(MUSCLE) * 3e5
        assert 0.0 < rig.joint.coulomb_torque < 0.005 * holding
        for muscle in rig.muscles:
            assert 0.0 < muscle.leak <= 0.003 * MUSCLE.sonic_conductance
            assert 0.0 < muscle.spool_hysteresis < 0.0065
            assert abs(muscle.pressure_curvature) <= 0.003


def test_a_weaker_effect_lies_between_the_background_and_the_drawn_one() -> None:
    plain = drawn()
    add_background(plain)
    full = Draw(plain.random, plain.joint, list(plain.muscles))
    case_of("hysteresis").draw(full)
    half = weaker(full, plain, 0.5)
    for small, between, large in zip(plain.muscles, half.muscles, full.muscles, strict=True):
        middle = 0.5 * (small.thread_friction + large.thread_friction)
        assert between.thread_friction == pytest.approx(middle)
        assert between.play_length == large.play_length
    case_of("end_caps").draw(full)
    assert weaker(full, plain, 9.0).muscles[0].end_factor == MOST_ENDS
    # what an effect makes smaller stays large enough for the rig to run
    case_of("exhaust_restriction").draw(full)
    much = weaker(full, plain, 4.0)
    assert 0.0 < much.muscles[0].exhaust_ratio < full.muscles[0].exhaust_ratio


def test_each_effect_of_a_pair_has_a_rig_of_its_own() -> None:
    plain = drawn()
    add_background(plain)
    pair = Draw(plain.random, plain.joint, list(plain.muscles))
    case_of("payload").draw(pair)
    before = Draw(pair.random, pair.joint, list(pair.muscles))
    case_of("hysteresis").draw(pair)
    one = alone(before, pair, plain)
    assert one.joint == plain.joint
    assert one.muscles[0].thread_friction == pair.muscles[0].thread_friction


def test_slow_noise_drifts_and_is_coloured() -> None:
    sensors = Sensors(pressure_colour=100.0, pressure_corner=5.0, pressure_drift=0.001 * FULL_SCALE)
    noise = slow_noise(sensors, 0.002, 20000, np.random.default_rng(1))
    pressure = noise[:, 0]
    assert 50.0 < np.std(pressure) < 700.0
    assert np.std(np.diff(pressure)) < 0.5 * np.std(pressure)
    assert not noise[:, 2:].any()


def test_the_supply_wanders_about_its_mean() -> None:
    factor = SupplyWander(0.01, 10.0, 0.002, 15.0).factor(np.arange(0.0, 40.0, 0.002))
    assert abs(factor.mean() - 1.0) < 1e-3
    assert 0.008 < np.ptp(factor) / 2.0 < 0.013


def test_a_drawn_rig_has_the_strength_of_its_label_and_an_uneven_log() -> None:
    pytest.importorskip("numba", reason="the truth plant is some 300 times slower without numba")
    random, believed = np.random.default_rng(8), (JOINT, (MUSCLE, MUSCLE))
    written = written_rig(Variety(), believed, 0.03)
    rig = draw_rough_rig(believed, written, ["viscous_friction"], random)
    assert WEAKEST <= rig.strength < 45.0
    assert rig.joint.viscous_friction > JOINT.viscous_friction
    log = uneven(to_table(rig.recording, load_cells=False), random)
    assert len(log) <= rig.recording.time.size
    assert (np.diff(log["time"].to_numpy()) > 0.0).all()
    clean = draw_rough_rig(believed, written, [], np.random.default_rng(8))
    assert clean.strength == 0.0
    assert clean.strengths == ()
    assert rig.strengths == (rig.strength,)


def test_a_strength_is_the_change_of_the_gap_that_the_owner_of_the_rig_sees() -> None:
    """An encoder that is read 0.1 rad too high changes the gap by 0.1 rad."""
    pytest.importorskip("numba", reason="the truth plant is some 300 times slower without numba")
    believed = (JOINT, (MUSCLE, MUSCLE))
    written = written_rig(Variety(), believed, 0.03)
    rig = draw_rough_rig(believed, written, [], np.random.default_rng(8))
    logged = channels(rig.recording)
    usual = gap(written, logged)
    assert usual.shape[1] == 3
    assert strength(usual, usual) == 0.0
    offset, name = 0.1, "joint_states.elbow.position"
    affected = gap(written, logged | {name: logged[name] + offset})
    moved = np.nanmean(np.abs(affected - usual)[:, 2]) / np.sqrt(np.nanmean(usual[:, 2] ** 2))
    assert strength(affected, usual) == pytest.approx(moved, rel=0.3)
    # the wrong numbers of the rig file are a part of the usual gap
    exact = written_rig(Variety(), (rig.joint, rig.muscles), 0.03)
    assert strength(gap(exact, logged | {name: logged[name] + offset}), gap(exact, logged)) > moved
