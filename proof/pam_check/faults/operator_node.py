"""Moves the joints of a running chain, injects faults, observes the reactions and recovers."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger

from pam_check.faults.chain import AMPLITUDE, FREQUENCY
from pam_demo.chain import set_environment
from pam_driver.boards.pam_board.codec import (
    BoardCodec,
    BoardState,
    FrameError,
    Status,
    ValveCommand,
)
from pam_driver.can_bus.bus import CanPort
from pam_driver.driver_parameters import PEOPLE_TOPICS
from pam_model.errors import PamError
from pam_model.rig import Rig
from pam_ros.foreign_text import SENTENCE, plain
from pam_ros.start import start_ros
from pam_ros.subscriptions import MOST_BYTES_OF_DIAGNOSTICS, subscribe

_PERIOD = 0.01  # s, of the references


class NoAnswerError(PamError):
    """A service did not answer."""


class FaultOperator(Node):  # type: ignore[misc]
    """Client of rig, driver and controller that also receives the frames on the bus.

    Parameters
    ----------
    rig : Rig
        Names the joints, which all move, and the topics that must permit it.
    port : CanPort
        Port on the bus; the caller closes it.

    Attributes
    ----------
    states : dict of int to BoardState
        Last reported state of each board.
    last_air : float
        Last time when a board reported that it allows air flow, monotonic [s].
    last_enabled : float
        Last time when the driver commanded a board to allow it, monotonic [s].
    fault, suspicion : str
        Last texts of the driver's diagnostics since `forget`.
    """

    def __init__(self, rig: Rig, port: CanPort) -> None:
        super().__init__("fault_operator")
        self.states: dict[int, BoardState] = {}
        self.last_air = self.last_enabled = -math.inf
        self.fault = self.suspicion = ""
        self._joints = rig.joint_names
        self._port = port
        self._codec = BoardCodec.from_dbc()
        self._commands = self.create_publisher(JointState, "pam_controller/commands", 1)
        self._permissions = [
            self.create_publisher(Bool, topic.replace("~", "pam_driver"), 1)
            for name, topic in PEOPLE_TOPICS.items()
            if getattr(rig.people, f"{name}_topic")
        ]
        self._faults = self.create_publisher(String, "pam_rig/inject_fault", 10)
        self._triggers = {
            name: self.create_client(Trigger, name)
            for name in ("pam_rig/mend_faults", "pam_driver/clear_faults", "pam_driver/vent")
        }
        self._lifecycle = self.create_client(ChangeState, "pam_driver/change_state")
        subscribe(
            self, DiagnosticArray, "/diagnostics", self._on_diagnostics, 10,
            most_bytes=MOST_BYTES_OF_DIAGNOSTICS,
        )  # fmt: skip
        self._started = time.monotonic()
        self._next = self._started

    @property
    def moves_air(self) -> bool:
        """Whether any board reports that it allows air flow."""
        return BoardState.ACTIVE in self.states.values()

    def forget(self) -> None:
        """Delete the stored texts of the diagnostics."""
        self.fault = self.suspicion = ""

    def run(self, duration: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Move and observe for a time or until a condition is true; return whether it is true.

        Parameters
        ----------
        duration : float
            Longest time [s].
        until : callable
            The condition, which is evaluated repeatedly.
        """
        end = time.monotonic() + duration
        while time.monotonic() < end:
            rclpy.spin_once(self, timeout_sec=0.001)
            self._listen()
            self._move()
            if until():
                return True
        return False

    def inject(self, text: str) -> float:
        """Inject a fault and return the time."""
        self._faults.publish(String(data=text))
        return time.monotonic()

    def trigger(self, name: str) -> None:
        """Call a service of the rig or the driver.

        Raises
        ------
        NoAnswerError
            If it does not answer.
        """
        self._call(self._triggers[name], Trigger.Request())

    def ready(self) -> bool:
        """Whether all services and subscribers are available."""
        clients = (*self._triggers.values(), self._lifecycle)
        return all(client.service_is_ready() for client in clients) and bool(
            self._commands.get_subscription_count() and self._faults.get_subscription_count()
        )

    def make_move(self, patience: float) -> None:
        """Remove faults, clear and activate until the boards allow air flow.

        Raises
        ------
        PamError
            If the boards do not allow it within `patience` seconds.
        """
        end = time.monotonic() + patience
        while time.monotonic() < end:
            # a node that was killed and started again may miss a call
            with contextlib.suppress(NoAnswerError):
                self._revive()
            if self.run(1.0, lambda: self.moves_air):
                self.run(0.8)
                if self.moves_air:
                    return
        raise PamError(f"the boards do not move again: {self.fault or 'no fault is named'}")

    def _revive(self) -> None:
        self.trigger("pam_rig/mend_faults")
        self.run(0.4)
        if not self.moves_air:
            self.trigger("pam_driver/clear_faults")
            self.run(0.1)
            request = ChangeState.Request()
            request.transition.id = Transition.TRANSITION_ACTIVATE
            self._call(self._lifecycle, request)

    def _call(self, client: Any, request: Any) -> Any:
        future = client.call_async(request)
        if not self.run(3.0, future.done):
            raise NoAnswerError(f"{client.srv_name} does not answer")
        return future.result()

    def _listen(self) -> None:
        now = time.monotonic()
        for frame in self._port.receive_all(now):
            try:
                board, message = self._codec.decode(frame.frame_id, frame.data)
            except FrameError:
                continue  # some faults cause invalid frames
            if isinstance(message, ValveCommand) and any(message.enable):
                self.last_enabled = now
            if isinstance(message, Status):
                self.states[board] = message.state
                if message.state is BoardState.ACTIVE:
                    self.last_air = now

    def _move(self) -> None:
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + _PERIOD
        turn = 2.0 * math.pi * FREQUENCY
        angle = turn * (now - self._started)
        count = len(self._joints)
        message = JointState(
            name=self._joints,
            position=[AMPLITUDE * math.sin(angle)] * count,
            velocity=[AMPLITUDE * turn * math.cos(angle)] * count,
        )
        message.header.stamp = self.get_clock().now().to_msg()
        self._commands.publish(message)
        for permission in self._permissions:
            permission.publish(Bool(data=True))

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            if status.name == "pam_driver: safety":
                if status.level == DiagnosticStatus.ERROR:
                    self.fault = plain(status.message, SENTENCE)
                elif "suspected" in status.message:
                    self.suspicion = plain(status.message, SENTENCE)


@contextlib.contextmanager
def open_operator(
    rig: Rig, port: CanPort, environment: Mapping[str, str]
) -> Iterator[FaultOperator]:
    """An operator of this rig in the ROS domain of this environment; ends with the context."""
    with set_environment(environment):
        start_ros([])
    operator = FaultOperator(rig, port)
    try:
        yield operator
    finally:
        operator.destroy_node()
        rclpy.try_shutdown()
