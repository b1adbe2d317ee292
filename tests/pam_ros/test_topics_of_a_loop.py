"""Topics that a loop publishes and takes by itself, without an executor and without objects."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy")

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState

from pam_demo.chain import private_domain
from pam_ros import polled_topic
from pam_ros.joint_state_bytes import JointStateReader
from pam_ros.joint_state_publisher import JointStatePublisher, nanoseconds_of
from pam_ros.polled_topic import PolledTopic

pytestmark = pytest.mark.system

PATIENCE = 30.0


@pytest.fixture
def node() -> Iterator[Node]:
    rclpy.init(domain_id=int(private_domain()["ROS_DOMAIN_ID"]))
    made = Node("loop")
    yield made
    made.destroy_node()
    rclpy.try_shutdown()


def wait(until: Callable[[], object]) -> None:
    end = time.monotonic() + PATIENCE
    while not until():
        assert time.monotonic() < end
        time.sleep(0.01)


def polled(node: Node) -> tuple[PolledTopic, list[Any]]:
    heard: list[Any] = []
    topic = PolledTopic(node, JointState, "states", heard.append, read=JointStateReader().read)
    return topic, heard


def test_every_waiting_message_of_two_publishers_is_taken_in_one_poll(node: Node) -> None:
    topic, heard = polled(node)
    first, second = (JointStatePublisher(node, "states", 10, frame) for frame in ("a", "b"))
    wait(first._publisher.get_subscription_count)
    wait(second._publisher.get_subscription_count)
    assert topic.poll() == 0
    for number in range(3):
        first.publish(number, ("joint",), (0.5,))
        second.publish(number, ("joint",), (0.5,))
    wait(lambda: topic.poll() + len(heard) and len(heard) == 6)
    assert [one.frame_id for one in heard].count("a") == 3
    assert topic.poll() == 0


def test_a_message_knows_how_long_it_waited_for_the_loop(
    node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its age when it arrived must not depend on when the loop has time for it."""
    topic, heard = polled(node)
    publisher = JointStatePublisher(node, "states", 1)
    wait(publisher._publisher.get_subscription_count)
    topic.poll()
    before = time.time()
    publisher.publish(0, ("joint",), (0.5,))
    time.sleep(0.3)
    wait(topic.poll)
    assert 0.2 < topic.waited <= time.time() - before
    assert before <= topic.arrived <= time.time() - 0.2
    publisher.publish(0, ("joint",), (0.6,))
    time.sleep(0.1)
    clock = SimpleNamespace(monotonic=time.monotonic, time=lambda: time.time() + 1000.0)
    began = topic._polled_at
    monkeypatch.setattr(polled_topic, "time", clock)
    wait(topic.poll)
    assert len(heard) == 2
    assert topic.waited <= time.monotonic() - began, "although the wall clock was set"


def test_a_polled_topic_does_not_wake_an_executor(node: Node) -> None:
    topic, heard = polled(node)
    publisher = JointStatePublisher(node, "states", 1)
    wait(publisher._publisher.get_subscription_count)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    publisher.publish(5, ("joint",), (0.5,))
    for _ in range(5):
        executor.spin_once(timeout_sec=0.02)
    assert not heard
    wait(topic.poll)
    assert heard[0].position == (0.5,)
    executor.shutdown()


def test_a_polled_topic_can_be_ended_before_its_node(node: Node) -> None:
    topic, _ = polled(node)
    assert node.count_subscribers("states") == 1
    topic.destroy()
    wait(lambda: node.count_subscribers("states") == 0)


def test_a_subscriber_of_message_objects_hears_what_is_published_as_bytes(node: Node) -> None:
    heard: list[Any] = []
    node.create_subscription(JointState, "states", heard.append, 10)
    publisher = JointStatePublisher(node, "states", 10, "arm")
    wait(publisher._publisher.get_subscription_count)
    publisher.publish(3_000_000_007, ("a", "bc"), (1.0, 2.0), effort=(3.0, 4.0))
    wait(lambda: rclpy.spin_once(node, timeout_sec=0.1) or heard)
    (message,) = heard
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (3, 7)
    assert message.header.frame_id == "arm"
    assert list(message.name) == ["a", "bc"]
    assert (list(message.position), list(message.effort)) == ([1.0, 2.0], [3.0, 4.0])
    assert len(message.velocity) == 0


def test_a_time_becomes_a_stamp_without_losing_microseconds() -> None:
    assert nanoseconds_of(1_700_000_000.25) == 1_700_000_000_250_000_000
    assert abs(nanoseconds_of(1_700_000_000.123456) - 1_700_000_000_123_456_000) < 500
