"""The topics that the driver reads: valve commands, and the permissions of people.

They are polled at the start of every cycle, so that a message is in time for the cycle in which it
arrives, and so that two publishers in one cycle are both read.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from pam_driver.driver import Driver
from pam_driver.driver_parameters import PEOPLE_TOPICS
from pam_driver.safety.valve_command_intake import CommandRefusedError, NamedCommand
from pam_model.rig import People
from pam_ros.joint_state_bytes import JointStateFields, JointStateReader
from pam_ros.polled_topic import PolledTopic


class DriverInputs:
    """Reads the topics of a driver, and hands what arrives to it.

    Parameters
    ----------
    node : Node
        The driver's node.
    driver : callable
        The driver, or None while no bus is open.
    own_source : callable
        Names who computes commands in this process, whose messages are for observers; or None.

    Attributes
    ----------
    commands : PolledTopic
        `valve_commands`.
    permissions : dict of str to PolledTopic
        The topics of people, by input.
    """

    def __init__(
        self,
        node: Any,
        people: People,
        driver: Callable[[], Driver | None],
        own_source: Callable[[], str | None],
    ) -> None:
        self._node, self._driver, self._own_source = node, driver, own_source
        self.commands = PolledTopic(
            node,
            JointState,
            "valve_commands",
            self._on_valve_commands,
            read=JointStateReader().read,
        )
        self.permissions: dict[str, PolledTopic] = {}
        for name, topic in PEOPLE_TOPICS.items():
            if getattr(people, f"{name}_topic"):
                # not latched: the last word of a publisher that has ended must not count as new;
                # polled, so that they are also read while the end of the node lowers the joints
                hear = partial(self.on_people, name)
                # what cannot be read, or is lost since too many arrived, does not permit anything
                forbid = partial(self.on_people, name, Bool(data=False))
                self.permissions[name] = PolledTopic(
                    node, Bool, topic, hear, malformed=forbid, overflow=forbid
                )

    @property
    def topics(self) -> list[PolledTopic]:
        """All of them."""
        return [self.commands, *self.permissions.values()]

    def poll(self) -> None:
        """Take what has arrived."""
        self.commands.poll()
        self.poll_people()

    def poll_people(self) -> None:
        """Take what people permit or forbid, and nothing else."""
        for topic in self.permissions.values():
            topic.poll()

    def take(self, command: NamedCommand, arrived: float) -> None:
        """Use valve commands that arrived at this moment [s], or say why they are refused."""
        driver, reason = self._driver(), "not configured"
        if driver is not None:
            try:
                driver.set_commands(command, arrived)
                return
            except CommandRefusedError as error:
                reason = str(error)
        self._node.get_logger().warning(
            f"valve_commands refused: {reason}", throttle_duration_sec=1.0
        )

    def on_people(self, name: str, message: Any) -> None:
        """Hand over what a message on a topic of people says."""
        driver = self._driver()
        if driver is not None:
            arrived = time.monotonic() - self.permissions[name].waited
            driver.people.hear_topic(name, bool(message.data), arrived)

    def _on_valve_commands(self, message: JointStateFields) -> None:
        if message.frame_id == self._own_source():
            return  # for observers: the driver has had these commands
        waited = self.commands.waited
        # its age when it arrived; a stamp of zero means "now", as in other ROS interfaces
        age = time.time() - waited - message.stamp if message.stamp else 0.0
        command = NamedCommand(
            message.name,
            message.position,
            message.velocity,
            message.effort,
            age,
            message.frame_id,
        )
        self.take(command, time.monotonic() - waited)
