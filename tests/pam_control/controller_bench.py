"""Everything around a controller process: a plant behind topics, a user, and ears."""

from __future__ import annotations

import math
import os
import sys
import threading
import time
from collections import deque
from pathlib import Path
from typing import Any

import rclpy
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import Plant
from pam_model.rig import load_rig
from pam_ros.driver_state import LATCHED, driver_state_message

CONFIG = Path(__file__).parents[2] / "config"
ELBOW, CONTROLLER = CONFIG / "elbow.yaml", CONFIG / "controller.yaml"
MUSCLES = ["elbow_flexor", "elbow_extensor"]
PATIENCE = 120.0  # s; a busy host takes a minute to import what the node needs
SILENT = 0.5  # s without a command, 250 of its cycles


def environment(domain: int) -> dict[str, str]:
    return {
        **os.environ,
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(domain),
    }


def command(*files: Path, parameters: dict[str, object] | None = None) -> list[str]:
    words = [sys.executable, "-m", "pam_control.controller_node", "--ros-args"]
    for file in files:
        words += ["--params-file", str(file)]
    for name, value in (parameters or {}).items():
        words += ["-p", f"{name}:={value}"]
    return words


class Bench:
    """Everything around the controller: a plant behind topics, a user, and ears."""

    def __init__(self, domain: int) -> None:
        self.domain = domain
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node("bench", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.plant = Plant(PlantParameters.from_rig(load_rig(ELBOW)))
        self.plant.step((0.0, 0.0), 1e-3)
        self.change: dict[str, float] = {}  # of the plant, before its next step
        self.trace: deque[tuple[float, float]] = deque(maxlen=5000)  # time [s], position [rad]
        self.measuring = True
        self.position_of_nan = False
        self.commands: list[JointState] = []
        self.references: list[JointState] = []
        self.errors: list[JointState] = []
        self.health: dict[str, object] = {}
        latest = QoSProfile(depth=1)
        node = self.node
        self.joint_states = node.create_publisher(JointState, "joint_states", latest)
        self.pressure_states = node.create_publisher(JointState, "pressure_states", latest)
        self.trajectory = node.create_publisher(
            JointTrajectory, "pam_controller/joint_trajectory", 1
        )
        self.stream = node.create_publisher(JointState, "pam_controller/commands", latest)
        self.stiffness = node.create_publisher(
            Float64MultiArray, "pam_controller/stiffness_commands", latest
        )
        subscribe = node.create_subscription
        subscribe(JointState, "valve_commands", self.commands.append, latest)
        subscribe(JointState, "pam_controller/reference", self.references.append, latest)
        subscribe(JointState, "pam_controller/error", self.errors.append, latest)
        subscribe(DiagnosticArray, "/diagnostics", self._on_health, 10)
        self._driver: Any = None
        self._vents = 0
        self._ending = threading.Event()
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _on_health(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.health[status.name] = status

    def _serve(self) -> None:
        """Plant in real time at 250 Hz, and the messages."""
        try:
            last = time.monotonic()
            while not self._ending.is_set():
                self.executor.spin_once(timeout_sec=0.002)
                now = time.monotonic()
                if now - last < 0.004:
                    continue
                change, self.change = self.change, {}
                if change:
                    self.plant.change(change)
                spools = self.commands[-1].position if self.commands else (0.0, 0.0)
                q, a, b = self.plant.step(tuple(spools), min(now - last, 0.05))
                last = now
                self.trace.append((now, self.plant.output["position"]))
                if self.measuring:
                    self._publish(math.nan if self.position_of_nan else q, a, b)
        except BaseException as error:
            self._error = error

    def _publish(self, q: float, a: float, b: float) -> None:
        stamp = self.node.get_clock().now().to_msg()
        joint = JointState(name=["elbow"], position=[q])
        joint.header.stamp = stamp
        pressure = JointState(name=MUSCLES[::-1], effort=[b, a])
        pressure.header.stamp = stamp
        self.joint_states.publish(joint)
        self.pressure_states.publish(pressure)

    @property
    def position(self) -> float:
        return self.plant.output["position"]

    def wait(self, condition, what: str, patience: float = PATIENCE) -> None:
        end = time.monotonic() + patience
        while not condition():
            if self._error is not None:
                raise self._error
            said = [one.message for name, one in self.health.items() if "pam_contr" in name]
            assert time.monotonic() < end, f"waited {patience} s for {what}; controller: {said}"
            time.sleep(0.02)

    def send(self, positions: list[float], duration: float, name: str = "elbow") -> None:
        message = JointTrajectory(joint_names=[name])
        point = JointTrajectoryPoint(positions=positions, velocities=[0.0], accelerations=[0.0])
        whole = int(duration)
        point.time_from_start = Duration(sec=whole, nanosec=int((duration - whole) * 1e9))
        message.points = [point]
        self.trajectory.publish(message)

    def call(self, kind, service: str, request):
        client = self.node.create_client(kind, service)
        assert client.wait_for_service(timeout_sec=PATIENCE)
        future = client.call_async(request)
        self.wait(future.done, service)
        return future.result()

    def set_parameter(self, name: str, value: float):
        content = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
        request = SetParameters.Request(parameters=[Parameter(name=name, value=content)])
        return self.call(SetParameters, "pam_controller/set_parameters", request).results[0]

    def controls(self) -> bool:
        """Whether the controller has said that it controls; on a busy host with soft gains."""
        status = self.health.get("pam_controller: loop")
        return status is not None and status.message.startswith("controlling")

    def wait_until_heard(self) -> None:
        """Wait until the controller controls, and hears all references of the bench."""
        self.wait(self.controls, "control")
        self.wait(lambda: self.references, "a reference")
        for publisher in (self.trajectory, self.stream, self.stiffness):
            self.wait(publisher.get_subscription_count, f"a listener of {publisher.topic_name}")

    def wait_until_silent(self) -> None:
        """Wait until no command has come for a while."""
        seen, since = -1, time.monotonic()

        def silent() -> bool:
            nonlocal seen, since
            if len(self.commands) != seen:
                seen, since = len(self.commands), time.monotonic()
            return time.monotonic() - since > SILENT

        self.wait(silent, "silence")

    def say(self, state: str, reason: str = "", activation: int = 0) -> None:
        """Publish a state of the driver."""
        if self._driver is None:
            self._driver = self.node.create_publisher(DiagnosticStatus, "pam_driver/state", LATCHED)
        self._driver.publish(
            driver_state_message("pam_driver", state, reason, activation=activation)
        )

    def vent(self, reason: str = "") -> None:
        """Let the driver say that it is vented, and wait until the controller has heard it."""
        self._vents += 1
        reason = reason or f"vent {self._vents} of the test"
        self.say("vented", reason)
        loop = "pam_controller: loop"
        self.wait(lambda: reason in self.health[loop].message, "the vent")

    def activate(self, activation: int = 0) -> None:
        """Let the driver be vented and activated; wait until the controller has heard both.

        The first state that the controller hears is a new start for it, which drops references.
        """
        self.vent()
        self.say("active", activation=activation)
        self.wait(self.controls, "control")  # an older report tells of the vent

    def close(self) -> None:
        self._ending.set()
        self._thread.join(5.0)
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)
