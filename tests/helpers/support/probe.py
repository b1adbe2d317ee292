"""A ROS node inside the test that listens, speaks and calls, in a domain of its own."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, Self

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile


class Probe:
    """Spins in a thread; every wait is for a condition, none for a fixed time."""

    def __init__(self, environment: dict[str, str]) -> None:
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=int(environment["ROS_DOMAIN_ID"]))
        self.node = Node("probe", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._news = threading.Condition()
        self._publishers: dict[str, Any] = {}
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        try:
            while self._context.ok():
                self._executor.spin_once(timeout_sec=0.05)
        except (ExternalShutdownException, RCLError):
            if self._context.ok():  # else the context was closed in the middle of a turn
                raise

    def listen(self, message_type: Any, topic: str) -> list[Any]:
        """Messages of a topic from now on, as a list that grows."""
        received: list[Any] = []

        def keep(message: Any) -> None:
            with self._news:
                received.append(message)
                self._news.notify_all()

        self.node.create_subscription(message_type, topic, keep, QoSProfile(depth=100))
        return received

    def wait_for(self, what: str, condition: Callable[[], Any], timeout: float) -> Any:
        """Wait until `condition()` is true; returns its value.

        Raises
        ------
        AssertionError
            Saying `what` did not happen within `timeout` seconds.
        """
        deadline = time.monotonic() + timeout
        while True:
            value = condition()
            if value:
                return value
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise AssertionError(f"{what}: did not happen within {timeout:g} s")
            with self._news:
                self._news.wait(min(left, 0.05))

    def publisher(self, message_type: Any, topic: str, timeout: float = 10.0) -> Any:
        """A publisher that somebody listens to already."""
        if topic not in self._publishers:
            self._publishers[topic] = self.node.create_publisher(message_type, topic, 1)
        publisher = self._publishers[topic]
        self.wait_for(f"a subscriber of {topic}", publisher.get_subscription_count, timeout)
        return publisher

    def call(self, service_type: Any, name: str, request: Any, timeout: float = 10.0) -> Any:
        """Call a service and return its response."""
        client = self.node.create_client(service_type, name)
        deadline = time.monotonic() + timeout
        self.wait_for(f"service {name}", client.service_is_ready, timeout)
        while True:
            future = client.call_async(request)
            # a server that was killed is known for a while; a request to it is never answered
            patience = min(2.0 + 0.1 * timeout, max(deadline - time.monotonic(), 0.1))
            try:
                self.wait_for(f"a response of {name}", future.done, patience)
                break
            except AssertionError:
                if time.monotonic() > deadline:
                    raise
        response = future.result()
        self.node.destroy_client(client)
        return response

    def close(self) -> None:
        """End the node and its thread."""
        self._context.try_shutdown()
        self._thread.join(2.0)
        self._executor.shutdown()
        self.node.destroy_node()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
