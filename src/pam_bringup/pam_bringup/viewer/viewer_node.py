"""Subscribes to the topics of a running robot, for the view."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from pam_bringup.viewer.robot_view import TOPICS, RobotView
from pam_ros.end_signals import EndSignals
from pam_ros.node_end import end_node
from pam_ros.start import start_ros
from pam_ros.steady_timers import turns
from pam_ros.subscriptions import MOST_BYTES_OF_DIAGNOSTICS, subscribe
from pam_ros.unforeseen import ending_broken

TYPES = {kind.__name__: kind for kind in (DiagnosticArray, DiagnosticStatus, JointState)}
TYPES["Float64MultiArray"] = Float64MultiArray
_SENSED = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class ViewerNode(Node):  # type: ignore[misc]
    """Hands every message to the view, with the time at which it came."""

    def __init__(self, namespace: str, view: RobotView) -> None:
        super().__init__("pam_viewer", namespace=namespace)
        self._view = view
        for topic, kind in TOPICS.items():
            qos = _LATCHED if topic == "pam_driver/state" else _SENSED
            take = partial(self._take, topic)
            message_type = TYPES[kind.rsplit("/", 1)[-1]]
            subscribe(self, message_type, topic, take, qos, most_bytes=MOST_BYTES_OF_DIAGNOSTICS)

    def _take(self, topic: str, message: Any) -> None:
        self._view.take(topic, time.time(), message)


def show_robot(namespace: str, view: RobotView) -> None:
    """Show a running robot until SIGINT or SIGTERM."""
    with EndSignals() as signals:
        start_ros([])
        node = ViewerNode(namespace, view)
        executor = EventsExecutor()
        executor.add_node(node)
        try:
            with ending_broken(node, ExternalShutdownException):
                for _ in turns(executor, None, lambda: rclpy.ok() and not signals.asked):
                    pass
        except ExternalShutdownException:
            pass
        finally:
            end_node(node, executor)
            rclpy.try_shutdown()
