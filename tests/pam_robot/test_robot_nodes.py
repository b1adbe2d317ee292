"""The three nodes of one process, made in this one, on a bus that only this process hears."""

from __future__ import annotations

import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy")

from lifecycle_msgs.msg import State  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_msgs.msg import Bool  # noqa: E402

from pam_control.controller_node import ControllerNode  # noqa: E402
from pam_demo.chain import private_domain  # noqa: E402
from pam_driver.buses import OnlyBus, open_buses  # noqa: E402
from pam_driver.driver_node import DriverNode  # noqa: E402
from pam_driver.safety.states import SafetyState  # noqa: E402
from pam_model.model_node import ModelNode  # noqa: E402
from pam_model.rig import load_rig  # noqa: E402
from pam_robot.robot_node import NODES, RobotNodes  # noqa: E402
from pam_ros.errors import ParameterError  # noqa: E402
from pam_ros.node_arguments import arguments_by_node  # noqa: E402
from pam_ros.start import start_ros  # noqa: E402
from pam_ros.unforeseen import raise_handed_over  # noqa: E402
from pam_sim.boards.protocol import BoardSettings  # noqa: E402
from pam_sim.rig_loop import RigLoop  # noqa: E402
from pam_sim.simulated_rig import SimulatedRig  # noqa: E402
from support.rigs import CONFIG, ELBOW  # noqa: E402

pytestmark = pytest.mark.system

PATIENCE = 60.0  # s
RELAXED = {  # a busy host must not stop the robot of a test that is about something else
    "pam_driver:rate": 200.0,
    "pam_driver:plausibility": "false",
    "pam_driver:command_timeout": 1.0,
    "pam_driver:sensor_timeout": 1.0,
    "pam_driver:loop_delay_limit": 1.0,
    "pam_driver:board_timeout": 5.0,
    "pam_controller:loop.rate": 100.0,
    "pam_controller:loop.stale_after": 1.0,
}


class Robot:
    """A robot in this process; its main loop is run by the test."""

    def __init__(self, rig_file: Any = ELBOW, **extra: object) -> None:
        self.channel = f"bus_{uuid.uuid4().hex}"
        given = {
            "pam_driver:bus.interface": "virtual",
            "pam_driver:bus.channel": self.channel,
            **RELAXED,
            **{name.replace("__", ":", 1): value for name, value in extra.items()},
        }
        words = ["--ros-args", "--params-file", str(rig_file)]
        for name, value in given.items():
            words += ["-p", f"{name}:={value}"]
        common, own = arguments_by_node([*words, "-r", "__ns:=/left"], NODES)
        start_ros(common)
        self.rig_file, self.sim, self.boards = rig_file, None, None
        self.nodes = RobotNodes(DriverNode, ControllerNode, ModelNode, own)

    def start(self) -> None:
        """Boards, the cycle, and the driver that measures."""
        rig = load_rig(self.rig_file)
        settings = BoardSettings(watchdog_period=5.0)
        self.sim = SimulatedRig(rig, now=time.monotonic(), board=settings)
        only = OnlyBus("virtual", self.channel, None, {})
        self.boards = RigLoop(self.sim, open_buses(rig, self.sim.wiring, only), 400.0)
        self.boards.start()
        self.nodes.cycle.loop.start()
        assert self.nodes.driver.autostart()

    @property
    def driver(self) -> Any:
        return self.nodes.driver._driver

    @property
    def controller(self) -> Any:
        return self.nodes.controller

    def until(self, condition: Callable[[], object], what: str = "") -> None:
        """Run the main loop's timers until something holds."""
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, what or self.driver.state
            self.nodes.driver.steady_timers.call_due()
            self.controller.steady_timers.call_due()
            time.sleep(0.002)

    def activate(self) -> None:
        self.until(lambda: not self.driver.activation_problem(time.monotonic()), "no boards")
        self.nodes.driver.trigger_activate()
        self.until(lambda: self.driver.state is SafetyState.ACTIVE, "no command")

    def lifecycle(self) -> int:
        return int(self.nodes.driver._state_machine.current_state[0])

    def close(self) -> None:
        self.nodes.close()
        self.nodes.end()
        if self.boards is not None:
            self.boards.stop()
        rclpy.try_shutdown()


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> None:
    for key, value in private_domain().items():
        monkeypatch.setenv(key, value)


@contextmanager
def running(rig_file: Any = ELBOW, **extra: object) -> Iterator[Robot]:
    made = Robot(rig_file, **extra)
    try:
        made.start()
        yield made
    finally:
        made.close()


@pytest.fixture
def robot(domain: None) -> Iterator[Robot]:
    with running() as made:
        yield made


def heard(node: Any, topic: str, kind: Any = JointState) -> list[Any]:
    """What a listener in this process receives, taken by `Robot.until`'s condition."""
    received: list[Any] = []
    node.create_subscription(kind, topic, received.append, 10)
    return received


def test_the_graph_has_the_three_nodes_and_parameters_in_the_namespace(domain: None) -> None:
    robot = Robot()
    try:
        names = {node.get_fully_qualified_name() for node in robot.nodes.nodes}
        assert names == {"/left/pam_driver", "/left/pam_controller", "/left/pam_model"}
        assert robot.nodes.driver.get_parameter("bus.channel").value == robot.channel
        assert robot.controller.get_parameter("loop.rate").value == 100.0
        delay = robot.controller.get_parameter("loop.command_delay").value
        assert delay == robot.controller._controller.settings.command_delay == 0.001
        assert robot.nodes.cycle.loop.period == pytest.approx(1.0 / 200.0)
        served = dict(robot.nodes.driver.get_service_names_and_types())
        assert {"/left/pam_driver/vent", "/left/pam_controller/stop"} <= set(served)
    finally:
        robot.close()


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        ({"pam_controller__loop.rate": 150.0}, "loop.rate = 150 Hz.*pam|whole multiple"),
        ({"pam_driver__unknown_key": 1}, "unknown_key"),
        ({"pam_driver__activate_on_start": "true", "pam_driver__autostart": "false"}, "autostart"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_no_node(
    domain: None, extra: dict[str, object], message: str
) -> None:
    try:
        with pytest.raises((ParameterError, Exception), match=message):
            Robot(**extra)
    finally:
        rclpy.try_shutdown()


def test_the_joint_is_controlled_without_a_message_and_the_driver_follows_its_lifecycle(
    robot: Robot,
) -> None:
    robot.activate()
    assert robot.controller._controller.active
    taken = robot.driver.intake.accepted
    robot.until(lambda: robot.driver.intake.accepted > taken + 20)
    assert robot.driver.intake.rejected.total() == 0
    robot.nodes.driver.trigger_deactivate()
    robot.until(lambda: robot.driver.state in {SafetyState.VENTED, SafetyState.VENTING})
    assert "driver is" in robot.controller._reason_against_references()
    robot.until(lambda: robot.driver.state is SafetyState.VENTED)
    robot.activate()
    robot.nodes.driver.trigger_deactivate()
    robot.until(lambda: robot.lifecycle() == State.PRIMARY_STATE_INACTIVE)
    robot.nodes.driver.trigger_cleanup()
    assert robot.driver is None
    assert not robot.nodes.cycle.has("driver")
    cycles = robot.nodes.cycle.loop.statistics.cycles
    robot.until(lambda: robot.nodes.cycle.loop.statistics.cycles > cycles + 5, "cycles go on")
    assert "unconfigured" in robot.controller._reason_against_references()
    robot.nodes.driver.trigger_configure()
    robot.activate()


def test_stop_is_answered_and_a_guard_vents(robot: Robot) -> None:
    robot.activate()
    (stop,) = (each for each in robot.controller.services if each.srv_name.endswith("/stop"))
    assert stop.callback(None, SimpleNamespace(success=False, message="")).success
    robot.nodes._link.two_publishers = lambda: "a reason of the test"
    robot.until(lambda: robot.driver.state is not SafetyState.ACTIVE)
    robot.until(lambda: robot.driver.state in {SafetyState.VENTED, SafetyState.VENTING})
    assert not robot.driver.faults
    assert robot.nodes.driver._reported.vent_reason == "the controller asks for it"


def test_an_exception_of_the_controller_is_a_fault_that_the_boards_keep(robot: Robot) -> None:
    robot.activate()

    def fail(*_: object) -> None:
        raise RuntimeError("of the test")

    robot.controller._controller.step = fail
    robot.until(lambda: robot.driver.state is SafetyState.FAULT)
    assert {fault.kind for fault in robot.driver.faults} == {"internal_error"}
    assert "of the test" in robot.driver.faults[0].text
    robot.until(lambda: robot.driver.boards_keep_fault, "the boards keep it")
    with pytest.raises(RuntimeError, match="of the test"):  # what the program ends with
        raise_handed_over()


def test_a_cycle_that_does_not_return_vents_at_once(robot: Robot) -> None:
    """The commands would stay as they are on boards without a watchdog."""
    robot.activate()
    go_on = threading.Event()
    ordinary = robot.nodes.cycle._work

    def stall() -> None:
        assert go_on.wait(PATIENCE)

    robot.nodes.cycle._work = ordinary._replace(control=stall)
    try:
        robot.until(lambda: robot.driver.state is SafetyState.FAULT)
        assert [fault.kind for fault in robot.driver.faults] == ["loop_too_slow"]
        assert "has not returned" in robot.driver.faults[0].text
        robot.until(lambda: not any(board.active for board in robot.sim.boards.values()))
    finally:
        robot.nodes.cycle._work = ordinary
        go_on.set()
    cycles = robot.nodes.cycle.loop.statistics.cycles
    robot.until(lambda: robot.nodes.cycle.loop.statistics.cycles > cycles + 5)
    assert robot.driver.state is SafetyState.FAULT, "latched"


def test_the_end_vents_although_a_cycle_does_not_return(domain: None) -> None:
    """The main thread no longer watches the cycle then."""
    robot, stalls, go_on = Robot(), threading.Event(), threading.Event()

    def stall() -> None:
        stalls.set()
        assert go_on.wait(PATIENCE)

    try:
        robot.start()
        robot.activate()
        robot.nodes.cycle._work = robot.nodes.cycle._work._replace(control=stall)
        assert stalls.wait(PATIENCE)
        began = time.monotonic()
        assert not robot.nodes.close()
        assert time.monotonic() - began < 20.0
        robot.until(lambda: not any(board.active for board in robot.sim.boards.values()))
    finally:
        go_on.set()
        robot.close()


def test_observers_hear_the_commands_and_others_who_command_are_a_fault(robot: Robot) -> None:
    """The driver's own subscription is no observer, and does not hear its controller twice."""
    robot.activate()
    link = robot.nodes._link
    assert link._topic.heard() is False
    peer = rclpy.create_node("peer", namespace="left")
    try:
        received = heard(peer, "valve_commands")
        robot.until(lambda: rclpy.spin_once(peer, timeout_sec=0.0) or len(received) > 5)
        assert {message.header.frame_id for message in received} == {robot.nodes.source}
        assert list(received[0].name) == ["elbow_flexor", "elbow_extensor"]
        assert robot.driver.state is SafetyState.ACTIVE
        stranger = peer.create_publisher(JointState, "valve_commands", 10)
        message = JointState(name=list(received[0].name), position=[0.0, 0.0])
        message.header.frame_id = "stranger"

        def stopped() -> bool:
            stranger.publish(message)
            return bool(robot.driver.faults)

        robot.until(stopped)
        assert robot.driver.faults[0].kind == "two_publishers"
    finally:
        peer.destroy_node()


def test_an_emergency_stop_by_topic_is_latched(domain: None) -> None:
    with running(**{"pam_driver__people.emergency_stop_topic": "true"}) as robot:
        peer = rclpy.create_node("peer", namespace="left")
        button = peer.create_publisher(Bool, "pam_driver/emergency_stop_released", 10)
        released = True

        def told(condition: Callable[[], object]) -> Callable[[], object]:
            def tell() -> object:
                button.publish(Bool(data=released))
                return condition()

            return tell

        robot.until(told(lambda: not robot.driver.activation_problem(time.monotonic())))
        robot.nodes.driver.trigger_activate()
        robot.until(told(lambda: robot.driver.state is SafetyState.ACTIVE), "no command")
        released = False
        robot.until(told(lambda: robot.driver.state is SafetyState.FAULT))
        assert robot.driver.faults[0].kind == "emergency_stop"
        released = True
        cycles = robot.nodes.cycle.loop.statistics.cycles
        robot.until(told(lambda: robot.nodes.cycle.loop.statistics.cycles > cycles + 20))
        assert robot.driver.state is SafetyState.FAULT
        peer.destroy_node()


def test_two_joints_are_controlled(domain: None) -> None:
    with running(CONFIG / "two_joints.yaml") as robot:
        robot.activate()
        assert robot.controller._controller.active
        assert len(robot.controller._measurement.positions) == 2
        assert len(robot.controller._measurement.pressures) == 4
