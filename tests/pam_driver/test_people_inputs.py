"""Emergency stop, enabling switch, brake and dump valve: nothing moves against a person."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from pam_driver.boards.pam_board.codec import BoardFault, BoardState
from pam_driver.boards.pam_board.messages import SafetyInput
from pam_driver.boards.protocol import EMERGENCY_STOP, ENABLING_SWITCH
from pam_driver.driver import ActivationError
from pam_driver.fault_judge import FaultJudge, Readings
from pam_driver.safety.sensor_checks import SensorChecks
from pam_driver.safety.states import SafetyState
from pam_model.errors import RigError
from pam_model.rig import People, load_rig, save_rig
from pam_model.robot import compose
from support.rigs import CONFIG

from .simulated_robot import Robot

RIG = load_rig(CONFIG / "two_joints.yaml")
FORBIDS, PERMITS = 0.0, 1.0
VENTS = {SafetyState.VENTING, SafetyState.VENTED}


def robot_with(people: People, **inputs: float) -> Robot:
    """A robot whose board 0 has these inputs."""
    robot = Robot(replace(RIG, people=people))
    for name, value in inputs.items():
        robot.sim.boards[0].misbehave(name, value)
    return robot


def air_moves(robot: Robot) -> bool:
    return any(board.active for board in robot.sim.boards.values())


@pytest.mark.parametrize("people", [People(), People(emergency_stop_board=0)])
def test_a_pressed_emergency_stop_is_a_latched_fault_on_every_board(people: People) -> None:
    robot = robot_with(people, emergency_stop=PERMITS)
    robot.move()
    robot.sim.boards[0].misbehave(EMERGENCY_STOP, FORBIDS)
    robot.run(0.004)
    assert not robot.sim.boards[0].active, "the board with the button needs no host"
    robot.run(0.02)
    assert robot.driver.state is SafetyState.FAULT
    assert str(robot.driver.faults[0]) == "board 0: the emergency stop is pressed"
    assert not air_moves(robot)
    robot.driver.clear_faults(robot.now)
    robot.run(0.6)
    assert robot.driver.state is SafetyState.FAULT, "cleared while it is pressed"
    robot.sim.boards[0].misbehave(EMERGENCY_STOP, PERMITS)
    robot.run(1.0)
    assert robot.driver.state is SafetyState.FAULT, "a released button is no reset"
    robot.driver.clear_faults(robot.now)
    robot.run(0.6)
    assert robot.driver.state is SafetyState.VENTED
    robot.move()


def test_an_emergency_stop_is_latched_while_nothing_moves() -> None:
    robot = robot_with(People(), emergency_stop=PERMITS)
    robot.run(0.3)
    robot.sim.boards[0].misbehave(EMERGENCY_STOP, FORBIDS)
    robot.run(0.05)
    robot.sim.boards[0].misbehave(EMERGENCY_STOP, PERMITS)
    robot.run(0.5)
    assert robot.driver.state is SafetyState.FAULT
    with pytest.raises(ActivationError, match="emergency stop"):
        robot.driver.activate(robot.now)


def test_a_released_enabling_switch_vents_and_holding_it_moves_nothing() -> None:
    robot = robot_with(People(enabling_switch_board=0), enabling_switch=PERMITS)
    robot.move()
    robot.sim.boards[0].misbehave(ENABLING_SWITCH, FORBIDS)
    robot.run(0.03)
    assert robot.driver.state in VENTS
    assert robot.driver.vent_reason == "board 0: the enabling switch is released"
    assert not air_moves(robot)
    with pytest.raises(ActivationError, match="enabling switch is released"):
        robot.driver.activate(robot.now)
    robot.sim.boards[0].misbehave(ENABLING_SWITCH, PERMITS)
    robot.run(0.5)
    assert robot.driver.state is SafetyState.VENTED
    robot.move()
    assert robot.driver.vent_reason == ""


def test_a_released_enabling_switch_ends_an_activation_before_the_first_command() -> None:
    robot = robot_with(People(enabling_switch_board=0), enabling_switch=PERMITS)
    robot.run(0.3)
    robot.driver.activate(robot.now)
    robot.run(0.05)
    assert robot.driver.state is SafetyState.READY
    robot.sim.boards[0].misbehave(ENABLING_SWITCH, FORBIDS)
    robot.run(0.03)
    assert robot.driver.state in VENTS
    assert robot.driver.vent_reason == "board 0: the enabling switch is released"


@pytest.mark.parametrize("name", [EMERGENCY_STOP, ENABLING_SWITCH])
def test_an_input_that_a_board_no_longer_has_does_not_permit_motion_for_ever(name: str) -> None:
    """The rig file need not name the input; a board that reported it is obeyed."""
    robot = robot_with(People(), **{name: PERMITS})
    robot.move()
    robot.sim.boards[0].misbehave(name, float(SafetyInput.NOT_AVAILABLE))
    robot.run(0.05)
    assert not air_moves(robot)
    robot.driver.clear_faults(robot.now)
    robot.run(1.0)
    with pytest.raises(ActivationError, match=r"it had an input for the .* and reports none now"):
        robot.driver.activate(robot.now)
    robot.sim.boards[0].misbehave(name, PERMITS)
    robot.run(0.05)
    robot.driver.clear_faults(robot.now)
    robot.run(0.6)
    robot.move()


@pytest.mark.parametrize("name", [EMERGENCY_STOP, ENABLING_SWITCH])
def test_an_input_that_the_rig_file_names_must_exist(name: str) -> None:
    robot = robot_with(People(**{f"{name}_board": 1}))
    robot.run(0.5)
    with pytest.raises(ActivationError, match=f"board 1: no {name.replace('_', ' ')} for 0.2 s"):
        robot.driver.activate(robot.now)
    assert robot.driver.state is SafetyState.VENTED, "nobody pressed anything: not latched"
    with pytest.raises(RigError, match=f"people.{name}_board = 7: the rig has no such board"):
        robot_with(People(**{f"{name}_board": 7}))


@pytest.mark.parametrize(
    ("name", "ends"), [(EMERGENCY_STOP, {SafetyState.FAULT}), (ENABLING_SWITCH, VENTS)]
)
@pytest.mark.parametrize("by_silence", [True, False])
def test_a_topic_forbids_motion_by_its_value_and_by_silence(
    name: str, ends: set[SafetyState], by_silence: bool
) -> None:
    robot = robot_with(People(**{f"{name}_topic": True}, deadline=0.1))
    robot.run(0.3)
    with pytest.raises(ActivationError, match=f"topic: no {name.replace('_', ' ')} for 0.1 s"):
        robot.driver.activate(robot.now)
    people = robot.driver.people
    people.hear_topic(name, True, robot.now)
    robot.driver.activate(robot.now)
    for _ in range(10):
        people.hear_topic(name, True, robot.now)
        robot.run(0.05, command=True)
    assert robot.driver.state is SafetyState.ACTIVE
    if by_silence:
        people.hear_topic(name, True, robot.now)
        robot.run(0.098, command=True)
        assert robot.driver.state is SafetyState.ACTIVE
        robot.run(0.004)
    else:
        people.hear_topic(name, False, robot.now)
        robot.run(0.002)
    assert robot.driver.state in ends
    robot.run(0.02)
    assert not air_moves(robot)


def test_a_topic_that_the_rig_file_does_not_ask_for_is_not_heard() -> None:
    robot = robot_with(People())
    robot.driver.people.hear_topic(EMERGENCY_STOP, False, robot.now)
    robot.move()


def outputs(robot: Robot) -> set[tuple[bool, bool]]:
    """Brake released and dump valve closed, of every board."""
    return {
        (board.brake_released, board.dump_closed)  # type: ignore[attr-defined]
        for board in robot.sim.boards.values()
    }


def test_brake_and_dump_valve_have_current_only_while_air_may_move() -> None:
    robot = robot_with(People())
    robot.run(0.3)
    assert outputs(robot) == {(False, False)}
    robot.driver.activate(robot.now)
    robot.run(0.1)
    assert outputs(robot) == {(False, False)}, "ready is not active"
    robot.run(0.1, command=True)
    assert outputs(robot) == {(True, True)}
    robot.driver.vent(robot.now)
    assert outputs(robot) == {(False, False)}
    robot.move()
    robot.run(0.3)  # no commands: a fault
    assert outputs(robot) == {(False, False)}


def test_the_brake_is_released_after_its_delay_and_holds_at_once() -> None:
    """So that the controller can build up pressure before the arm hangs on its muscles."""
    robot = robot_with(People(brake_release_delay=0.25))
    for _ in range(2):  # the delay begins anew with each activation
        robot.move()
        began = robot.now
        assert outputs(robot) == {(False, True)}
        while outputs(robot) == {(False, True)} and robot.now < began + 1.0:
            robot.run(0.002, command=True)
        assert outputs(robot) == {(True, True)}
        assert 0.1 < robot.now - began < 0.26
        robot.driver.vent_at_once(robot.now)
        robot.run(0.1)
        assert outputs(robot) == {(False, False)}


def test_the_boards_themselves_hold_brake_and_dump_valve_when_the_host_dies() -> None:
    robot = robot_with(People())
    robot.move()
    robot.loses = lambda frame_id, data: True
    robot.run(0.12)
    assert outputs(robot) == {(False, False)}


@pytest.mark.parametrize("moving", [False, True])
def test_the_board_obeys_its_enabling_switch_without_a_host(moving: bool) -> None:
    robot = robot_with(People(), enabling_switch=PERMITS)
    if moving:
        robot.move()
    else:
        robot.run(0.3)
    board = robot.sim.boards[0]
    board.misbehave(ENABLING_SWITCH, FORBIDS)
    robot.sim.advance(robot.now + 0.001)
    assert board.state is BoardState.VENTED  # type: ignore[attr-defined]
    assert board.faults == BoardFault(0)  # type: ignore[attr-defined]


class NoPhysics:
    """A plausibility check that finds nothing."""

    period = 0.002
    restarts = 0

    def restart(self) -> None:
        pass

    def update(self, *arguments: object) -> None:
        pass

    def deviations(self) -> Iterator[object]:
        return iter(())


@pytest.mark.parametrize(("fill_time", "judged"), [(1.0, [7.1]), (0.0, [5.0, 6.0, 6.9, 7.1])])
def test_an_open_dump_valve_is_no_lack_of_supply(
    fill_time: float, judged: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Behind an open dump valve the supply is empty; after closing it needs time to fill."""
    seen = []

    def update(
        self: SensorChecks, pressures: object, angles: object, supplies: Sequence[float], now: float
    ) -> Iterator[object]:
        if not all(map(math.isnan, supplies)):
            seen.append(now)
        return iter(())

    monkeypatch.setattr(SensorChecks, "update", update)
    robot = robot_with(People(dump_valve_fill_time=fill_time))
    robot.run(0.1)
    four, two = (0.0,) * 4, (0.0,) * 2
    boards, settings = robot.driver._boards, robot.driver._settings
    judge = FaultJudge(compose(robot.rig), boards, settings, four, NoPhysics())  # type: ignore[arg-type]
    for now, setpoints in ((5.0, None), (6.0, four), (6.9, four), (7.1, four)):
        judge.judge(setpoints, Readings(four, two, two), now)
    assert seen == judged


def test_the_section_people_is_read_written_and_checked(tmp_path: Path) -> None:
    people = People(0, "hand", True, False, 0.5, 1.5)
    save_rig(replace(RIG, people=people), tmp_path / "rig.yaml")
    assert load_rig(tmp_path / "rig.yaml").people == people
    text = (tmp_path / "rig.yaml").read_text()
    for good, bad, expected in (
        ("deadline: 0.5", "deadline: 9.0", "people.deadline = 9 s: must be from 0.05 to 5 s"),
        ("stop_topic: true", "stop_topic: 9", "people.emergency_stop_topic = 9: must be true or"),
        ("stop_board: 0", "stop_bord: 0", "emergency_stop_bord: unknown key; did you mean"),
    ):
        assert good in text
        (tmp_path / "bad.yaml").write_text(text.replace(good, bad))
        with pytest.raises(RigError) as caught:
            load_rig(tmp_path / "bad.yaml")
        assert expected in str(caught.value)
