"""The topics that the controller node publishes in its cycle: valve commands and telemetry."""

from __future__ import annotations

import math
import secrets
from collections.abc import Sequence
from typing import Any

from sensor_msgs.msg import JointState

from pam_control.joint_channel import JointChannel
from pam_model.rig import Rig
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
        self._rig = rig
        self._format = ValveCommandFormat(rig.valve_kinds)
        self._telemetry_every = telemetry_every
        self._cycles = 0
        # the driver recognises two publishers by it, also two controllers of one name
        self._source = f"{node.get_fully_qualified_name()}#{secrets.token_hex(3)}"
        self._commands = node.create_publisher(JointState, "valve_commands", 1)
        self._reference = node.create_publisher(JointState, "~/reference", 1)
        self._error = node.create_publisher(JointState, "~/error", 1)
        self._disturbance = node.create_publisher(JointState, "~/disturbance", 1)

    def publish(
        self, stamp: Any, commands: Sequence[float], channels: Sequence[JointChannel]
    ) -> None:
        """Publish the result of one cycle.

        Parameters
        ----------
        stamp : builtin_interfaces.msg.Time
            The present time.
        commands : sequence of float
            One for each muscle of the rig.
        channels : sequence of JointChannel
            The joints with their telemetry.
        """
        message = JointState(name=list(self._rig.muscle_names))
        message.header.stamp = stamp
        message.header.frame_id = self._source
        message.position, message.effort = self._format.pack(commands)
        self._commands.publish(message)
        self._cycles += 1
        if self._cycles % self._telemetry_every == 0:
            self._publish_telemetry(stamp, channels)

    def _publish_telemetry(self, stamp: Any, channels: Sequence[JointChannel]) -> None:
        telemetry = [channel.telemetry for channel in channels]
        reference = JointState(name=list(self._rig.joint_names))
        reference.header.stamp = stamp
        reference.position = [each.reference.position for each in telemetry]
        reference.velocity = [each.reference.velocity for each in telemetry]
        reference.effort = [each.torque for each in telemetry]
        self._reference.publish(reference)
        errors = JointState(name=list(self._rig.joint_names))
        errors.header.stamp = stamp
        errors.position = [each.error for each in telemetry]
        self._error.publish(errors)
        observed = {
            name: each.disturbance
            for name, each in zip(self._rig.joint_names, telemetry, strict=True)
            if math.isfinite(each.disturbance)
        }
        if observed:
            disturbance = JointState(name=list(observed), effort=list(observed.values()))
            disturbance.header.stamp = stamp
            self._disturbance.publish(disturbance)
