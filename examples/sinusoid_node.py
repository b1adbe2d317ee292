"""A node of your own that drives a joint along a sine, by streamed references.

./pam demo robot                 # or ros2 launch pam_bringup simulation.launch.py
.venv/bin/python examples/sinusoid_node.py [JOINT]    # in a second terminal
"""

import contextlib
import math
import sys

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState

from pam_ros import leave_out_shared_memory

AMPLITUDE, FREQUENCY, RATE = 0.3, 0.25, 100.0  # rad, Hz, Hz


class Sinusoid(Node):
    """Streams the angle and its velocity; begins at the present angle and grows smoothly."""

    def __init__(self, joint: str) -> None:
        super().__init__("sinusoid")
        self.joint = joint
        self.centre: float | None = None
        self.began = 0.0
        self.create_subscription(JointState, "joint_states", self.hear, 1)
        self.commands = self.create_publisher(JointState, "pam_controller/commands", 1)
        self.create_timer(1.0 / RATE, self.send)
        self.get_logger().info(f"waiting for the angle of {joint} on joint_states")

    def hear(self, message: JointState) -> None:
        """Take the first measured angle as the middle of the motion."""
        if self.centre is None and self.joint in message.name:
            self.centre = message.position[list(message.name).index(self.joint)]
            self.began = self.now()
            self.get_logger().info(f"moving {self.joint}; Ctrl-C ends it")

    def now(self) -> float:
        """The present time [s]."""
        return self.get_clock().now().nanoseconds * 1e-9

    def send(self) -> None:
        """Send one reference."""
        if self.centre is None:
            return
        time, turn = self.now() - self.began, 2.0 * math.pi * FREQUENCY
        growing = min(time / 2.0, 1.0)
        message = JointState(name=[self.joint])
        message.header.stamp = self.get_clock().now().to_msg()
        message.position = [self.centre + AMPLITUDE * growing * math.sin(turn * time)]
        message.velocity = [AMPLITUDE * growing * turn * math.cos(turn * time)]
        self.commands.publish(message)


if __name__ == "__main__":
    leave_out_shared_memory()  # else a node that appears may stop this one for a third of a second
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Sinusoid(sys.argv[1] if len(sys.argv) > 1 else "elbow"))
