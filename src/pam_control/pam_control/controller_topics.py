"""The topics that the controller node publishes in its cycle: valve commands and telemetry."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from pam_control.control_step import JointTelemetry
from pam_model.rig import Rig
from pam_ros.joint_state_publisher import JointStatePublisher
from pam_ros.message_sources import source_of
from pam_ros.valve_command import ValveCommandFormat


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
        self._joints, self._muscles = rig.joint_names, rig.muscle_names
        self._format = ValveCommandFormat(rig.valve_kinds)
        self._telemetry_every = telemetry_every
        self._cycles = 0
        # the driver recognises two publishers by it, also two controllers of one name
        self._commands = JointStatePublisher(node, "valve_commands", 1, source_of(node))
        self._reference = JointStatePublisher(node, "~/reference", 1)
        self._error = JointStatePublisher(node, "~/error", 1)
        self._disturbance = JointStatePublisher(node, "~/disturbance", 1)

    def publish(
        self, stamp: int, commands: Sequence[float], telemetry: Sequence[JointTelemetry]
    ) -> None:
        """Publish the result of one cycle.

        Parameters
        ----------
        stamp : int
            The present time, since 1970 [ns].
        commands : sequence of float
            One for each muscle of the rig.
        telemetry : sequence of JointTelemetry
            Of the joints.
        """
        position, effort = self._format.pack(commands)
        self._commands.publish(stamp, self._muscles, position, effort=effort)
        self._cycles += 1
        if self._cycles % self._telemetry_every == 0:
            self._publish_telemetry(stamp, telemetry)

    def _publish_telemetry(self, stamp: int, telemetry: Sequence[JointTelemetry]) -> None:
        if self._reference.heard():
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
