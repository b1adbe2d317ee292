"""The subscriptions of all nodes: no message can end a node, whatever its bytes are.

A node subscribes here and nowhere else. Every message arrives as bytes and passes a guarded decoder
(`pam_ros.message_decoder`). One that is malformed, or larger than a message of its topic can be, is
counted and otherwise treated as if it had not arrived. The log says once for each topic that this
happened; `/diagnostics` says it once a second from then on, in the status "<node>: messages".
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any, Final
from weakref import WeakKeyDictionary

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

from pam_ros.diagnostics import OK, WARN, diagnostic_array, diagnostic_status
from pam_ros.errors import MalformedMessageError
from pam_ros.message_decoder import checked, decode

MOST_BYTES: Final = 32_768
"""Size of the largest message that is read, where a topic has no other limit [bytes]."""
MOST_BYTES_OF_DIAGNOSTICS: Final = 1_048_576
"""The same for a topic that all nodes of a robot share, such as `/diagnostics` [bytes]."""
_TELL_EVERY: Final = 1.0  # s
_WARNED: Final = 5.0  # s that a status warns after a malformed message


class GuardedTopic:
    """The guarded decoder of one subscription; called with the bytes of each message.

    Parameters
    ----------
    topic : str
        Name of the topic.
    read : callable
        Makes a message of bytes; any exception means that they are malformed.
    take : callable
        Takes the message; it may raise MalformedMessageError as well, if it reads on.
    malformed : callable or None
        Called for each malformed message.
    most_bytes : int or None
        Size of the largest message that is read.

    Attributes
    ----------
    topic : str
        Name of the topic.
    count : int
        Malformed messages so far.
    last : (str, float)
        What was wrong with the last one, and when it came, monotonic [s].
    """

    def __init__(
        self,
        topic: str,
        read: Callable[[bytes], Any],
        take: Callable[[Any], object],
        malformed: Callable[[], object] | None,
        most_bytes: int | None,
    ) -> None:
        self.topic = topic
        self.count = 0
        self.last = "", 0.0
        self._read = read
        self._take = take
        self._malformed = malformed
        self._most_bytes = most_bytes

    def __call__(self, data: bytes) -> None:
        """Read a message and hand it over."""
        if self._most_bytes is not None and len(data) > self._most_bytes:
            self.refuse(f"{len(data)} bytes, expected at most {self._most_bytes}")
            return
        try:
            message = self._read(data)
        except MalformedMessageError as error:
            self.refuse(str(error))
            return
        except Exception as error:  # whatever it is, the bytes have brought it about
            self.refuse(type(error).__name__)
            return
        try:
            self._take(message)
        except MalformedMessageError as error:
            self.refuse(str(error))

    def refuse(self, reason: str) -> None:
        """Count a message as malformed; for whoever reads on after the message was taken."""
        self.count += 1
        self.last = reason, time.monotonic()
        if self._malformed is not None:
            self._malformed()


class MalformedMessages:
    """Reports the malformed messages of one node, in its log and in `/diagnostics`.

    Attributes
    ----------
    topics : list of GuardedTopic
        Those of the node's subscriptions.
    """

    def __init__(self, node: Any) -> None:
        self.topics: list[GuardedTopic] = []
        self._name, self._namespace = node.get_name(), node.get_namespace()
        self._log = node.get_logger()
        self._clock = node.get_clock()
        self._told: set[str] = set()
        # made when it is needed: most nodes never need it, and not all have the topic; a plain
        # publisher, since that of a lifecycle node is silent until the node is active
        self._make_publisher = partial(_publisher_of, node)
        self._publisher: Any = None
        node.create_timer(_TELL_EVERY, self.tell, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def count(self) -> int:
        """Malformed messages of all topics so far."""
        return sum(topic.count for topic in self.topics)

    def tell(self) -> None:
        """Publish a status, if there was any malformed message so far."""
        found = [topic for topic in self.topics if topic.count]
        if not found:
            return
        for topic in found:
            if topic.topic not in self._told:
                self._told.add(topic.topic)
                self._log.warning(
                    f"malformed message on {topic.topic}, not used: {topic.last[0]}; further ones "
                    "are counted in /diagnostics"
                )
        if self._publisher is None:
            self._publisher = self._make_publisher()
        self._publisher.publish(
            diagnostic_array(
                self._clock.now().to_msg(), self.status(found), namespace=self._namespace
            )
        )

    def status(self, found: list[GuardedTopic]) -> Any:
        """The status about topics that had malformed messages."""
        newest = max(topic.last[1] for topic in found)
        counts: Counter[str] = Counter()
        for topic in found:  # a node may subscribe to a topic more than once
            counts[topic.topic] += topic.count
        told = ", ".join(f"{count} on {name}" for name, count in counts.items())
        values = {f"malformed on {name}": count for name, count in counts.items()}
        reasons = {f"last malformed on {topic.topic}": topic.last[0] for topic in found}
        level = WARN if time.monotonic() - newest < _WARNED else OK
        text = f"malformed messages, not used: {told}"
        return diagnostic_status(f"{self._name}: messages", level, text, {**values, **reasons})


def _publisher_of(node: Any) -> Any:
    return Node.create_publisher(node, DiagnosticArray, "/diagnostics", 10)


_OF_NODES: WeakKeyDictionary[Any, MalformedMessages] = WeakKeyDictionary()


def malformed_messages(node: Any) -> MalformedMessages:
    """What a node has received that was malformed."""
    if node not in _OF_NODES:
        _OF_NODES[node] = MalformedMessages(node)
    return _OF_NODES[node]


def subscribe(
    node: Any,
    kind: Any,
    topic: str,
    take: Callable[[Any], object],
    qos: Any,
    *,
    raw: bool = False,
    read: Callable[[bytes], Any] | None = None,
    malformed: Callable[[], object] | None = None,
    most_bytes: int | None = MOST_BYTES,
) -> Any:
    """Subscribe to a topic.

    Parameters
    ----------
    node : rclpy.node.Node
        Makes the subscription.
    kind : type
        Of the messages.
    topic : str
        Name of the topic.
    take : callable
        Takes each message.
    qos : rclpy.qos.QoSProfile or int
        Quality of service, or the depth of the queue.
    raw : bool, optional
        Whether `take` takes the message's bytes, which are checked all the same.
    read : callable, optional
        Makes of bytes what `take` takes, instead of a message; raises MalformedMessageError.
    malformed : callable, optional
        Called for each malformed message, for topics where a missing message is not safe.
    most_bytes : int or None, optional
        Size of the largest message that is read [bytes]; None for any.

    Returns
    -------
    rclpy.subscription.Subscription
        Its `callback` is a `GuardedTopic`, until a main loop guards the node's callbacks
        (`pam_ros.unforeseen.guard_callbacks`).
    """
    if read is None:
        read = partial(checked if raw else decode, kind=kind)
    name = node.resolve_topic_name(topic)
    guarded = GuardedTopic(name, read, take, malformed, most_bytes)
    malformed_messages(node).topics.append(guarded)
    return node.create_subscription(kind, topic, guarded, qos, raw=True)
