"""The telemetry that the controller node publishes at the end of its cycle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from pam_control.control_step import JointTelemetry
from pam_control.controller import Controller
from pam_model.rig import Rig
from pam_ros.joint_state_publisher import JointStatePublisher


class ControllerTopics:
    """The publishers of one node.

    Parameters
    ----------
    node : rclpy.node.Node
        Makes the publishers.
    rig : Rig
        Gives the names and their order in every message.
    telemetry_every : int
        Reference, error and disturbance are published once in so many cycles.
    """

    def __init__(self, node: Any, rig: Rig, telemetry_every: int) -> None:
        self._joints = rig.joint_names
        self._telemetry_every = telemetry_every
        self._cycles = 0
        self._reference = JointStatePublisher(node, "~/reference", 1)
        self._error = JointStatePublisher(node, "~/error", 1)
        self._disturbance = JointStatePublisher(node, "~/disturbance", 1)

    def publish(self, stamp: int, controller: Controller) -> None:
        """Publish what one cycle followed, if it is its turn.

        Parameters
        ----------
        stamp : int
            When the commands of the cycle were computed, since 1970 [ns].
        controller : Controller
            Has the telemetry of the cycle.
        """
        self._cycles += 1
        if self._cycles % self._telemetry_every == 0:
            outputs = (self._reference, self._error, self._disturbance)
            if any(output.heard() for output in outputs):
                self._publish_telemetry(stamp, controller.telemetry)

    def _publish_telemetry(self, stamp: int, telemetry: Sequence[JointTelemetry]) -> None:
        self._reference.publish(
            stamp,
            self._joints,
            [each.reference.position for each in telemetry],
            [each.reference.velocity for each in telemetry],
            [each.torque for each in telemetry],
        )
        self._error.publish(stamp, self._joints, [each.error for each in telemetry])
        observed = {
            name: each.disturbance
            for name, each in zip(self._joints, telemetry, strict=True)
            if math.isfinite(each.disturbance)
        }
        if observed:
            self._disturbance.publish(stamp, tuple(observed), effort=list(observed.values()))
