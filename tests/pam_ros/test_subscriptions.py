"""A malformed message is counted, told once and not used; nothing that arrives ends a node."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("rclpy")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.experimental import EventsExecutor
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from std_msgs.msg import Bool

from pam_demo.chain import private_domain
from pam_ros.errors import MalformedMessageError
from pam_ros.polled_topic import PolledTopic
from pam_ros.subscriptions import GuardedTopic, malformed_messages, subscribe

PATIENCE = 30.0  # s

MALFORMED = (b"\0\1\0\0", b"", b"\0\1", b"\0\1\0\0\7", b"\1\1\0\0\1")


@pytest.fixture(params=[Node, LifecycleNode])
def node(request: pytest.FixtureRequest) -> Iterator[Any]:
    rclpy.init(domain_id=int(private_domain()["ROS_DOMAIN_ID"]))
    made = request.param("hearer", namespace="robot")
    yield made
    made.destroy_node()
    rclpy.try_shutdown()


def test_what_is_malformed_is_told_and_the_next_message_is_heard(
    node: Any, capfd: pytest.CaptureFixture[str]
) -> None:
    heard: list[Any] = []
    raw: list[Any] = []
    polled: list[Any] = []
    forbidden: list[None] = []
    health: list[Any] = []
    subscribe(node, Bool, "flag", heard.append, 10, malformed=lambda: forbidden.append(None))
    subscribe(node, Bool, "flag", raw.append, 10, raw=True)
    topic = PolledTopic(node, Bool, "flag", polled.append)
    peer = Node("peer", namespace="robot")
    peer.create_subscription(
        DiagnosticArray, "/diagnostics", lambda message: health.extend(message.status), 10
    )
    publisher = peer.create_publisher(Bool, "flag", 10)
    executor = EventsExecutor()
    for one in (node, peer):
        executor.add_node(one)

    def until(condition: Callable[[], Any]) -> None:
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end
            executor.spin_once(timeout_sec=0.05)
            topic.poll()

    try:
        until(lambda: publisher.get_subscription_count() == 3)
        for data in MALFORMED:
            publisher.publish(data)
        publisher.publish(Bool(data=True))
        until(lambda: heard and raw and polled)
        assert (heard, polled, raw) == ([Bool(data=True)], [Bool(data=True)], [b"\0\1\0\0\1"])
        assert len(forbidden) == len(MALFORMED)
        until(lambda: len(health) > 1)  # again and again, for who listens later
    finally:
        executor.shutdown()
        topic.destroy()
        peer.destroy_node()
    assert health[0].name == "robot/hearer: messages"
    assert health[0].level == DiagnosticStatus.WARN
    assert health[0].message.startswith("malformed messages, not used: ")
    counted = {pair.key: pair.value for pair in health[-1].values}
    assert counted["malformed on /robot/flag"] == str(3 * len(MALFORMED))
    assert malformed_messages(node).count == 3 * len(MALFORMED)
    assert capfd.readouterr().err.count("malformed message on /robot/flag") == 1


def test_whatever_a_reader_raises_is_the_fault_of_the_bytes() -> None:
    def read(data: bytes) -> Any:
        raise (MalformedMessageError("short"), MemoryError(), RecursionError())[len(data)]

    guarded = GuardedTopic("/a", read, pytest.fail, None, None)
    for data, text in ((b"", "short"), (b"1", "MemoryError"), (b"22", "RecursionError")):
        guarded(data)
        assert guarded.last[0] == text
    assert guarded.count == 3


def test_what_a_taker_raises_is_not_hidden() -> None:
    def take(_: object) -> None:
        raise KeyError("a mistake of the node")

    with pytest.raises(KeyError):
        GuardedTopic("/a", bytes, take, None, None)(b"")
