"""A node that only exchanges messages: the least that a node of the suite can cost.

    python benchmarks/bare_node.py RATE JOINTS [OUT,OUT,...] [IN,IN,...]

A thread with absolute deadlines publishes one JointState on each topic of the first list, and an
executor in the main thread takes those of the second list. `chain_bench.py` starts it.
"""

from __future__ import annotations

import sys

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from pam_model.errors import PamError
from pam_ros.node_help import NodeHelp
from pam_ros.periodic import PeriodicLoop
from pam_ros.spin import spin_node

HELP = NodeHelp("python benchmarks/bare_node.py", "exchanges messages", (), "", "", ())


def make_node(rate: float, joints: int, published: list[str], heard: list[str]) -> Node:
    """The running node."""
    node = Node("bare_node")
    names = [f"joint_{index}" for index in range(joints)]
    values = [0.1] * joints
    publishers = [node.create_publisher(JointState, topic, 10) for topic in published]
    sensed = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    for topic in heard:
        node.create_subscription(JointState, topic, lambda message: None, sensed)

    def step(now: float) -> None:
        for publisher in publishers:
            message = JointState(name=names, position=values)
            message.header.stamp.sec = int(now)
            publisher.publish(message)

    node.loop = PeriodicLoop(step, 1.0 / rate)
    node.loop.start()
    node.get_logger().info("running")
    return node


def main() -> int:
    """Run the node until a signal stops it."""
    rate, joints, published, heard = sys.argv[1:5]
    topics = [[name for name in part.split(",") if name] for part in (published, heard)]
    return spin_node(
        lambda: make_node(float(rate), int(joints), *topics),
        HELP,
        [],
        lambda node: node.loop.check(),
        mistake=PamError,
    )


if __name__ == "__main__":
    sys.exit(main())
