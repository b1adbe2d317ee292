"""Sends the demo's motions to the controller and returns when each began."""

from __future__ import annotations

import re
import time
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from pam_demo.chain import set_environment
from pam_demo.motions import APPROACH, WAYPOINT_RATE, DemoMotion
from pam_demo.player import TAIL, NotPlayedError, VentedError
from pam_demo.recording import LOOP_COUNTS
from pam_model.errors import PamError
from pam_ros.foreign_text import SENTENCE, plain
from pam_ros.start import start_ros
from pam_ros.subscriptions import MOST_BYTES_OF_DIAGNOSTICS, subscribe

Progress = Callable[[float], None]
LOOPS = ("pam_driver: loop", "pam_controller: loop")
ANSWER_TIMEOUT = 10.0  # s, for the driver's services
RETRY_AFTER = 0.3  # s
TURN = 0.1  # s; a signal is seen between two turns


class LostAnswerError(PamError):
    """A service of the driver has not answered in time."""


class PlayerNode(Node):  # type: ignore[misc]
    """Publishes references for the joints of a rig; all but the first hold still."""

    def __init__(self, joints: tuple[str, ...]) -> None:
        super().__init__("player")
        self._joints = joints
        self._trajectory = self.create_publisher(
            JointTrajectory, "pam_controller/joint_trajectory", 1
        )
        self._stream = self.create_publisher(JointState, "pam_controller/commands", 1)
        self._stiffness = self.create_publisher(
            Float64MultiArray, "pam_controller/stiffness_commands", 1
        )

        self._fault = self._refused = ""
        self._refusals = 0
        self._counts: dict[str, list[tuple[float, float]]] = {}
        subscribe(
            self, DiagnosticArray, "/diagnostics", self._on_diagnostics, 10,
            most_bytes=MOST_BYTES_OF_DIAGNOSTICS,
        )  # fmt: skip

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            if status.name == "pam_driver: safety":
                faulty = status.level == DiagnosticStatus.ERROR
                self._fault = plain(status.message, SENTENCE) if faulty else ""
            elif status.name == "pam_controller: commands":
                values = {pair.key: pair.value for pair in status.values}
                told = values.get("rejected messages", "")
                if not re.fullmatch("[0-9]{1,9}", told):
                    continue  # of another node
                refusals = int(told)
                if refusals > self._refusals:
                    self._refused = plain(values.get("last rejection", ""), SENTENCE)
                self._refusals = refusals  # another controller counts from the start
            elif status.name in LOOPS:
                counted = {pair.key: pair.value for pair in status.values}
                cycles, late, skipped = (float(counted[key]) for key in LOOP_COUNTS)
                self._counts.setdefault(status.name, []).append((cycles, late + skipped))

    def start_counting(self) -> None:
        """Count late cycles of the loops of driver and controller from now on."""
        self._counts = {}

    def late_share(self) -> float:
        """Share of late and skipped cycles since then, of the loop that has more; 1 if unknown."""
        shares = []
        for name in LOOPS:
            counts = self._counts.get(name, [])
            if len(counts) < 2:  # its diagnostics come once a second
                return 1.0
            (cycles_before, late_before), (cycles, late) = counts[0], counts[-1]
            shares.append((late - late_before) / max(cycles - cycles_before, 1.0))
        return max(shares)

    def wait_for_controller(self, timeout: float, check: Callable[[], None]) -> None:
        """Wait until a controller is connected and follows a reference.

        Parameters
        ----------
        timeout : float
            [s].
        check : callable
            Called often; raises an error to end the wait.

        Raises
        ------
        PamError
            If `timeout` passes.
        """
        received: list[Any] = []
        subscription = subscribe(
            self, JointState, "pam_controller/reference", received.append, QoSProfile(depth=1)
        )
        deadline = time.monotonic() + timeout
        publishers = (self._trajectory, self._stream, self._stiffness)
        while not received or not all(
            publisher.get_subscription_count() for publisher in publishers
        ):
            check()
            self._allow_again(check)
            if time.monotonic() > deadline:
                raise PamError(
                    f"no controller has begun to follow a reference within {timeout:g} s"
                )
            rclpy.spin_once(self, timeout_sec=0.1)
        self.destroy_subscription(subscription)

    def vent(self, check: Callable[[], None]) -> None:
        """Make the driver vent, which is necessary before its commands may stop."""
        self._call(Trigger, "pam_driver/vent", Trigger.Request(), check)

    def clear_faults(self, check: Callable[[], None]) -> None:
        """Clear the driver's latched faults; it refuses this while it lowers the joints."""
        if self._call(Trigger, "pam_driver/clear_faults", Trigger.Request(), check).success:
            self._fault = ""

    def wait_for_driver(self, timeout: float, check: Callable[[], None]) -> None:
        """Wait until the driver has received data from every board and allows valve motion.

        A busy host may exceed the driver's time-outs already while the nodes start: a fault that is
        latched then is cleared.

        Raises
        ------
        PamError
            If `timeout` seconds pass.
        """
        deadline = time.monotonic() + timeout
        self._state(check, timeout)  # its process may take long to start
        while True:
            try:
                self._check_driver(check)
                return
            except VentedError as error:
                if time.monotonic() > deadline:
                    raise PamError(f"the driver has not become active: {error}") from None
            self._allow_again(check)
            time.sleep(0.1)

    def _allow_again(self, check: Callable[[], None]) -> None:
        """Clear a fault that is latched, and activate the driver if it lets itself be activated."""
        if self._fault:
            self.clear_faults(check)
            self._change_state(Transition.TRANSITION_ACTIVATE, check)

    def _change_state(self, transition: int, check: Callable[[], None]) -> bool:
        request = ChangeState.Request()
        request.transition.id = transition
        return bool(self._call(ChangeState, "pam_driver/change_state", request, check).success)

    def _state(self, check: Callable[[], None], timeout: float = ANSWER_TIMEOUT) -> Any:
        """The present state of the driver, with `id` and `label`, within a time [s].

        It is asked again: an answer is lost if the two processes do not know each other's half of
        the service yet.
        """
        name, deadline = "pam_driver/get_state", time.monotonic() + timeout
        while True:
            left = deadline - time.monotonic()
            patience = min(max(left, 0.0), ANSWER_TIMEOUT)
            try:
                return self._call(GetState, name, GetState.Request(), check, patience).current_state
            except LostAnswerError:
                if left <= ANSWER_TIMEOUT:
                    raise PamError(f"{name}: no answer within {timeout:g} s") from None

    def _check_driver(self, check: Callable[[], None]) -> None:
        state = self._state(check)
        if state.id != State.PRIMARY_STATE_ACTIVE:
            raise VentedError(self._fault or f"the driver is {state.label}")

    def activate(self, check: Callable[[], None]) -> None:
        """Activate the driver, so that valves may move again.

        A fault that is latched is cleared. The driver refuses both while it lowers the joints.
        """
        deadline = time.monotonic() + ANSWER_TIMEOUT
        while (
            self._state(check).id != State.PRIMARY_STATE_ACTIVE  # it is if an answer was lost
            and not self._change_state(Transition.TRANSITION_ACTIVATE, check)
        ):
            if time.monotonic() > deadline:
                raise PamError("the driver cannot be activated; see its log for the reason")
            time.sleep(RETRY_AFTER)
            self.clear_faults(check)

    def _call(
        self,
        kind: Any,
        name: str,
        request: Any,
        check: Callable[[], None],
        timeout: float = ANSWER_TIMEOUT,
    ) -> Any:
        client = self.create_client(kind, name)
        deadline = time.monotonic() + timeout
        while not client.service_is_ready() and time.monotonic() < deadline:
            check()
            rclpy.spin_once(self, timeout_sec=0.05)
        future = client.call_async(request)
        while not future.done() and time.monotonic() < deadline:
            rclpy.spin_once(self, timeout_sec=TURN)
        self.destroy_client(client)
        if not future.done():
            raise LostAnswerError(f"{name}: no answer within {timeout:g} s")
        return future.result()

    def play(self, motion: DemoMotion, check: Callable[[], None], progress: Progress) -> float:
        """Play a motion to its end.

        Parameters
        ----------
        motion : DemoMotion
            Motion of the first joint.
        check : callable
            Called often; raises an error to stop.
        progress : callable
            Called with the elapsed time [s].

        Returns
        -------
        float
            Time of its first waypoint [s since the epoch].

        Raises
        ------
        VentedError
            If the driver vents during the motion.
        NotPlayedError
            If the controller refuses a command; a busy host lets its measurements become old.
        """
        self._check_driver(check)
        self._refused = ""
        begin = time.time() + 0.05
        start = begin + APPROACH
        self._send_trajectory(motion, begin)
        stiffness_at = [entry[0] for entry in motion.stiffness]
        sent = -1
        length = APPROACH + motion.duration + TAIL
        tick = begin
        while (gone := time.time() - begin) < length:
            check()
            level = max(bisect_right(stiffness_at, gone - APPROACH) - 1, 0)
            if level != sent:
                self._send_stiffness(motion.stiffness[level][1])
                sent = level
            if motion.streamed and gone >= APPROACH:
                self._send_position(motion, gone - APPROACH)
            progress(max(gone, 0.0))
            rclpy.spin_once(self, timeout_sec=0.0)
            if self._fault:
                raise VentedError(self._fault)
            if self._refused:
                raise NotPlayedError(self._refused)
            tick += 1.0 / WAYPOINT_RATE
            time.sleep(max(tick - time.time(), 0.0))
        self._check_driver(check)
        return start

    def _send_trajectory(self, motion: DemoMotion, begin: float) -> None:
        message = JointTrajectory(joint_names=list(self._joints[:1]))
        seconds, fraction = divmod(begin, 1.0)
        message.header.stamp.sec = int(seconds)
        message.header.stamp.nanosec = int(fraction * 1e9)
        count = 1 if motion.streamed else len(motion.times)
        for index in range(count):
            point = JointTrajectoryPoint(
                positions=[float(motion.positions[index])],
                velocities=[float(motion.velocities[index])],
                accelerations=[float(motion.accelerations[index])],
            )
            # The motion begins and ends at rest; rounding must not add a velocity there.
            if index in (0, count - 1):
                point.velocities = [0.0]
                point.accelerations = [0.0]
            due = APPROACH + float(motion.times[index])
            point.time_from_start.sec = int(due)
            point.time_from_start.nanosec = int(due % 1.0 * 1e9)
            message.points.append(point)
        self._trajectory.publish(message)

    def _send_stiffness(self, value: float) -> None:
        message = Float64MultiArray(data=[value] * len(self._joints))
        size = len(self._joints)
        message.layout.dim = [MultiArrayDimension(label="joint", size=size, stride=size)]
        self._stiffness.publish(message)

    def _send_position(self, motion: DemoMotion, at: float) -> None:
        index = min(int(at * WAYPOINT_RATE), len(motion.positions) - 1)
        message = JointState(name=list(self._joints[:1]), position=[float(motion.positions[index])])
        message.header.stamp = self.get_clock().now().to_msg()
        self._stream.publish(message)


@contextmanager
def open_player(joints: tuple[str, ...], environment: Mapping[str, str]) -> Iterator[PlayerNode]:
    """A player of these joints in the ROS domain of this environment; it ends with the context."""
    with set_environment(environment):
        # its handlers close the context in the middle of a call; KeyboardInterrupt ends the demo
        start_ros([])
    player = PlayerNode(joints)
    try:
        yield player
    finally:
        player.destroy_node()
        rclpy.try_shutdown()
