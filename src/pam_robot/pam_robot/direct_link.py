"""The link between a controller and the driver of its own process: no message lies between them.

The driver checks these commands like those of `valve_commands`. Observers still find them on the
topic, at the end of the cycle and only while somebody listens.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Final

from pam_control.control_step import Measurement
from pam_control.controller_inputs import NodeSide
from pam_driver.safety.valve_command_intake import NamedCommand
from pam_driver.snapshot import Snapshot
from pam_ros.driver_state import COMMANDABLE
from pam_ros.joint_state_publisher import JointStatePublisher
from pam_ros.message_sources import source_of
from pam_ros.valve_command import ValveCommandFormat, ValveFields

COMMAND_DELAY: Final = 0.001
"""From the controller to the valve by this link [s]: the rest of the cycle, a frame, and half a
turn of the board."""
TakeCommands = Callable[[NamedCommand, float], object]
_OF_THE_DRIVER: Final = 1  # its own subscription to valve_commands, which hears other controllers


class DirectLink:
    """A `pam_control.driver_link.DriverLink` whose other end is the driver's cycle.

    Parameters
    ----------
    take_commands, vent : callable
        Those of the driver's node: takes commands and the monotonic time [s]; vents.
    side : NodeSide
        Of the controller. What the driver hands over needs neither names nor a queue, so that
        nothing is rejected or lost.

    Attributes
    ----------
    source : str
        Names the controller in its messages on `valve_commands`.
    polled_topics : tuple
        Empty: the link has no subscriptions.
    arrival : float
        0: the controller has no phase of its own.
    hear_state : callable
        Takes each message of the driver about its state.
    """

    def __init__(
        self, take_commands: TakeCommands, vent: Callable[[], object], side: NodeSide
    ) -> None:
        self.polled_topics = ()
        self.arrival = 0.0
        self.source = source_of(side.node)
        self.hear_state = side.take_driver_state
        self._take, self._vent = take_commands, vent
        self._origin = time.monotonic() - side.clock()
        self._muscles = side.rig.muscle_names
        self._format = ValveCommandFormat(side.rig.valve_kinds)
        self._topic = JointStatePublisher(
            side.node, "valve_commands", 1, self.source, besides=_OF_THE_DRIVER
        )
        self._measurement = Measurement((), (), -math.inf, -math.inf)
        self._taken = False
        self._told: tuple[int, ValveFields] | None = None

    def measure(self, snapshot: Snapshot) -> None:
        """Take what the driver has measured in this cycle."""
        now = time.monotonic()
        self._measurement = Measurement(
            snapshot.positions,
            snapshot.pressures,
            min(snapshot.joint_time, now) - self._origin,
            min(snapshot.pressure_time, now) - self._origin,
        )
        self._taken = snapshot.state.value in COMMANDABLE

    def receive(self) -> Measurement:
        """The latest measurement."""
        return self._measurement

    def two_publishers(self) -> str:
        """Empty: the measurements are those of one driver."""
        return ""

    def send(self, stamp: int, commands: Sequence[float]) -> None:
        """Hand over one command for each muscle; dropped where the driver has just stopped."""
        fields = self._format.pack(commands)
        if self._taken:
            self._take(
                NamedCommand(self._muscles, fields.position, (), fields.effort, source=self.source),
                time.monotonic(),
            )
        self._told = stamp, fields

    def publish(self) -> None:
        """Publish the commands of this cycle for observers, if there are any of either."""
        if self._told is not None:
            (stamp, fields), self._told = self._told, None
            self._topic.publish(stamp, self._muscles, fields.position, effort=fields.effort)

    def vent(self) -> None:
        """Vent."""
        self._vent()
