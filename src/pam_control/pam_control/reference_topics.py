"""The topics by which users move the joints: trajectories, streams, stiffness and torque.

What takes longer than a cycle has threads of its own (`pam_ros.slow_work`): the plan of a
trajectory, and the limits of motion for a stiffness that is new.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from builtin_interfaces.msg import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from pam_control.command_intake import CommandIntake
from pam_control.controller import Controller
from pam_control.references.trajectory import CommandError
from pam_control.trajectory_message import TrajectoryMessage, is_stop
from pam_ros.errors import MalformedMessageError
from pam_ros.slow_work import SlowWork
from pam_ros.subscriptions import GuardedTopic, subscribe

LARGEST_TRAJECTORY: Final = 2**26  # bytes; the number of points is limited by a parameter


class ReferenceTopics:
    """The subscriptions of one node.

    Parameters
    ----------
    node : rclpy.node.Node
        Makes the subscriptions.
    controller : Controller
        Follows what arrives.
    intake : CommandIntake
        Hands it over.
    planning, foreseeing : SlowWork
        For the plans of trajectories, and for the limits at stiffnesses.
    most_points : callable
        Gives the largest number of points of a trajectory.
    seconds : callable
        A stamp on the controller's time axis [s]; None for "now".

    Attributes
    ----------
    trajectories : GuardedTopic
        Counts trajectories that cannot be read.
    """

    def __init__(
        self,
        node: Any,
        controller: Controller,
        intake: CommandIntake,
        planning: SlowWork,
        foreseeing: SlowWork,
        *,
        most_points: Callable[[], int],
        seconds: Callable[[Any], float | None],
    ) -> None:
        self._controller, self._intake = controller, intake
        self._planning, self._foreseeing = planning, foreseeing
        self._most_points, self._seconds = most_points, seconds
        # bytes, which its own reader reads: see pam_control.trajectory_message
        subscription = subscribe(
            node, JointTrajectory, "~/joint_trajectory", self.on_trajectory, 10,
            read=bytes, most_bytes=LARGEST_TRAJECTORY,
        )  # fmt: skip
        # taken here, since the main loop puts its own guard around the callbacks
        self.trajectories: GuardedTopic = subscription.callback
        subscribe(node, JointState, "~/commands", self.on_stream, 1)
        subscribe(node, Float64MultiArray, "~/stiffness_commands", self.on_stiffness, 1)
        subscribe(node, Float64MultiArray, "~/torque_commands", self.on_torque, 1)

    def on_trajectory(self, data: bytes) -> None:
        """Take a stop at once; the plan of a motion takes seconds if it has many points."""
        most = self._most_points()
        if is_stop(data):
            self._intake.trajectory(data, most, self._start_of)
            return
        with self._intake.rejecting("joint_trajectory"):
            if self._planning.full:
                raise CommandError("trajectory rejected: too many others are being planned")
            ticket = self._intake.ticket
            self._planning.submit(lambda: self._followed(data, most, ticket), self._on_read)

    def _followed(self, data: bytes, most: int, ticket: int) -> str:
        """Follow a trajectory; return why it cannot be read, if so."""
        try:
            self._intake.trajectory(data, most, self._start_of, ticket)
        except MalformedMessageError as error:
            return str(error)
        return ""

    def _on_read(self, malformed: str) -> None:
        if malformed:
            self.trajectories.refuse(malformed)

    def _start_of(self, message: TrajectoryMessage) -> float | None:
        return self._seconds(Time(sec=message.seconds, nanosec=message.nanoseconds))

    def on_stream(self, message: Any) -> None:
        """Take a streamed reference."""
        self._intake.stream(list(message.name), list(message.position), list(message.velocity))

    def on_stiffness(self, message: Any) -> None:
        """Take it at once, unless limits of motion for this stiffness have to be computed."""
        values = list(message.data)
        if not self._foreseeing.busy and self._controller.limits.foresees(values):
            self._intake.stiffness(values)
            return
        with self._intake.rejecting("stiffness_commands"):
            if self._foreseeing.full:
                raise CommandError("stiffness command rejected: too many others wait")
            self._foreseeing.submit(
                lambda: self._controller.limits.foresee(values),
                lambda _: self._intake.stiffness(values),
            )

    def on_torque(self, message: Any) -> None:
        """Take torques."""
        self._intake.torque(list(message.data))
