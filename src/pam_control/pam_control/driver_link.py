"""The controller's link to the driver: over topics here, or direct, in a process of both.

The controller node knows a `DriverLink` and nothing of the way behind it. A program that runs
driver and controller in one cycle gives the node a link of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from std_srvs.srv import Trigger

from pam_control.control_step import Measurement
from pam_control.controller_inputs import ControllerInputs, NodeSide
from pam_ros.joint_state_publisher import JointStatePublisher
from pam_ros.message_sources import source_of
from pam_ros.polled_topic import PolledTopic
from pam_ros.valve_command import ValveCommandFormat


class DriverLink(Protocol):
    """Measurements in, valve commands out, once in every cycle of the controller."""

    @property
    def polled_topics(self) -> Sequence[PolledTopic]:
        """Subscriptions that end with the node."""

    @property
    def arrival(self) -> float:
        """When the last pressures arrived, wall clock [s]."""

    def receive(self) -> Measurement:
        """The latest measurement, on the controller's time axis."""

    def two_publishers(self) -> str:
        """Which measurements come from two nodes; empty if none."""

    def send(self, stamp: int, commands: Sequence[float]) -> None:
        """Send one command for each muscle of the rig; the stamp is the present time [ns]."""

    def vent(self) -> None:
        """Ask the driver to vent; never waits for it."""


MakeLink = Callable[[NodeSide], DriverLink]


class TopicLink:
    """The link to a driver in another process.

    Parameters
    ----------
    side : NodeSide
        Of the controller.
    """

    def __init__(self, side: NodeSide) -> None:
        node, rig = side.node, side.rig
        self._inputs = ControllerInputs(side)
        self.polled_topics = self._inputs.topics
        self._muscles = rig.muscle_names
        self._format = ValveCommandFormat(rig.valve_kinds)
        # the driver recognises two publishers by it, also two controllers of one name
        self._commands = JointStatePublisher(node, "valve_commands", 1, source_of(node))
        self._vent = node.create_client(Trigger, "pam_driver/vent")

    @property
    def arrival(self) -> float:
        """When the last pressures arrived, wall clock [s]."""
        return self._inputs.arrival

    def receive(self) -> Measurement:
        """Take the messages that have arrived; returns the latest measurement."""
        inputs = self._inputs
        inputs.poll()
        return Measurement(
            inputs.positions, inputs.pressures, inputs.position_time, inputs.pressure_time
        )

    def two_publishers(self) -> str:
        """Which measurements come from two nodes; empty if none."""
        return self._inputs.two_publishers()

    def send(self, stamp: int, commands: Sequence[float]) -> None:
        """Publish one command for each muscle of the rig; the stamp is the present time [ns]."""
        position, effort = self._format.pack(commands)
        self._commands.publish(stamp, self._muscles, position, effort=effort)

    def vent(self) -> None:
        """Call the driver's service; if it does not answer, the time-out of the commands vents."""
        if self._vent.service_is_ready():
            self._vent.call_async(Trigger.Request())
