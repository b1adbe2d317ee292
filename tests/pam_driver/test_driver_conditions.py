"""What the driver takes for a fault, to the word and to the limit."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pam_driver.boards.pam_board.codec import (
    BoardCodec,
    BoardFault,
    BoardState,
    Status,
    ValveCommand,
)
from pam_driver.boards.protocol import Condition
from pam_driver.can_bus.bus import BusState, SendOutcome
from pam_driver.driver import ActivationError
from pam_driver.safety.states import SafetyState
from pam_driver.safety.valve_command_intake import CommandRefusedError, NamedCommand
from pam_model.rig import Encoder, Rig

from .exact_bench import GOOD, NAMES, SETTINGS, SETTLED, SUPPLY, TICK, ExactBench


@pytest.fixture
def bench(rig: Rig, codec: BoardCodec) -> ExactBench:
    return ExactBench(rig, codec)


@pytest.mark.parametrize(
    ("state", "condition"),
    [
        (BusState.DOWN, Condition("bus_down", "", "the CAN interface is down")),
        (
            BusState.BUS_OFF,
            Condition("bus_off", "", "the CAN controller is bus-off: check wiring and bitrate"),
        ),
    ],
)
def test_a_bus_that_is_gone(state: BusState, condition: Condition, bench: ExactBench) -> None:
    bench.start()
    bench.port.state = state
    bench.step(1, GOOD)
    assert bench.driver.faults == bench.driver.conditions == (condition,)
    bench.driver.clear_faults(bench.now)
    with pytest.raises(ActivationError) as caught:
        bench.driver.activate(bench.now)
    assert str(caught.value) == condition.text


@pytest.mark.parametrize("state", [BusState.ERROR_WARNING, BusState.ERROR_PASSIVE])
def test_a_bus_that_has_errors_but_works_is_no_fault(state: BusState, bench: ExactBench) -> None:
    bench.start()
    bench.port.state = state
    bench.step(1, GOOD)
    assert bench.driver.conditions == ()


def test_another_driver_is_remembered_for_a_second(bench: ExactBench) -> None:
    bench.start()
    for _ in range(2):
        bench.hear(0, ValveCommand((0.0, 0.0), (False, False), 3))
    bench.step(1, GOOD)
    expected = Condition("foreign_command", "", "another driver commands boards on this bus")
    assert bench.driver.faults == (expected,)
    assert bench.driver.frame_errors == {"foreign_command": 2}
    assert bench.driver.last_frame_error == {"foreign_command": "frame 0x100: a command to board 0"}
    bench.step(510)  # it came a cycle before it was heard
    assert bench.driver.conditions == (expected,)
    bench.step(1)
    assert bench.driver.conditions == ()


def test_a_fault_that_another_driver_keeps_on_a_board_names_it(bench: ExactBench) -> None:
    """Otherwise clearing seems to fail for no reason, again and again."""
    bench.pressures = (0.0, 0.0)
    bench.step(SETTLED)
    bench.follows = False
    bench.hear(0, ValveCommand((0.0, 0.0), (False, False), 3))
    bench.step(1)
    bench.hear(0, Status(BoardState.FAULT, BoardFault.HOST, 0, SUPPLY, 0))
    bench.driver.cycle(bench.now, bench.wall)
    assert [fault.kind for fault in bench.driver.faults] == ["latched_fault", "foreign_command"]


def test_commands_that_stop_are_named_with_what_was_refused_last(bench: ExactBench) -> None:
    bench.start()
    bench.step(64)
    assert bench.driver.state is SafetyState.ACTIVE
    bench.step(1)
    text = "no valid command for 0.125 s"
    assert bench.driver.faults == (Condition("command_timeout", "valve_commands", text),)
    bench.driver.vent(bench.now)
    bench.driver.clear_faults(bench.now)
    bench.start()
    with pytest.raises(CommandRefusedError):
        bench.driver.set_commands(NamedCommand(NAMES[:1], (0.1,)), bench.now)
    bench.step(65)
    text += "; last refused: 1 names, expected 2: every muscle once"
    assert bench.driver.faults == (Condition("command_timeout", "valve_commands", text),)


def test_a_command_is_as_old_as_it_says(bench: ExactBench) -> None:
    bench.start()
    bench.step(32)
    bench.driver.set_commands(NamedCommand(NAMES, GOOD, age=8 * TICK), bench.now)
    bench.step(56)
    assert bench.driver.state is SafetyState.ACTIVE
    bench.step(1)
    assert [fault.kind for fault in bench.driver.faults] == ["command_timeout"]


def test_a_bus_that_takes_nothing_is_named_by_board(bench: ExactBench) -> None:
    bench.start()
    bench.port.outcome = SendOutcome.QUEUE_FULL
    bench.step(64, GOOD)
    assert bench.driver.state is SafetyState.ACTIVE
    bench.step(1, GOOD)
    text = "nothing could be sent for 0.125 s"
    assert bench.driver.faults == (Condition("send_blocked", "board 0", text),)


def test_a_board_has_its_timeout_to_begin_moving(bench: ExactBench) -> None:
    bench.follows = False
    bench.activate()
    bench.step(257, GOOD)  # the first of them begins the motion
    assert bench.driver.state is SafetyState.ACTIVE
    bench.step(1, GOOD)
    assert [fault.kind for fault in bench.driver.faults] == ["board_not_active"]


def test_old_measurements_are_named_by_muscle_and_joint(bench: ExactBench) -> None:
    bench.start()
    bench.step(32, GOOD, silent=True)
    assert bench.driver.state is SafetyState.ACTIVE
    snapshot = bench.step(1, GOOD, silent=True)
    assert bench.driver.faults == (
        Condition("stale_sensor", "elbow_flexor", "no pressure for 0.0625 s"),
        Condition("stale_sensor", "elbow_extensor", "no pressure for 0.0625 s"),
        Condition("stale_sensor", "elbow", "no angle for 0.0625 s"),
    )
    assert all(map(math.isnan, (*snapshot.pressures, *snapshot.positions, *snapshot.velocities)))
    assert (snapshot.pressure_stamp, snapshot.joint_stamp) == (0.0, 0.0)


def test_measurements_are_shown_until_they_are_old(bench: ExactBench) -> None:
    bench.step(8)
    stamp = bench.wall
    snapshot = bench.step(32, silent=True)
    assert snapshot.pressures == (1e5, 2e5)
    assert snapshot.positions == (0.125,)
    assert snapshot.velocities == (0.0,)
    assert (snapshot.pressure_stamp, snapshot.joint_stamp) == (stamp, stamp)


@pytest.mark.parametrize("muscle", [0, 1])
def test_over_pressure_begins_above_the_margin(muscle: int, bench: ExactBench) -> None:
    bench.start()
    limit = 605_000.0
    step = 20.0  # of the pressures on the bus
    pressures = [1e5, 1e5]
    pressures[muscle] = limit
    bench.pressures = (pressures[0], pressures[1])
    bench.step(1, GOOD)
    assert bench.driver.conditions == ()
    pressures[muscle] = limit + step
    bench.pressures = (pressures[0], pressures[1])
    bench.step(1, GOOD)
    (fault,) = bench.driver.faults
    assert (fault.kind, fault.subject) == ("over_pressure", NAMES[muscle])
    assert fault.text == f"{limit + step:.0f} Pa, max_pressure is 600000 Pa"


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_joint_beyond_its_limits_and_margin_vents(
    side: float, rig: Rig, codec: BoardCodec
) -> None:
    exact = replace(rig, plausibility=replace(rig.plausibility, position_margin=0.0625))
    bench = ExactBench(exact, codec)
    bench.start()
    bench.position = side * 1.0625
    snapshot = bench.step(1, GOOD)
    assert snapshot.positions == (side * 1.0625,)
    assert bench.driver.conditions == ()
    bench.position = side * 1.125
    bench.step(1, GOOD)
    text = f"at {side * 1.125:.3f} rad, position_limits are -1 to 1 rad"
    assert bench.driver.faults == (Condition("position_limit", "elbow", text),)


def test_air_that_is_held_while_air_may_move_is_no_blocked_exhaust(
    rig: Rig, codec: BoardCodec
) -> None:
    bench = ExactBench(rig, codec, settings=replace(SETTINGS, exhaust_timeout=0.25))
    bench.start()
    bench.step(256, GOOD)  # 0.5 s
    assert bench.driver.state is SafetyState.ACTIVE
    assert bench.driver.conditions == ()


def two_joints(rig: Rig) -> Rig:
    """The elbow, and a wrist on board 4 with other limits."""
    names = ("wrist_a", "wrist_b")
    muscles = tuple(
        replace(muscle, name=name, board=4, max_pressure=3e5)
        for muscle, name in zip(rig.muscles, names, strict=True)
    )
    wrist = replace(
        rig.joints[0], name="wrist", muscles=names, encoder=Encoder(4), position_limits=(-0.5, 0.5)
    )
    return replace(rig, joints=(*rig.joints, wrist), muscles=rig.muscles + muscles)


def test_each_muscle_and_joint_has_its_own_limits(rig: Rig, codec: BoardCodec) -> None:
    bench = ExactBench(two_joints(rig), codec)
    bench.pressures, bench.position = (4e5, 0.0), 0.75
    bench.step(8)
    over, beyond = bench.driver.conditions
    assert (over.kind, over.subject) == ("over_pressure", "wrist_a")
    assert (beyond.kind, beyond.subject) == ("position_limit", "wrist")


def test_all_that_refuses_activation_is_named(rig: Rig, codec: BoardCodec) -> None:
    bench = ExactBench(two_joints(rig), codec)
    expected = "no answer from board 0, board 4: check power, wiring and board numbers"
    assert bench.driver.activation_problem(bench.now) == expected
    bench.pressures, bench.position = (4e5, 0.0), 0.75
    bench.step(8)
    over = "wrist_a: 400000 Pa, max_pressure is 300000 Pa"
    beyond = "wrist: at 0.750 rad, position_limits are -0.5 to 0.5 rad"
    assert bench.driver.activation_problem(bench.now) == f"{over}; {beyond}"
    bench.pressures = (0.0, 0.0)
    bench.step(SETTLED)
    assert bench.driver.activation_problem(bench.now) == beyond
    bench.position = 0.0
    bench.step(1)
    assert bench.driver.activation_problem(bench.now) == ""
    bench.driver.activate(bench.now)
    bench.pressures, bench.position = (4e5, 0.0), 0.75
    bench.step(1)
    expected = f"faults are latched, call ~/clear_faults: {over}; {beyond}"
    assert bench.driver.activation_problem(bench.now) == expected


def test_a_restart_while_vented_is_acknowledged_by_activation(bench: ExactBench) -> None:
    bench.pressures = (0.0, 0.0)
    bench.step(8)
    bench.uptime = 0.0
    bench.step(8)
    assert [condition.kind for condition in bench.driver.conditions] == ["board_restarted"]
    assert bench.driver.activation_problem(bench.now) == ""
    bench.driver.activate(bench.now)
    bench.step(8, GOOD)
    assert bench.driver.state is SafetyState.ACTIVE


TICKS = st.lists(
    st.tuples(
        st.sampled_from([0.0, 1e5, 5.9e5, 6.2e5, 6.9e5, math.nan]),
        st.sampled_from([-1.3, -1.04, 0.0, 1.04, 1.3, math.nan]),
        st.sampled_from([1, 1, 5, 40]),
        st.booleans(),
    ),
    min_size=1,
    max_size=12,
)


@given(ticks=TICKS)
def test_the_quick_look_at_the_sensors_misses_nothing(
    rig: Rig, codec: BoardCodec, ticks: list[tuple[float, float, int, bool]]
) -> None:
    """What a cycle passes over at a glance has no condition when it is asked channel by channel."""
    bench = ExactBench(rig, codec)
    bench.start()
    judge = bench.driver._judge
    for pressure, position, count, silent in ticks:
        bench.pressures, bench.position = (pressure, 1e5), position
        for _ in range(count):
            bench.step(1, GOOD, silent)
            if judge._sensors_are_well(bench.now):
                assert not list(judge._sensor_conditions(bench.now))
