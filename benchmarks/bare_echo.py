"""A node that only passes on: half of the least way from a measurement frame to a command frame.

    python benchmarks/bare_echo.py driver GROUP PORT
    python benchmarks/bare_echo.py controller

The "driver" publishes each frame that it receives with python-can as a JointState, and sends a
frame for each JointState that comes back. The "controller" publishes each JointState that it hears.
`latency_bench.py` starts both and measures what the suite's nodes add.
"""

from __future__ import annotations

import sys
import threading

import can
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from pam_driver.can_bus.bus_opening import hear_own_group_only
from pam_model.errors import PamError
from pam_ros.node_help import NodeHelp
from pam_ros.spin import spin_node

HELP = NodeHelp("python benchmarks/bare_echo.py", "passes frames on", (), "", "", ())
QUESTION, ANSWER = 0x700, 0x701


def make_controller() -> Node:
    """Publishes what it hears."""
    node = Node("bare_controller")
    back = node.create_publisher(JointState, "back", 1)
    node.create_subscription(JointState, "there", back.publish, QoSProfile(depth=1))
    return node


def make_driver(group: str, port: int) -> Node:
    """Passes frames to the topic, and messages to the bus."""
    node = Node("bare_driver")
    there = node.create_publisher(JointState, "there", 1)
    bus = can.Bus(interface="udp_multicast", channel=group, port=port, hop_limit=0)
    hear_own_group_only(bus)

    def answer(message: JointState) -> None:
        data = bytes([int(message.position[0])])
        bus.send(can.Message(arbitration_id=ANSWER, is_extended_id=False, data=data))

    def receive() -> None:
        while True:
            frame = bus.recv()
            if frame is not None and frame.arbitration_id == QUESTION:
                there.publish(JointState(name=["joint"], position=[float(frame.data[0])]))

    node.create_subscription(JointState, "back", answer, QoSProfile(depth=1))
    threading.Thread(target=receive, daemon=True).start()
    return node


def main() -> int:
    """Run the node until a signal stops it."""
    role, *where = sys.argv[1:]

    def make_node() -> Node:
        if role == "controller":
            return make_controller()
        return make_driver(where[0], int(where[1]))

    return spin_node(make_node, HELP, [], mistake=PamError)


if __name__ == "__main__":
    sys.exit(main())
