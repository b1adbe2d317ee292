"""Kinds that came from attacks on the running chain find the defects of which they are made."""

from __future__ import annotations

import math

import pytest

from pam_check.faults import output_faults
from pam_check.faults.campaign import in_a_fork
from pam_check.faults.trial import run_trial
from pam_driver.safety.states import SafetyState
from pam_ros.message_sources import MessageSources
from support.fault_kinds import kind_called


def trial(chain, name, **values):
    kind = kind_called(name)
    drawn = {key: 0.5 * (low + high) for key, (low, high) in kind.parameters.items()} | values
    return in_a_fork(lambda: run_trial(chain, kind, drawn, 1))


@pytest.mark.sampled("angles in degrees or pressures in kilopascals", cases=1)
@pytest.mark.parametrize(
    "name",
    ["measurements_of_a_second_node_in_degrees", "measurements_of_a_second_node_in_kpa"],
)
def test_a_second_source_of_measurements_that_nobody_counts_is_found(chain, name, monkeypatch):
    assert trial(chain, name).problem == ""
    monkeypatch.setattr(MessageSources, "taking_turns", lambda self, now: "")
    assert trial(chain, name, duration=0.8).problem


def test_an_input_of_a_board_that_vanishes_and_keeps_its_permission_is_found(chain, monkeypatch):
    name = "emergency_stop_input_lost"
    assert trial(chain, name).problem == ""
    for board in chain.driver.boards.values():
        inputs = board.inputs

        class Forgetful(dict):
            def __setitem__(self, key, value):
                if not math.isnan(value.value):
                    super().__setitem__(key, value)

        monkeypatch.setattr(board, "inputs", Forgetful(inputs))
    assert "noticed by" in trial(chain, name).problem


def test_inputs_that_are_unheard_while_the_joint_is_lowered_are_found(chain, monkeypatch):
    name = "vent_with_inputs_held"
    assert trial(chain, name).problem == ""
    hear = type(chain.driver.people).hear_topic

    def deaf_while_lowering(people, topic, permits, now):
        if not chain.driver.lowers:
            hear(people, topic, permits, now)

    monkeypatch.setattr(type(chain.driver.people), "hear_topic", deaf_while_lowering)
    assert "no emergency stop" in trial(chain, name).problem


def test_a_trajectory_far_ahead_that_is_accepted_is_found(chain, monkeypatch):
    name = "trajectory_in_the_future"
    assert trial(chain, name).problem == ""
    follow = chain.intake.follow
    monkeypatch.setattr(
        chain.intake, "follow", lambda names, points, start, _: follow(names, points, None)
    )
    assert trial(chain, name).problem


def test_the_brake_holds_a_joint_and_the_dump_valve_takes_the_supply(chain):
    def held() -> float:
        outputs = output_faults._equip(chain, 30.0)
        assert not outputs.brake
        outputs.brake = True
        chain.wait(0.05)
        angle = chain.truth.positions[0]
        chain.wait(0.1)
        return abs(chain.truth.positions[0] - angle)

    def dumped() -> tuple[float, float]:
        outputs = output_faults._equip(chain)
        closed = chain.truth.supply_pressure
        outputs.dump = True
        chain.wait(0.01)
        return closed, chain.truth.supply_pressure

    assert in_a_fork(held) < 1e-3
    closed, opened = in_a_fork(dumped)
    assert closed == pytest.approx(chain.rig.supply_pressure, rel=0.01)
    assert opened == pytest.approx(chain.rig.gas.ambient_pressure, rel=0.01)


def test_a_brake_follows_the_output_of_its_board(chain):
    def stop() -> float:
        output_faults._equip(chain, 30.0)
        assert chain.driver.state is SafetyState.ACTIVE
        chain.driver.vent_at_once(chain.now)
        chain.wait(0.02)
        angle = chain.truth.positions[0]
        chain.wait(0.5)
        return abs(chain.truth.positions[0] - angle)

    assert in_a_fork(stop) < 1e-3  # without a brake it falls by more than 0.1 rad
