"""Late messages, stopped clocks, restarts and acts in a random order, on the chain."""

from __future__ import annotations

import dataclasses
import math
import random
from itertools import pairwise

import pytest

from pam_check.faults import acts, random_acts
from pam_check.faults.campaign import in_a_fork, in_forks
from pam_check.faults.delay_draws import (
    NEITHER,
    STOPS,
    TRACKS,
    DelayDraw,
    by_delay,
    run_draw,
)
from pam_check.faults.hidden_effects import moderate
from pam_check.faults.rig_bounds import bounds_of
from pam_check.faults.trial import run_trial
from pam_driver.safety.states import SafetyState
from pam_model.effects import EFFECTS
from pam_sim.boards.protocol import BoardValve
from pam_sim.faults.frame_faults import FrameFault, FrameFaults
from pam_sim.faults.rig_faults import RigFaults, lagging
from pam_sim.simulated_rig import SimulatedRig
from support.fault_kinds import kind_called

FRAME = (0x100, bytes(range(8)))


def test_frames_with_jitter_arrive_in_order_within_their_delay():
    faults = FrameFaults(3)
    faults.faults.append(FrameFault("jitter", "up", 1.0, 0.02, math.inf))
    sent, arrived = {}, []
    for tick in range(400):
        now = 1e-3 * tick
        arrived += [(now, identifier) for identifier, _ in faults.due("up", now)]
        if tick < 300:
            sent[tick] = now
            assert faults.pass_on((tick, b""), "up", now) == []
    assert [identifier for _, identifier in arrived] == list(sent)
    delays = [now - sent[identifier] for now, identifier in arrived]
    assert 0.015 < max(delays) < 0.0215
    assert min(delays) < 0.01


def test_regular_gaps_lose_all_frames_for_a_moment_and_pass_the_others():
    faults = FrameFaults()
    faults.faults.append(FrameFault("gaps", "up", 1.0, 0.02, 10.0, 0.1))
    passed = [bool(faults.pass_on(FRAME, "up", 1e-3 * tick)) for tick in range(1000)]
    assert sum(passed) == pytest.approx(800, abs=5)
    changes = sum(first != second for first, second in pairwise(passed))
    assert changes == pytest.approx(20, abs=1)


def test_a_lagging_sensor_follows_with_its_time_constant():
    show = lagging(0.05)
    assert show(0.0, 0.0) == 0.0
    assert show(1.0, 0.05) == pytest.approx(1.0 - math.exp(-1.0))
    assert show(1.0, 10.0) == pytest.approx(1.0)


def test_a_blocked_exhaust_and_crossed_hoses_change_what_valves_do():
    faults = RigFaults()
    kinds = (BoardValve(), BoardValve())
    assert not faults.move_valves
    faults.exhausts[0, 0] = 0.0
    faults.exhausts[0, 1] = 0.2
    assert faults.move_valves
    assert faults.spools(0, (-1.0, -1.0), kinds) == (0.0, -0.2)
    assert faults.spools(0, (0.5, 0.5), kinds) == (0.5, 0.5)
    assert faults.spools(1, (-1.0, -1.0), kinds) == (-1.0, -1.0)
    faults.clear()
    faults.crossed.add(0)
    assert faults.spools(0, (0.3, -1.0), kinds) == (-1.0, 0.3)


def test_commands_reach_the_driver_with_their_real_age(chain):
    """A command is never received at the moment when it was computed."""

    def look() -> list[float]:
        ages = []
        take = chain.driver.intake.take

        def listen(command, now):
            ages.append(command.age)
            return take(command, now)

        chain.driver.intake.take = listen
        chain.wait(0.4)
        return ages

    ages = in_a_fork(look)
    assert len(ages) > 150
    assert min(ages) > 5e-4
    assert max(ages) > 1.5e-3
    assert sum(ages) / len(ages) < 2e-3


@pytest.mark.parametrize("act", ["clear", "activate"])
def test_the_rule_of_random_acts_notices_air_without_an_act(chain, act):
    """A driver that forgets its fault, or that activates by itself, is found."""

    def forgetful() -> str:
        rule = random_acts._Rule(chain)
        random_acts._act(chain, rule, "vent", random.Random(1))
        if act == "clear":
            rule.stop(fault=True)
            chain.wait(3.0)  # until the muscles are empty
            random_acts._act(chain, rule, "activate", random.Random(1))
        else:
            chain.wait(3.0)  # until the muscles are empty
            chain.driver.activate(chain.now)
        chain.motion = None
        chain.wait(0.2)
        return next((text for claim in chain.claims if (text := claim())), "")

    found = in_a_fork(forgetful)
    assert found.startswith("air moves after a stop without")
    assert ("clearing" if act == "clear" else "an activation") in found


def test_a_vent_cancels_a_start_and_without_it_the_process_activates(chain):
    """The kind would not notice anything if the process never activated by itself."""

    def start() -> str:
        acts.vent(chain)
        acts.settle(chain)
        acts.start_new_process(chain, activates=True)
        chain.wait(1.0)
        return chain.driver.state.value

    assert in_a_fork(start) == SafetyState.ACTIVE.value
    kind = kind_called("vent_during_start")
    trial = in_a_fork(lambda: run_trial(chain, kind, {"board_after": 0.4}, 1))
    assert trial.problem == ""


def test_a_trial_finds_a_joint_that_moves_by_itself(chain):
    def pushed() -> str:
        acts.claim_stays(chain, 0.1)
        chain.wait(1.0)
        return next((text for claim in chain.claims if (text := claim())), "")

    assert "by itself" in in_a_fork(pushed)


@pytest.mark.parametrize("effect", EFFECTS)
def test_every_effect_can_be_hidden_at_its_moderate_size(rig, effect):
    parameters = SimulatedRig(rig, effects=moderate(effect)).parameters[0]
    assert parameters != SimulatedRig(rig).parameters[0]


def test_a_draw_of_a_delay_is_out_of_bounds_if_the_joint_is_too_fast_or_goes_astray(rig):
    bounds = bounds_of(rig)
    drawn = DelayDraw("frames_delayed_up", 0.03, "payload", TRACKS, peak_speed=bounds.speed)
    assert drawn.problem(bounds) == ""
    faster = dataclasses.replace(drawn, peak_speed=bounds.speed + 0.1)
    assert "30 ms, payload: 6.1 rad/s" in faster.problem(bounds)
    assert dataclasses.replace(drawn, outcome=STOPS).problem(bounds) == ""
    assert "neither" in dataclasses.replace(drawn, outcome=NEITHER).problem(bounds)


def test_the_summary_counts_draws_by_their_delay_and_names_what_stopped_them():
    draws = [
        DelayDraw("frames_delayed_up", 0.004, "payload", TRACKS),
        DelayDraw("frames_delayed_up", 0.006, "supply_droop", STOPS, by="supply_low"),
        DelayDraw("frames_delayed_up", 0.07, "payload", STOPS, by="loop_too_slow"),
        DelayDraw("frames_delayed_up", 0.08, "creep", STOPS, by="loop_too_slow"),
        DelayDraw("frames_delayed_up", 0.05, "creep", NEITHER),
    ]
    assert by_delay(draws) == [
        " 0 to 10 ms: 2 draws, 1 track, 1 stop (supply_low 1)",
        "10 to 20 ms: 0 draws, 0 track, 0 stop",
        "20 to 40 ms: 0 draws, 0 track, 0 stop",
        "40 to 80 ms: 3 draws, 0 track, 2 stop (loop_too_slow 2)",
    ]


def test_a_small_delay_is_borne_and_a_huge_one_stops(chain):
    draws = [
        DelayDraw("measurements_delayed", 0.002, "dead_volume"),
        DelayDraw("measurements_delayed", 0.2, "dead_volume"),
    ]
    works = ((lambda drawn=drawn: run_draw(chain, drawn, 1)) for drawn in draws)
    small, huge = in_forks(works, 2)
    assert (small.outcome, huge.outcome) == (TRACKS, STOPS)
    assert small.peak_error < 0.5  # max_tracking_error of the elbow
    assert huge.by
