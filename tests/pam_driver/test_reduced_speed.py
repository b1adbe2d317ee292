"""Without permission of full speed, a joint that is measured to be fast is stopped."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pam_driver.safety.joint_speed import JointSpeedWatch
from pam_driver.safety.people_inputs import FULL_SPEED, PeopleInputs
from pam_driver.safety.states import SafetyState
from pam_model.rig import People, Rig, load_rig, save_rig
from pam_model.robot import compose
from support.rigs import CONFIG, ELBOW

from .simulated_robot import Robot

PERIOD = 0.002
PEOPLE = People(full_speed_topic=True, deadline=0.2, slowing_time=0.5)


@pytest.fixture(scope="module")
def rig() -> Rig:
    return load_rig(ELBOW)


def found_at(rig: Rig, speed: float, *, slow: bool) -> str:
    """What is said of a joint that keeps a speed [rad/s] for 30 ms; "" for nothing."""
    watch = JointSpeedWatch(compose(rig))
    for cycle in range(15):
        now = PERIOD * cycle
        watch.update((250e3, 250e3), [speed * now], [speed], [now], now, slow)
    return "; ".join(str(condition) for condition in watch.conditions(now))


def test_the_reduced_speed_is_compared_only_where_it_must_be_kept(rig: Rig) -> None:
    assert found_at(rig, 0.45, slow=True) == ""
    assert found_at(rig, 0.6, slow=False) == ""
    assert found_at(rig, -0.6, slow=True) == (
        "elbow: at 0.60 rad/s, reduced_velocity is 0.5 rad/s and full speed is not permitted"
    )


def test_the_smaller_of_both_limits_holds(rig: Rig) -> None:
    careful = rig.with_joint(replace(rig.joints[0], max_velocity=0.3))
    assert "max_velocity is 0.3 rad/s" in found_at(careful, 0.4, slow=True)


def test_silence_and_the_word_no_end_full_speed_and_the_controller_has_time_to_brake() -> None:
    people = PeopleInputs(PEOPLE, {})
    assert people.reduced_speed(100.0) and people.must_be_slow(100.0), "nobody has permitted it"
    people.hear_topic(FULL_SPEED, True, 100.0)
    assert not people.reduced_speed(100.199)
    assert people.reduced_speed(100.201), "silent for longer than the deadline"
    assert not people.must_be_slow(100.699)
    assert people.must_be_slow(100.701)
    people.hear_topic(FULL_SPEED, True, 101.0)
    assert not people.reduced_speed(101.0)
    people.hear_topic(FULL_SPEED, False, 101.1)
    assert people.reduced_speed(101.1) and not people.must_be_slow(101.59)
    people.hear_topic(FULL_SPEED, False, 101.5)  # repeated: the time to brake does not begin anew
    assert people.must_be_slow(101.61)


def test_of_two_publishers_that_disagree_the_one_that_forbids_counts() -> None:
    people = PeopleInputs(PEOPLE, {})
    people.hear_topic(FULL_SPEED, True, 9.95)
    for tick in range(20):
        people.hear_topic(FULL_SPEED, tick % 2 == 1, 10.0 + 0.05 * tick)
        assert people.reduced_speed(10.0 + 0.05 * tick)
    assert people.must_be_slow(10.95)
    people.hear_topic(FULL_SPEED, True, 11.09)
    assert people.reduced_speed(11.09), "too soon after the last word that forbids it"
    people.hear_topic(FULL_SPEED, True, 11.11)
    assert not people.reduced_speed(11.11)


def test_without_the_key_full_speed_is_permitted_and_the_topic_says_nothing() -> None:
    people = PeopleInputs(People(), {})
    people.hear_topic(FULL_SPEED, False, 1.0)
    assert not people.reduced_speed(1e9) and not people.must_be_slow(1e9)


def test_neither_activation_nor_lowering_needs_the_permission() -> None:
    """They have limits of their own; a robot at reduced speed must be able to start and stop."""
    robot = Robot(replace(load_rig(CONFIG / "two_joints.yaml"), people=PEOPLE))
    robot.move()
    robot.run(1.0, command=True)
    assert robot.driver.state is SafetyState.ACTIVE, robot.driver.faults
    robot.driver.vent(robot.now)
    robot.run(5.0)
    assert robot.driver.state is SafetyState.VENTED, robot.driver.faults


@pytest.mark.parametrize("state", SafetyState)
def test_the_reduced_speed_is_a_limit_of_the_state_active_alone(
    state: SafetyState, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In every other state no command moves a joint, or other limits hold."""
    robot = Robot(replace(load_rig(CONFIG / "two_joints.yaml"), people=PEOPLE))
    robot.run(1.0)
    told: list[bool] = []
    judge = robot.driver._judge
    monkeypatch.setattr(judge, "watch_motion", lambda *given: told.append(given[-1]))
    robot.driver.state = state
    robot.driver.cycle(robot.now, robot.now)
    assert told == [state is SafetyState.ACTIVE], "nobody has permitted full speed"
    robot.driver.people.hear_topic(FULL_SPEED, True, robot.now)
    robot.driver.state = state
    robot.driver.cycle(robot.now, robot.now)
    assert told[1:] == [False]


def test_the_keys_survive_a_round_trip(rig: Rig, tmp_path) -> None:
    slow = replace(rig.joints[0], reduced_velocity=0.25)
    save_rig(replace(rig, people=PEOPLE).with_joint(slow), tmp_path / "rig.yaml")
    loaded = load_rig(tmp_path / "rig.yaml")
    assert loaded.people == PEOPLE
    assert loaded.joints[0].reduced_velocity == 0.25
