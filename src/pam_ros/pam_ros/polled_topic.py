"""A subscription whose messages a loop takes itself, without an executor.

An executor wakes its thread for every message, and this thread then competes with the loop for the
interpreter. A loop that uses the latest messages once in a cycle can take them itself, which saves
both. The messages are taken as bytes and pass the guarded decoder of `pam_ros.subscriptions`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Final

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from pam_ros.subscriptions import subscribe

MOST_TAKEN: Final = 32
"""Messages that are taken in one call; a flood of them must not stop the loop that takes them."""

DEPTH: Final = 10
"""Messages that are kept from one poll to the next; several nodes may publish on one topic."""

EVERY: Final = 1000
"""The same for a topic of which no message may be lost: a pause of 0.1 s at 10000 messages/s."""


class PolledTopic:
    """One subscription.

    Parameters
    ----------
    node : rclpy.node.Node
        Makes the subscription.
    topic : str
        Name of the topic.
    take : callable
        Called by `poll` with each message, oldest first.
    read : callable, optional
        As for `pam_ros.subscriptions.subscribe`.
    malformed : callable, optional
        As for `pam_ros.subscriptions.subscribe`.
    best_effort : bool, optional
        Whether lost messages stay lost, as it suits measurements.
    latched : bool, optional
        Whether the last message from before the subscription is wanted too.
    overflow : callable, optional
        For a topic that can forbid something: every message that waits is kept and handed over,
        up to `EVERY`. If more arrived since the last `poll`, a "no" may have been among those that
        the middleware dropped, and this is called, after the others were handed over.

    Attributes
    ----------
    subscription : rclpy.subscription.Subscription
        The subscription.
    arrived : float
        When the last message that was handed over arrived, wall clock [s]; 0 before the first.
    waited : float
        How long it had then waited for `poll` [s]; at most the time since the `poll` before, so
        that a wall clock that is set cannot make a message older than it is.
    """

    def __init__(
        self,
        node: Any,
        message_type: Any,
        topic: str,
        take: Callable[[Any], object],
        *,
        read: Callable[[bytes], Any] | None = None,
        malformed: Callable[[], object] | None = None,
        best_effort: bool = False,
        latched: bool = False,
        overflow: Callable[[], object] | None = None,
    ) -> None:
        self._overflow = overflow
        self._most = EVERY if overflow is not None else MOST_TAKEN
        reliability, durability = ReliabilityPolicy, DurabilityPolicy
        qos = QoSProfile(
            depth=EVERY if overflow is not None else DEPTH,
            reliability=reliability.BEST_EFFORT if best_effort else reliability.RELIABLE,
            durability=durability.TRANSIENT_LOCAL if latched else durability.VOLATILE,
        )
        self.subscription = subscribe(
            node, message_type, topic, take, qos, read=read, malformed=malformed
        )
        # rclpy has no subscription outside of an executor; the warnings about publishers of
        # another quality of service stay with the node
        node._subscriptions.remove(self.subscription)
        self._node = node
        self.arrived = self.waited = 0.0
        self._polled_at = time.monotonic()
        self._take = self.subscription.callback
        self._message_type = message_type
        self._handle = self.subscription.handle

    def poll(self) -> int:
        """Hand over the messages that have arrived; returns their number, never waits."""
        handle = self._handle
        now = time.monotonic()
        longest, self._polled_at = now - self._polled_at, now
        with handle:
            for count in range(self._most):
                taken = handle.take_message(self._message_type, True)
                if taken is None:
                    return count
                data, about = taken
                self.arrived = 1e-9 * about["received_timestamp"]
                self.waited = min(max(time.time() - self.arrived, 0.0), longest)
                self._take(data)
        if self._overflow is not None:
            self._overflow()
        return self._most

    def destroy(self) -> None:
        """End the subscription; `poll` must not be called afterwards."""
        self._node._subscriptions.append(self.subscription)
        self._node.destroy_subscription(self.subscription)
