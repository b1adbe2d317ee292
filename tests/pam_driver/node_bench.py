"""The driver node as a process, a fake board in a thread, and a ROS peer that talks to the node."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile
from sensor_msgs.msg import FluidPressure, JointState
from std_srvs.srv import Trigger

from pam_driver.boards.pam_board.codec import BoardCodec
from pam_driver.can_bus.bus import open_bus
from support.processes import end

from .fake_board import FakeBoard

ROOT = Path(__file__).parents[2]
ELBOW = ROOT / "config/elbow.yaml"
NAMES = ["elbow_flexor", "elbow_extensor"]
SLOW = os.environ.get("PAM_TEST_SLOW_HOST") == "1"
# A shared machine may stop a process for long; what is tested here is order, not speed.
PATIENCE = 60.0 if SLOW else 20.0
PARAMETERS = {
    "rate": 50.0 if SLOW else 200.0,
    "command_timeout": 1.0,
    "sensor_timeout": 1.0,
    "loop_delay_limit": 1.0,
    "board_timeout": 5.0,
    "activate_on_start": True,
    "startup_timeout": PATIENCE,
    # the fake board's pressures obey no physics
    "plausibility": False,
}
WATCHDOG = 1.0


class RealTimeBoard(FakeBoard):
    """Steps itself in a thread until stopped."""

    def __init__(self, codec: BoardCodec, bus: Mapping[str, Any], board: int = 0) -> None:
        options = dict(bus)
        interface, channel = options.pop("interface"), options.pop("channel")
        super().__init__(open_bus(interface, channel, **options), codec, board)
        self.watchdog_timeout = WATCHDOG
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._ending.wait(0.01 if SLOW else 0.004):
            self.step(time.monotonic())

    def stop(self) -> None:
        self._ending.set()
        self._thread.join()
        self.port.close()


class DriverProcess:
    """`driver_node` with its output in files."""

    def __init__(
        self,
        folder: Path,
        domain: int,
        bus: Mapping[str, Any],
        rig: Path = ELBOW,
        parameters: Mapping[str, Any] | None = None,
        program: Sequence[str] = ("-m", "pam_driver.driver_node"),
    ) -> None:
        values = PARAMETERS | {f"bus.{key}": value for key, value in bus.items()}
        values |= parameters or {}
        command = [sys.executable, *program, "--ros-args"]
        command += ["--params-file", str(rig)]
        for key, value in values.items():
            text = str(value).lower() if isinstance(value, bool) else str(value)
            command += ["-p", f"{key}:={text}"]
        folder.mkdir(parents=True, exist_ok=True)
        self._errors = folder / "stderr"
        environment = os.environ | {
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_LOG_DIR": str(folder / "log"),
        }
        with (folder / "stdout").open("wb") as out, self._errors.open("wb") as errors:
            self.process = subprocess.Popen(
                command, stdout=out, stderr=errors, env=environment, cwd=ROOT
            )

    @property
    def errors(self) -> str:
        return self._errors.read_text()

    def send(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    def wait(self) -> int:
        return self.process.wait(PATIENCE)

    def end(self) -> None:
        end(self.process, PATIENCE)


class RosPeer:
    """Hears all topics of the driver, commands valves and calls services."""

    def __init__(self, domain: int) -> None:
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        self.context = rclpy.Context()
        rclpy.init(args=[], context=self.context, domain_id=domain)
        self.node = rclpy.create_node("peer", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.heard: dict[str, list[Any]] = {}
        for topic, kind in {
            "pressure_states": JointState,
            "joint_states": JointState,
            "sent_valve_commands": JointState,
            "elbow_flexor/pressure": FluidPressure,
            "/diagnostics": DiagnosticArray,
        }.items():
            messages = self.heard.setdefault(topic, [])
            self.node.create_subscription(kind, topic, messages.append, 100)
        self.commands = self.node.create_publisher(
            JointState, "valve_commands", QoSProfile(depth=1)
        )
        self.position: list[float] | None = None
        self.make: Callable[[JointState], None] | None = None
        self.node.create_timer(0.02, self._command)

    def _command(self) -> None:
        if self.position is None:
            return
        message = JointState(name=NAMES, position=self.position)
        message.header.stamp = self.node.get_clock().now().to_msg()
        if self.make is not None:
            self.make(message)
        self.commands.publish(message)

    def until(self, condition: Callable[[], Any], what: str) -> None:
        """Spin until something holds."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, f"waited in vain: {what}"
            self.executor.spin_once(timeout_sec=0.02)

    def call(self, kind: Any, name: str, request: Any) -> Any:
        client = self.node.create_client(kind, name)
        self.until(client.service_is_ready, f"service {name}")
        future = client.call_async(request)
        self.until(future.done, f"answer of {name}")
        self.node.destroy_client(client)
        return future.result()

    def trigger(self, name: str) -> Any:
        return self.call(Trigger, f"/pam_driver/{name}", Trigger.Request())

    def lifecycle(self) -> str:
        answer = self.call(GetState, "/pam_driver/get_state", GetState.Request())
        return str(answer.current_state.label)

    def change(self, transition: int) -> bool:
        request = ChangeState.Request()
        request.transition.id = transition
        return bool(self.call(ChangeState, "/pam_driver/change_state", request).success)

    def diagnostics(self, name: str) -> Any:
        """The newest status of a name, None if there is none yet."""
        for array in reversed(self.heard["/diagnostics"]):
            for status in array.status:
                if status.name == name:
                    return status
        return None

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)
