"""What the controller receives in every cycle: measurements, and the driver's state.

The control loop takes these messages itself, so that neither a long trajectory nor the design of
new gains delays them, and no other thread has to run for them.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import JointState

from pam_control.rig_order import in_order
from pam_model.rig import Rig
from pam_ros.joint_state_bytes import JointStateFields, JointStateReader
from pam_ros.message_sources import MessageSources
from pam_ros.polled_topic import PolledTopic


class NodeSide(NamedTuple):
    """What a link to the driver needs of the controller's node."""

    node: Any  # makes subscriptions, publishers and clients
    rig: Rig  # gives the names and their order in every message
    clock: Callable[[], float]  # present time on the controller's time axis [s]
    # gives a block for a topic, in which a PamError means that its message is rejected
    rejecting: Callable[[str], AbstractContextManager[None]]
    take_driver_state: Callable[[Any], object]  # called with each message about the driver's state
    # called when so many of them arrived at once that some were lost
    lose_driver_state: Callable[[], object]


class ControllerInputs:
    """The subscriptions that the control loop polls.

    Attributes
    ----------
    positions, pressures : list of float
        The latest measurements in the rig's order [rad], [Pa gauge], NaN if not measured; empty
        before the first message.
    position_time, pressure_time : float
        When they were measured [s].
    topics : list of PolledTopic
        The subscriptions.
    """

    def __init__(self, side: NodeSide) -> None:
        self.positions: list[float] = []
        self.pressures: list[float] = []
        self.position_time = self.pressure_time = -math.inf
        self._joints, self._muscles = side.rig.joint_names, side.rig.muscle_names
        self._clock, self._rejecting = side.clock, side.rejecting
        self._sources = {"joint_states": MessageSources(), "pressure_states": MessageSources()}
        on_joints, on_pressures = self._on_joint_states, self._on_pressure_states
        self._pressure_topic = _measurements(side.node, "pressure_states", on_pressures)
        self._position_topic = _measurements(side.node, "joint_states", on_joints)
        self.topics = [
            self._position_topic,
            self._pressure_topic,
            PolledTopic(
                side.node,
                DiagnosticStatus,
                "pam_driver/state",
                side.take_driver_state,
                latched=True,
                overflow=side.lose_driver_state,
            ),
        ]

    def poll(self) -> None:
        """Take what has arrived; called in every cycle."""
        for topic in self.topics:
            topic.poll()

    def two_publishers(self) -> str:
        """Which measurements come from two nodes, which a controller must not follow; "" if none.

        Messages about other joints, such as those of a gripper, do not count.
        """
        now = self._clock()
        for topic, sources in self._sources.items():
            who = sources.taking_turns(now)
            if who:
                return f"two nodes publish {topic} of this rig, {who}: stop one of them"
        return ""

    @property
    def arrival(self) -> float:
        """When the last pressures arrived, wall clock [s]."""
        return self._pressure_topic.arrived

    def _on_joint_states(self, message: JointStateFields) -> None:
        with self._rejecting("joint_states"):
            values = in_order(message.name, message.position, self._joints, "position")
            if values is not None:
                self._sources["joint_states"].hear(message.frame_id, self._clock())
                self.positions, self.position_time = (
                    values,
                    self._stamp(message, self._position_topic),
                )

    def _on_pressure_states(self, message: JointStateFields) -> None:
        with self._rejecting("pressure_states"):
            values = in_order(message.name, message.effort, self._muscles, "effort")
            if values is not None:
                self._sources["pressure_states"].hear(message.frame_id, self._clock())
                self.pressures, self.pressure_time = (
                    values,
                    self._stamp(message, self._pressure_topic),
                )

    def _stamp(self, message: JointStateFields, topic: PolledTopic) -> float:
        """Time of a measurement: its stamp, but not later than its arrival.

        The wall clock is only used for the age of the stamp when the message is taken.
        """
        now = self._clock()
        arrived = now - topic.waited
        return min(arrived, now - (time.time() - message.stamp)) if message.stamp else arrived


def _measurements(node: Any, topic: str, take: Callable[[JointStateFields], object]) -> PolledTopic:
    return PolledTopic(
        node, JointState, topic, take, read=JointStateReader().read, best_effort=True
    )
