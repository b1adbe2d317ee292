"""The topics that the driver node publishes: measurements, and the commands sent to the boards."""

from __future__ import annotations

import time
from typing import Any

from builtin_interfaces.msg import Time
from sensor_msgs.msg import FluidPressure, JointState

from pam_driver.safety.command_intake import CommandIntake
from pam_driver.snapshot import Snapshot
from pam_model.rig import Rig


class DriverTopics:
    """The publishers of one node.

    Parameters
    ----------
    node : rclpy.node.Node
        Makes the publishers.
    rig : Rig
        Gives the names and their order in every message.
    """

    def __init__(self, node: Any, rig: Rig) -> None:
        self._rig = rig
        self._pressure_states = node.create_publisher(JointState, "pressure_states", 10)
        self._joint_states = node.create_publisher(JointState, "joint_states", 10)
        self._sent_commands = node.create_publisher(JointState, "sent_valve_commands", 10)
        self._fluid_pressures = [
            node.create_publisher(FluidPressure, f"{name}/pressure", 10)
            for name in rig.muscle_names
        ]

    def publish(
        self, snapshot: Snapshot, intake: CommandIntake, wall_now: float, sent_at: float
    ) -> None:
        """Publish what one cycle measured and sent.

        Parameters
        ----------
        snapshot : Snapshot
            Result of the cycle.
        intake : CommandIntake
            Converts commands to their units.
        wall_now, sent_at : float
            When the cycle began, and when its commands had been sent; wall clock [s].
        """
        message = JointState(name=self._rig.muscle_names, effort=snapshot.pressures)
        message.header.stamp = _stamp(snapshot.pressure_stamp or wall_now)
        self._pressure_states.publish(message)
        if snapshot.positions:
            message = JointState(
                name=self._rig.joint_names,
                position=snapshot.positions,
                velocity=snapshot.velocities,
            )
            message.header.stamp = _stamp(snapshot.joint_stamp or wall_now)
            self._joint_states.publish(message)
        if snapshot.sent:
            position, effort = intake.in_units(snapshot.sent)
            message = JointState(name=self._rig.muscle_names, position=position, effort=effort)
            message.header.stamp = _stamp(sent_at)
            self._sent_commands.publish(message)

    def publish_fluid_pressures(self, snapshot: Snapshot) -> None:
        """Publish the absolute pressures, for tools that expect this message type."""
        stamp = _stamp(snapshot.pressure_stamp or time.time())
        ambient = self._rig.gas.ambient_pressure
        for muscle, publisher, pressure in zip(
            self._rig.muscle_names, self._fluid_pressures, snapshot.pressures, strict=True
        ):
            message = FluidPressure(fluid_pressure=pressure + ambient)
            message.header.stamp = stamp
            message.header.frame_id = muscle
            publisher.publish(message)


def _stamp(seconds: float) -> Any:
    whole = int(seconds)
    return Time(sec=whole, nanosec=int((seconds - whole) * 1e9))
