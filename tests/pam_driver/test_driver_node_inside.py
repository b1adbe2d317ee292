"""The driver node inside the test's process: start-up that gives up, refusals, the last vents."""

from __future__ import annotations

import itertools
import time
import uuid
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import State
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from pam_demo.chain import private_domain
from pam_driver import driver_assembly, driver_node
from pam_driver.boards.pam_board.codec import (
    BoardCode,
    BoardCodec,
    BoardCommand,
    BoardFault,
    BoardState,
    ValveCommand,
)
from pam_driver.boards.protocol import EMERGENCY_STOP
from pam_driver.can_bus.bus import CanPort, open_bus
from pam_driver.can_bus.bus_opening import BusError
from pam_driver.driver_node import DriverNode
from pam_driver.safety.people_inputs import FULL_SPEED
from pam_driver.safety.states import SafetyState
from pam_ros.driver_state import (
    driver_state_message,
    permits_full_speed,
    reason_against_commands,
)
from pam_ros.errors import ParameterError
from pam_ros.subscriptions import malformed_messages

from .fake_board import FakeBoard
from .node_bench import ELBOW, NAMES, PATIENCE

pytestmark = pytest.mark.system

TIMEOUT = 30.0
PARAMETERS = {
    "bus.interface": "virtual",
    "startup_timeout": TIMEOUT,
    "plausibility": "false",
    "rate": 100.0,
    "sensor_timeout": 1.0,
    "board_timeout": 5.0,
}


class Inside:
    """A node, the far end of its bus, and a clock of the node that can be put forward."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, codec: BoardCodec, *extra: tuple[str, object]
    ) -> None:
        channel = f"bus_{uuid.uuid4().hex}"
        arguments = ["--ros-args", "--params-file", str(ELBOW), "-p", f"bus.channel:={channel}"]
        for name, value in [*PARAMETERS.items(), *extra]:
            arguments += ["-p", f"{name}:={value}"]
        rclpy.init(args=arguments, domain_id=int(private_domain()["ROS_DOMAIN_ID"]))
        self.ahead = 0.0
        clock = SimpleNamespace(
            monotonic=lambda: time.monotonic() + self.ahead,
            monotonic_ns=time.monotonic_ns,
            time=time.time,
            sleep=time.sleep,
        )
        monkeypatch.setattr(driver_node, "time", clock)
        self.codec = codec
        self.port: CanPort = open_bus("virtual", channel)
        self.board = FakeBoard(self.port, codec)
        self.node = DriverNode()

    def answer(self, until: Callable[[], bool]) -> None:
        """Let the board answer until something holds."""
        end = time.monotonic() + PATIENCE
        while not until():
            assert time.monotonic() < end
            self.board.step(time.monotonic())
            time.sleep(0.005)

    def healthy(self) -> bool:
        driver = self.node._driver
        return driver is not None and not driver.activation_problem(time.monotonic())

    def is_active(self) -> bool:
        return bool(self.node._state_machine.current_state[0] == State.PRIMARY_STATE_ACTIVE)

    def close(self) -> None:
        self.node.close()
        self.node.destroy_node()
        self.port.close()
        rclpy.try_shutdown()


@pytest.fixture
def inside(monkeypatch: pytest.MonkeyPatch, codec: BoardCodec) -> Iterator[Inside]:
    bench = Inside(monkeypatch, codec)
    yield bench
    bench.close()


@pytest.fixture
def eager(monkeypatch: pytest.MonkeyPatch, codec: BoardCodec) -> Iterator[Inside]:
    """A node that is asked to activate itself."""
    bench = Inside(monkeypatch, codec, ("activate_on_start", "true"))
    yield bench
    bench.close()


def test_autostart_gives_up_after_its_time_and_a_late_board_starts_nothing(
    inside: Inside, capfd: pytest.CaptureFixture[str]
) -> None:
    """No robot starts by itself when someone plugs it in later."""
    node = inside.node
    assert node.autostart()
    node._watch()
    assert "not activated" not in capfd.readouterr().err
    inside.ahead = TIMEOUT + 1.0
    node._watch()
    assert "not activated: no answer from board 0" in capfd.readouterr().err
    inside.ahead = 0.0
    inside.answer(inside.healthy)
    node._watch()
    assert not inside.is_active()
    assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS
    assert inside.is_active()


def test_autostart_measures_and_leaves_moving_air_to_a_person(
    inside: Inside, capfd: pytest.CaptureFixture[str]
) -> None:
    assert inside.node.autostart()
    inside.answer(inside.healthy)
    for _ in range(3):
        inside.node._watch()
    assert not inside.is_active()
    driver = inside.node._driver
    assert driver is not None
    assert driver.state is SafetyState.VENTED
    told = capfd.readouterr().err
    assert told.count("to move: ros2 lifecycle set /pam_driver activate") == 1
    assert inside.node.trigger_activate() == TransitionCallbackReturn.SUCCESS


def test_a_start_that_is_asked_to_activate_waits_for_the_board(eager: Inside) -> None:
    assert eager.node.autostart()
    eager.answer(eager.healthy)
    eager.ahead = TIMEOUT - 1.0
    eager.node._watch()  # the node's clock says: silent for long
    assert not eager.is_active()
    eager.ahead = 0.0
    eager.answer(eager.healthy)
    eager.node._watch()
    assert eager.is_active()


def test_activation_at_start_without_autostart_is_a_mistake(
    monkeypatch: pytest.MonkeyPatch, codec: BoardCodec
) -> None:
    try:
        with pytest.raises(ParameterError, match="activate_on_start: true needs autostart: true"):
            Inside(monkeypatch, codec, ("activate_on_start", "true"), ("autostart", "false"))
    finally:
        rclpy.try_shutdown()


def test_a_refused_activation_says_why_after_autostart_has_ended(
    inside: Inside, capfd: pytest.CaptureFixture[str]
) -> None:
    assert inside.node.autostart()
    inside.ahead = TIMEOUT + 1.0
    inside.node._watch()
    inside.ahead = 0.0
    capfd.readouterr()
    assert inside.node.trigger_activate() != TransitionCallbackReturn.SUCCESS
    assert "not activated: no answer from board 0" in capfd.readouterr().err


def test_a_refused_configuration_says_why_after_autostart_has_ended(
    inside: Inside, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    node = inside.node
    assert node.autostart()
    assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS

    def gone(*arguments: object, **options: object) -> CanPort:
        raise BusError("CAN bus socketcan can0: no such interface")

    monkeypatch.setattr(driver_assembly, "open_buses", gone)
    capfd.readouterr()
    assert node.trigger_configure() != TransitionCallbackReturn.SUCCESS
    assert "can0: no such interface" in capfd.readouterr().err


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


def test_a_stop_before_the_board_answers_cancels_the_start(eager: Inside) -> None:
    """An operator who calls ~/vent while autostart waits must not see the arm fill later."""
    node = eager.node
    assert node.autostart()
    answer = node._calls.on_vent(Trigger.Request(), Trigger.Response())
    assert answer.success
    assert "cancelled" in answer.message
    eager.answer(eager.healthy)
    node._watch()
    assert not eager.is_active()


def test_a_fault_before_the_start_cancels_it_even_when_it_is_cleared(
    eager: Inside, capfd: pytest.CaptureFixture[str]
) -> None:
    """Clearing a fault is no request to move."""
    node = eager.node
    eager.board.state, eager.board.faults = BoardState.FAULT, BoardFault.WATCHDOG
    assert node.autostart()
    driver = node._driver
    assert driver is not None
    eager.answer(lambda: any(one.kind == "board_fault" for one in driver.conditions))
    node._watch()
    assert "the activation at start-up is cancelled by board 0: " in capfd.readouterr().err
    assert node._calls.on_clear_faults(Trigger.Request(), Trigger.Response()).success
    eager.answer(eager.healthy)
    node._watch()
    assert not eager.is_active()


def test_a_clean_up_before_the_start_cancels_it(
    eager: Inside, capfd: pytest.CaptureFixture[str]
) -> None:
    node = eager.node
    assert node.autostart()
    assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
    assert "the activation at start-up is cancelled by a clean-up" in capfd.readouterr().err
    assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
    eager.answer(eager.healthy)
    node._watch()
    assert not eager.is_active()


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


def test_the_lamp_is_green_only_while_every_muscle_is_measured_empty(
    inside: Inside, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = inside.node
    told: list[str] = []
    monkeypatch.setattr(
        node._reported._topic,
        "_lamps",
        SimpleNamespace(publish=lambda message: told.append(message.data)),
    )
    assert node.autostart()
    inside.answer(inside.healthy)
    assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS
    node._watch()
    assert told[-1] == "yellow", "ready: a command moves the joint"
    node._calls.on_vent(Trigger.Request(), Trigger.Response())
    inside.answer(inside.healthy)
    node._watch()
    assert told[-1] == "green"
    assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
    assert told[-1] == "off"
    assert all(one != other for one, other in itertools.pairwise(told)), "on change only"


def test_every_change_of_state_is_published_with_its_reason(
    inside: Inside, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The controller follows this topic, so it must be right and early."""
    node = inside.node
    told: list[str] = []
    monkeypatch.setattr(
        node._reported._topic,
        "_states",
        SimpleNamespace(publish=lambda message: told.append(message.message)),
    )
    assert node.autostart()
    inside.answer(inside.healthy)
    assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS
    node._calls.on_vent(Trigger.Request(), Trigger.Response())
    node._watch()
    node._watch()
    assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
    # how soon the muscles are measured empty depends on the I/O thread
    settled = [text.replace("venting:", "vented:") for text in told]
    assert [text for text, _ in itertools.groupby(settled)] == [
        "vented: configured, not activated yet",
        "ready",
        "vented: a call of ~/vent",
        "unconfigured",
    ]


def test_clear_faults_says_of_an_active_driver_that_it_is_active(inside: Inside) -> None:
    node = inside.node
    assert node.autostart()
    inside.answer(inside.healthy)
    assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS
    answer = node._calls.on_clear_faults(Trigger.Request(), Trigger.Response())
    assert (answer.success, answer.message) == (True, "ready")
    node._watch()
    assert node._reported._topic.text == "ready", "not: faults cleared, not activated yet"
    node._calls.on_vent(Trigger.Request(), Trigger.Response())
    inside.answer(inside.healthy)
    answer = node._calls.on_clear_faults(Trigger.Request(), Trigger.Response())
    assert answer.message.endswith("; activate to move")


def test_the_state_tells_the_controller_whether_full_speed_is_permitted(
    monkeypatch: pytest.MonkeyPatch, codec: BoardCodec
) -> None:
    wanted = ("people.full_speed_topic", "true"), ("people.deadline", 5.0)
    inside = Inside(monkeypatch, codec, *wanted)
    try:
        node = inside.node
        assert node.count_subscribers("/pam_driver/full_speed_permitted") == 1
        assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
        assert "at reduced speed" in node._reported._topic.text
        node._inputs.on_people(FULL_SPEED, Bool(data=True))
        node._reported.publish(node._driver)
        assert "at reduced speed" not in node._reported._topic.text
        node._inputs.on_people(FULL_SPEED, Bool(data=False))
        node._reported.publish(node._driver)
        assert "at reduced speed" in node._reported._topic.text
    finally:
        inside.close()


@pytest.mark.parametrize("reduced", [True, False])
def test_a_state_without_a_word_about_the_speed_permits_no_full_speed(reduced: bool) -> None:
    told = driver_state_message("pam_driver", "active", "", reduced=reduced)
    assert permits_full_speed(told) is not reduced
    assert reason_against_commands(told) == ""
    assert not permits_full_speed(DiagnosticStatus())
