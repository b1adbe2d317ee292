"""A whole simulated rig: rig and robot, or rig, driver, model and controller, as processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, KeyValue
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from pam_demo.chain import BusChoice, Chain, multicast_bus, private_domain
from pam_demo.processes import Setting
from pam_model.errors import PamError
from support.frames import FrameListener
from support.probe import Probe

# A busy host must not fail a test that is about something else than time. Two processors that
# share four nodes, a recorder and the test are busy at 500 Hz.
RATE = 200.0  # Hz
RELAXED: dict[str, dict[str, Setting]] = {
    "rig": {"rate": 2.0 * RATE, "measurement_rate": RATE, "watchdog": 1.0},
    "driver": {
        "rate": RATE,
        # simulated time falls behind on a busy host, and valves seem slow then
        "plausibility": False,
        "activate_on_start": True,
        "startup_timeout": 120.0,
        "command_timeout": 1.0,
        "sensor_timeout": 1.0,
        "loop_delay_limit": 1.0,
        "board_timeout": 3.0,
    },
    "model": {},
    # gains that stand the pauses of a busy host
    "controller": {
        "loop.rate": RATE,
        "loop.stale_after": 1.0,
        "loop.measurement_delay": 0.02,
        "loop.command_delay": 0.02,
    },
}
# An emulated processor is ten to twenty times slower.
SLOW: dict[str, dict[str, Setting]] = {
    "rig": {"rate": 100.0, "measurement_rate": 50.0, "step": 0.001, "watchdog": 5.0},
    "driver": {
        "rate": 50.0,
        "activate_on_start": True,
        "startup_timeout": 600.0,
        "command_timeout": 1.0,
        "sensor_timeout": 1.0,
        "loop_delay_limit": 1.0,
        "board_timeout": 5.0,
    },
    "model": {},
    "controller": {"loop.rate": 50.0, "loop.stale_after": 2.0},
}
NODES = ("rig", "driver", "model", "controller")
TOGETHER = ("rig", "robot")
"""The same with driver, model and controller in one process."""


@dataclass
class Suite:
    """The running processes, with what a test needs to command and watch them."""

    chain: Chain
    probe: Probe
    frames: FrameListener
    patience: float
    settings: dict[str, dict[str, Setting]]
    positions: list[Any]

    def start(self, name: str) -> None:
        """Start one process with the settings of this host."""
        if name == "robot":
            self.chain.start_robot(self.settings)
        else:
            self.chain.start(name, self.settings[name])

    def wait(self, what: str, condition: Callable[[], Any], timeout: float = 20.0) -> Any:
        """Wait for a condition; fails at once if a process has ended by itself."""

        def checked() -> Any:
            self.chain.check()
            return condition()

        return self.probe.wait_for(what, checked, timeout * self.patience)

    def driver_state(self) -> str:
        """The driver's lifecycle state."""
        response = self.probe.call(
            GetState, "pam_driver/get_state", GetState.Request(), 10.0 * self.patience
        )
        return str(response.current_state.label)

    def wait_until_active(self) -> None:
        """Wait until valves may move."""
        self.wait("the driver active", lambda: self.driver_state() == "active", 60.0)

    def wait_until_controlling(self) -> None:
        """Wait until a controller has heard the driver and has begun to follow a reference.

        The first state of the driver that it hears is a new start, which drops references.
        """
        heard = self.probe.listen(JointState, "pam_controller/reference")
        before = len(heard)
        self.wait("a reference", lambda: len(heard) > before, 60.0)
        reports = self.probe.listen(DiagnosticArray, "/diagnostics")
        known = len(reports)

        def controls() -> bool:
            return any(
                status.name == "pam_controller: loop"
                and status.message.startswith("controlling")
                and KeyValue(key="driver", value="takes commands") in status.values
                for message in reports[known:]
                for status in message.status
            )

        self.wait("a controller that has heard the driver", controls, 60.0)

    def get_ready(self) -> None:
        """Start what has ended and activate what has stopped, as a person would."""
        ended = [name for name in NODES if not self._runs(name)]
        for name in ended:
            self.start(name)
        if "model" in ended:  # nothing else waits for it, and it may be what a test ends next
            names = self.probe.node.get_node_names
            self.wait("the model in the graph", lambda: "pam_model" in names())
        if ended or self.driver_state() != "active":
            self.recover()
            self.wait_until_controlling()

    def _runs(self, name: str) -> bool:
        return name in self.chain.processes and self.chain.processes[name].running

    def recover(self) -> None:
        """Clear faults and activate, as a person would."""
        timeout = 10.0 * self.patience
        request = ChangeState.Request()
        request.transition.id = Transition.TRANSITION_ACTIVATE

        def activated() -> bool:
            self.probe.call(Trigger, "pam_driver/clear_faults", Trigger.Request(), timeout)
            self.probe.call(ChangeState, "pam_driver/change_state", request, timeout)
            return self.driver_state() == "active"

        self.wait("the driver active again", activated, 30.0)

    def move(self, targets: dict[str, float], seconds: float = 1.0) -> None:
        """Send a trajectory with one point."""
        message = JointTrajectory(joint_names=list(targets))
        point = JointTrajectoryPoint(positions=list(targets.values()))
        point.velocities = [0.0] * len(targets)
        point.time_from_start.sec = int(seconds)
        point.time_from_start.nanosec = int(seconds % 1.0 * 1e9)
        message.points = [point]
        topic = "pam_controller/joint_trajectory"
        self.probe.publisher(JointTrajectory, topic, 10.0 * self.patience).publish(message)

    def position(self, joint: str) -> float:
        """The latest measured angle [rad]."""
        if not self.positions:
            return float("nan")
        message = self.positions[-1]
        return float(message.position[list(message.name).index(joint)])

    def wait_until_at(self, joint: str, angle: float, tolerance: float = 0.02) -> None:
        """Wait until a joint has been at an angle for 50 measurements."""

        def there() -> bool:
            last = self.positions[-50:]
            return len(last) == 50 and all(
                abs(message.position[list(message.name).index(joint)] - angle) < tolerance
                for message in last
            )

        self.wait(f"{joint} at {angle:g} rad", there)


@contextmanager
def running(
    rig_path: Path,
    bus: BusChoice,
    environment: dict[str, str],
    folder: Path,
    nodes: tuple[str, ...] = NODES,
    *,
    slow: bool,
) -> Iterator[Suite]:
    """A chain for a rig file; its nodes are ended at the end, and their output is shown."""
    environment = {**environment, "ROS_LOG_DIR": str(folder)}
    if slow:
        # compiling costs more than it saves there
        environment["PAM_NO_NUMBA"] = "1"
    with FrameListener(bus) as frames, Probe(environment) as probe:
        chain = Chain([rig_path], bus, environment)
        positions = probe.listen(JointState, "joint_states")
        settings = SLOW if slow else RELAXED
        suite = Suite(chain, probe, frames, 30.0 if slow else 1.0, settings, positions)
        try:
            for name in nodes[:3]:
                suite.start(name)
            if len(nodes) > 1:
                suite.wait_until_active()
            if "controller" in nodes:
                suite.start("controller")
            if nodes[-1] in {"controller", "robot"}:
                suite.wait_until_controlling()
            yield suite
        finally:
            chain.stop_all()
            for name, text in chain.outputs.items():
                print(f"--- {name}\n{text}")


@pytest.fixture
def make_suite(
    bus: BusChoice, ros_environment: dict[str, str], slow_host: bool, tmp_path: Path
) -> Iterator[Callable[..., Suite]]:
    """A function that starts the chain of a rig file for one test, with `NODES` or `TOGETHER`."""
    with ExitStack() as stack:
        yield lambda rig_path, nodes=NODES: stack.enter_context(
            running(rig_path, bus, ros_environment, tmp_path, nodes, slow=slow_host)
        )


@pytest.fixture(scope="session")
def shared() -> Iterator[dict[str, Any]]:
    """What `suite` has started, as `suite`, and `close`, which ends it."""
    kept: dict[str, Any] = {"close": lambda: None}
    yield kept
    kept["close"]()


@pytest.fixture
def suite(shared: dict[str, Any], rig_path: Path, slow_host: bool, tmp_path_factory: Any) -> Suite:
    """The elbow, controlled; the same chain for all tests, which leave it somewhere in its range.

    A chain that cannot be made to work again is replaced.
    """
    if "suite" in shared:
        try:
            shared["suite"].get_ready()
        except (AssertionError, PamError):
            shared.pop("suite")
            shared["close"]()
    if "suite" not in shared:
        stack = ExitStack()
        shared["close"] = stack.close
        folder = tmp_path_factory.mktemp("chain")
        started = running(rig_path, multicast_bus(), private_domain(), folder, slow=slow_host)
        shared["suite"] = stack.enter_context(started)
    found: Suite = shared["suite"]
    return found
