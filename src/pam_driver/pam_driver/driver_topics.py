"""The topics that the driver node publishes: measurements, and the commands sent to the boards."""

from __future__ import annotations

import math
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
    keeps_nan : bool
        Whether `joint_states` names a joint without a fresh measurement, with NaN. Otherwise it is
        left out, as MoveIt, robot_state_publisher and ros2_control expect it.
    """

    def __init__(self, node: Any, rig: Rig, keeps_nan: bool) -> None:
        self._rig = rig
        self._keeps_nan = keeps_nan
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
            rows = self._joint_rows(snapshot)
            message = JointState(
                name=[name for name, _, _ in rows],
                position=[position for _, position, _ in rows],
                velocity=[velocity for _, _, velocity in rows],
            )
            message.header.stamp = _stamp(snapshot.joint_stamp or wall_now)
            self._joint_states.publish(message)
        if snapshot.sent:
            position, effort = intake.in_units(snapshot.sent)
            message = JointState(name=self._rig.muscle_names, position=position, effort=effort)
            message.header.stamp = _stamp(sent_at)
            self._sent_commands.publish(message)

    def _joint_rows(self, snapshot: Snapshot) -> list[tuple[str, float, float]]:
        """Name, position and velocity of the joints in `joint_states`."""
        rows = zip(self._rig.joint_names, snapshot.positions, snapshot.velocities, strict=True)
        return [row for row in rows if self._keeps_nan or not math.isnan(row[1])]

    def unmeasured(self, snapshot: Snapshot) -> list[str]:
        """The joints that have no fresh measurement."""
        pairs = zip(self._rig.joint_names, snapshot.positions, strict=True)
        return [name for name, position in pairs if math.isnan(position)]

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
