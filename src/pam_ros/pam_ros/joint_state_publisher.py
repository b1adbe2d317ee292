"""Publishes sensor_msgs/JointState at a high rate with little processor time.

The messages are written as bytes, see `pam_ros.joint_state_bytes`, and only while the topic has
subscribers.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, Final

from sensor_msgs.msg import JointState

from pam_ros.joint_state_bytes import JointStateWriter

LOOK_PERIOD: Final = 0.05
"""Period at which a publisher looks for subscribers [s]."""


def nanoseconds_of(seconds: float) -> int:
    """A time [s] as a stamp [ns]."""
    whole = int(seconds)
    return whole * 1_000_000_000 + int((seconds - whole) * 1e9)


class Audience:
    """Whether a publisher has subscribers, looked up at a low rate.

    Parameters
    ----------
    besides : int, optional
        Number of subscriptions that do not count.
    """

    def __init__(self, publisher: Any, besides: int = 0) -> None:
        self._publisher = publisher
        self._besides = besides
        self._present = False
        self._look_at = 0.0

    def present(self) -> bool:
        """Whether a subscription exists, or existed when this was last looked up."""
        now = time.monotonic()
        if now >= self._look_at:
            self._look_at = now + LOOK_PERIOD
            self._present = self._publisher.get_subscription_count() > self._besides
        return self._present


class JointStatePublisher:
    """One publisher.

    Parameters
    ----------
    node : rclpy.node.Node
        Makes the publisher; for a lifecycle node it is silent until the node is active.
    topic : str
        Name of the topic.
    depth : int
        Messages that are kept for a slow subscriber.
    frame_id : str, optional
        Of every message.
    besides : int, optional
        Number of subscriptions for which nothing is published.

    Attributes
    ----------
    heard : callable
        Whether the topic has subscribers, see `Audience.present`.
    """

    def __init__(
        self, node: Any, topic: str, depth: int, frame_id: str = "", *, besides: int = 0
    ) -> None:
        self._publisher = node.create_publisher(JointState, topic, depth)
        self._writer = JointStateWriter(frame_id)
        self.heard = Audience(self._publisher, besides).present

    def publish(
        self,
        nanoseconds: int,
        names: tuple[str, ...],
        position: Sequence[float] = (),
        velocity: Sequence[float] = (),
        effort: Sequence[float] = (),
    ) -> None:
        """Publish a message, if the topic has subscribers; see `JointStateWriter.write`."""
        if self.heard():
            self._publisher.publish(
                self._writer.write(nanoseconds, names, position, velocity, effort)
            )
