"""The topics that the driver node publishes: measurements, and the commands sent to the boards."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import Any

from builtin_interfaces.msg import Time
from sensor_msgs.msg import FluidPressure

from pam_driver.safety.valve_command_intake import ValveCommandIntake
from pam_driver.snapshot import Snapshot
from pam_model.rig import Rig
from pam_ros.joint_state_publisher import JointStatePublisher, nanoseconds_of
from pam_ros.message_sources import source_of


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
    every : int, optional
        Measurements and commands are published once in so many cycles.
    """

    def __init__(self, node: Any, rig: Rig, keeps_nan: bool, every: int = 1) -> None:
        self._rig = rig
        self._every = every
        self._cycles = 0
        self._keeps_nan = keeps_nan
        self._joints, self._muscles = rig.joint_names, rig.muscle_names
        source = source_of(node)  # the controller recognises two publishers by it
        self._pressure_states = JointStatePublisher(node, "pressure_states", 10, source)
        self._joint_states = JointStatePublisher(node, "joint_states", 10, source)
        self._sent_commands = JointStatePublisher(node, "sent_valve_commands", 10)
        self._fluid_pressures = [
            node.create_publisher(FluidPressure, f"{name}/pressure", 10)
            for name in rig.muscle_names
        ]

    def publish(
        self, snapshot: Snapshot, intake: ValveCommandIntake, wall_now: float, sent_at: float
    ) -> None:
        """Publish what one cycle measured and sent, if it is its turn.

        Parameters
        ----------
        snapshot : Snapshot
            Result of the cycle.
        intake : ValveCommandIntake
            Converts commands to their units.
        wall_now, sent_at : float
            When the cycle began, and when its commands had been sent; wall clock [s].
        """
        self._cycles += 1
        if self._cycles % self._every:
            return
        if self._pressure_states.heard():
            stamp = nanoseconds_of(snapshot.pressure_stamp or wall_now)
            self._pressure_states.publish(stamp, self._muscles, effort=snapshot.pressures)
        if snapshot.positions and self._joint_states.heard():
            stamp = nanoseconds_of(snapshot.joint_stamp or wall_now)
            self._joint_states.publish(stamp, *self._measured_joints(snapshot))
        if snapshot.sent and self._sent_commands.heard():
            position, effort = intake.in_units(snapshot.sent)
            stamp = nanoseconds_of(sent_at)
            self._sent_commands.publish(stamp, self._muscles, position, effort=effort)

    def _measured_joints(
        self, snapshot: Snapshot
    ) -> tuple[tuple[str, ...], Sequence[float], Sequence[float]]:
        """Names, positions and velocities of the joints in `joint_states`."""
        positions, velocities = snapshot.positions, snapshot.velocities
        if self._keeps_nan or not any(map(math.isnan, positions)):
            return self._joints, positions, velocities
        kept = [place for place, position in enumerate(positions) if not math.isnan(position)]
        return (
            tuple(self._joints[place] for place in kept),
            [positions[place] for place in kept],
            [velocities[place] for place in kept],
        )

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
