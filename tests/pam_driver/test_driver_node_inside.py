"""The driver node inside the process of a test: refusals, latched faults, the last vents."""

from __future__ import annotations

import time

import pytest
import rclpy
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from pam_driver.boards.pam_board.codec import (
    BoardCode,
    BoardCodec,
    BoardCommand,
    BoardState,
    ValveCommand,
)
from pam_driver.boards.protocol import EMERGENCY_STOP
from pam_driver.driver_node import DriverNode
from pam_driver.safety.states import SafetyState
from pam_ros.subscriptions import malformed_messages

from .node_bench import NAMES, PATIENCE
from .node_inside import Inside

pytestmark = pytest.mark.system


def test_the_last_words_are_vents_said_several_times(inside: Inside) -> None:
    """A frame may be lost, and after the last of them there is nobody to say it again."""
    assert inside.node.autostart()
    inside.answer(inside.healthy)
    assert inside.node.trigger_activate() == TransitionCallbackReturn.SUCCESS
    inside.port.receive_all(time.monotonic())
    inside.node.close()
    heard = [
        inside.codec.decode(frame.frame_id, frame.data)[1]
        for frame in inside.port.receive_all(time.monotonic())
    ]
    vents = [one for one in heard if isinstance(one, BoardCommand) and one.code is BoardCode.VENT]
    assert len(vents) >= 5
    after = heard[heard.index(vents[0]) :]
    assert not any(any(one.enable) for one in after if isinstance(one, ValveCommand))


def test_commands_before_the_activation_are_counted_and_the_reason_is_shown(
    inside: Inside, capfd: pytest.CaptureFixture[str]
) -> None:
    node = inside.node
    command = serialize_message(JointState(name=NAMES, position=[0.25, -0.25]))
    node._inputs.commands.subscription.callback(command)
    assert "valve_commands refused: not configured" in capfd.readouterr().err
    assert node.autostart()
    node._inputs.commands.subscription.callback(command)
    driver, diagnostics = node._driver, node._diagnostics
    assert driver is not None
    assert diagnostics is not None
    assert driver.intake.rejected["not_active"] == 1
    assert driver.intake.accepted == 0
    assert "the driver is venting; activate it first" in diagnostics._commands().message


@pytest.mark.parametrize("stamped", [True, False])
def test_a_command_has_the_age_with_which_it_arrived_and_is_older_by_its_wait(
    inside: Inside, stamped: bool
) -> None:
    """Also a command without a stamp, which waited for the I/O thread, is not new any more."""
    node = inside.node
    assert node.autostart()
    inside.answer(inside.healthy)
    assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS
    driver = node._driver
    assert driver is not None
    driver._ready_since = 0.0  # so that the command is not from before the activation
    message = JointState(name=NAMES, position=[0.0, 0.0])
    begin = time.time()
    if stamped:
        message.header.stamp = node.get_clock().now().to_msg()
        time.sleep(0.05)
    node._inputs.commands.waited = 0.05
    node._inputs.commands.subscription.callback(serialize_message(message))
    longest = time.time() - begin - 0.049 if stamped else 0.0
    assert driver._command_age <= longest
    assert time.monotonic() - driver._command_time >= 0.049


def fail_and_clean_up(inside: Inside) -> None:
    """An active node whose board stops answering: a latched fault, then a clean-up."""
    node = inside.node
    assert node.autostart()
    inside.answer(inside.healthy)
    assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS
    driver = node._driver
    assert driver is not None
    end = time.monotonic() + PATIENCE
    while driver.state is not SafetyState.FAULT:  # the board does not answer any more
        assert time.monotonic() < end
        time.sleep(0.01)
    node._watch()
    assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS


def test_a_latched_fault_that_no_board_keeps_outlives_a_clean_up(
    inside: Inside, capfd: pytest.CaptureFixture[str]
) -> None:
    """Clean-up, configure and activate in a row must not replace ~/clear_faults."""
    node = inside.node
    inside.board.keeps_host_fault = False
    fail_and_clean_up(inside)
    assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
    inside.answer(inside.healthy)
    capfd.readouterr()
    assert node.trigger_activate() != TransitionCallbackReturn.SUCCESS
    assert "a fault from before the clean-up is still latched" in capfd.readouterr().err
    assert node._calls.on_clear_faults(Trigger.Request(), Trigger.Response()).success
    inside.answer(inside.healthy)
    assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS


def test_a_fault_that_the_board_keeps_outlives_the_node(
    inside: Inside, capfd: pytest.CaptureFixture[str]
) -> None:
    """A new process knows nothing; the board tells it, and only ~/clear_faults releases it."""
    fail_and_clean_up(inside)
    inside.answer(lambda: inside.board.state is BoardState.FAULT)
    inside.node.close()
    inside.node.destroy_node()
    inside.node = node = DriverNode()
    assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
    driver = node._driver
    assert driver is not None
    inside.answer(lambda: driver.state is SafetyState.FAULT)
    capfd.readouterr()
    assert node.trigger_activate() != TransitionCallbackReturn.SUCCESS
    assert "board 0: keeps a fault that the driver latched earlier" in capfd.readouterr().err
    assert node._calls.on_clear_faults(Trigger.Request(), Trigger.Response()).success
    inside.answer(inside.healthy)
    assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS


def test_a_topic_of_the_emergency_stop_stops_the_node(
    monkeypatch: pytest.MonkeyPatch, codec: BoardCodec
) -> None:
    wanted = ("people.emergency_stop_topic", "true"), ("people.deadline", 5.0)
    inside = Inside(monkeypatch, codec, *wanted)
    try:
        node = inside.node
        assert node.count_subscribers("/pam_driver/emergency_stop_released") == 1
        assert node.count_subscribers("/pam_driver/enabling_switch_held") == 0
        assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
        driver = node._driver
        assert driver is not None
        inside.answer(lambda: not driver.missing_boards(time.monotonic()))
        assert "topic: no emergency stop" in driver.activation_problem(time.monotonic())
        node._inputs.on_people(EMERGENCY_STOP, Bool(data=True))
        inside.answer(inside.healthy)
        assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS
        node._inputs.on_people(EMERGENCY_STOP, Bool(data=False))
        inside.answer(lambda: driver.state is SafetyState.FAULT)
        assert "emergency stop is pressed" in str(driver.faults[0])
    finally:
        inside.close()


@pytest.mark.parametrize("malformed", [b"\0\1\0\0", b"", b"\0\1\0\0\7", b"\0\7\0\0\1"])
def test_what_cannot_be_read_permits_people_nothing(
    monkeypatch: pytest.MonkeyPatch, codec: BoardCodec, malformed: bytes
) -> None:
    """Four bytes on the topic of the emergency stop ended the driver in motion."""
    inputs = ("emergency_stop", "enabling_switch", "full_speed")
    wanted = [(f"people.{name}_topic", "true") for name in inputs]
    inside = Inside(monkeypatch, codec, *wanted, ("people.deadline", 5.0))
    try:
        node = inside.node
        assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
        driver = node._driver
        assert driver is not None
        hear = {one.subscription.topic_name.rpartition("/")[2]: one for one in node.polled_topics}
        people = [one.subscription.callback for name, one in hear.items() if name[0] in "ef"]
        assert len(people) == len(inputs)
        now = time.monotonic()
        for one in people:
            one(b"\0\1\0\0\1")
        assert not driver.people.pressed(now)
        assert not driver.people.not_enabled(now)
        assert not driver.people.reduced_speed(now)
        for one in people:
            one(malformed)
        assert driver.people.pressed(now)
        assert "released" in driver.people.not_enabled(now)
        assert driver.people.reduced_speed(time.monotonic())
        inside.answer(lambda: driver.state is SafetyState.FAULT)
        assert "emergency stop is pressed" in str(driver.faults[0])
        assert malformed_messages(node).count == len(inputs)
        node.check()
    finally:
        inside.close()


def test_a_simulated_clock_is_refused(inside: Inside) -> None:
    """With use_sim_time a clock that stops would keep old commands young."""
    wanted = rclpy.parameter.Parameter("use_sim_time", value=True)
    (answer,) = inside.node.set_parameters([wanted])
    assert not answer.successful
    assert "use_sim_time" in answer.reason
    assert not inside.node.get_parameter("use_sim_time").value
