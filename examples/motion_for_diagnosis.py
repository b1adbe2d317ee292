"""A motion that shows a diagnosis what it needs: random steps and sines, at two stiffnesses.

./pam demo robot                                             # or a real robot
./pam gap record --rig config/elbow.yaml --out recording     # in a second terminal
.venv/bin/python examples/motion_for_diagnosis.py [RIG] [JOINT]                # in a third one
"""

import contextlib
import math
import random
import sys

import rclpy
from builtin_interfaces.msg import Duration
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import pam_model
from pam_ros import leave_out_shared_memory

REST, LENGTH, SHARE = 3.0, 45.0, 0.75  # s, s, of half the joint's range
SOFT, STIFF, CHANGE = 0.24, 0.43, 10.0  # of the joint's largest stiffness; s between them
RATE = 20.0  # points per second of a sine
PATIENCE = 20.0  # s, for a controller


def waypoints(reach: float, seed: int = 1) -> list[tuple[float, float]]:
    """Times after the start [s], angles from the middle [rad]: steps with pauses, and two sines."""
    draw = random.Random(seed)
    points, time = [(REST, 0.0)], REST
    for frequency in (0.3, 1.0):
        until = time + 0.3 * LENGTH
        while time < until:
            time += draw.uniform(1.0, 1.5)
            position = draw.choice((-1, 1)) * draw.uniform(0.4, 1.0) * reach
            points += [(time, position), (time + 0.8, position)]
            time += 0.8
        points.append((time + 1.0, 0.0))
        time, size = time + 1.0, min(reach, 0.25 / frequency)
        for k in range(1, round(0.2 * LENGTH * RATE) + 1):
            angle = 2.0 * math.pi * frequency * k / RATE
            points.append((time + k / RATE, size * math.sin(angle)))
        time, _ = points[-1]
    return [*points, (time + 2.0, 0.0)]


def largest_stiffness(rig: pam_model.Rig, joint: str) -> float:
    """What the muscles reach without load in the middle of the range [N m/rad]."""
    middle = 0.5 * sum(rig.joint(joint).position_limits)
    return pam_model.JointStatics.from_rig(rig, joint).pressures_for(0.0, 1e9, middle).stiffness


class Motion(Node):
    """Sends the trajectory once, and the stiffness from time to time."""

    def __init__(self, rig: pam_model.Rig, joint: str) -> None:
        super().__init__("motion_for_diagnosis")
        self.largest = [largest_stiffness(rig, name) for name in rig.joint_names]
        self.share = SOFT
        self.soft = self.create_publisher(Float64MultiArray, "pam_controller/stiffness_commands", 1)
        self.motion = self.create_publisher(JointTrajectory, "pam_controller/joint_trajectory", 1)
        low, high = rig.joint(joint).position_limits
        message = JointTrajectory(joint_names=[joint])
        for time, angle in waypoints(SHARE * 0.5 * (high - low)):
            after = Duration(sec=int(time), nanosec=int(time % 1.0 * 1e9))
            position = [0.5 * (low + high) + angle]
            message.points.append(JointTrajectoryPoint(positions=position, time_from_start=after))
        self.message, self.end = message, time
        self.waiting = self.create_timer(0.1, self.begin)
        self.begun: float | None = None

    def now(self) -> float:
        """The present time [s]."""
        return self.get_clock().now().nanoseconds * 1e-9

    def begin(self) -> None:
        """Send the trajectory as soon as the controller hears it."""
        if self.motion.get_subscription_count() and self.soft.get_subscription_count():
            self.waiting.cancel()
            self.motion.publish(self.message)
            self.change()
            self.create_timer(CHANGE, self.change)
            self.begun = self.now()
            self.get_logger().info(f"moving for {self.end:.0f} s")

    def change(self) -> None:
        """Change between soft and stiff."""
        self.share = STIFF if self.share == SOFT else SOFT
        self.soft.publish(Float64MultiArray(data=[self.share * most for most in self.largest]))


def main() -> None:
    """Send the motion and wait for its end."""
    leave_out_shared_memory()
    rclpy.init()
    try:
        rig = pam_model.load_rig(sys.argv[1] if len(sys.argv) > 1 else "config/elbow.yaml")
        node = Motion(rig, sys.argv[2] if len(sys.argv) > 2 else rig.joint_names[0])
    except pam_model.PamError as error:
        sys.exit(f"error: {error}")
    start = node.now()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        while node.begun is None or node.now() < node.begun + node.end + 3.0:
            rclpy.spin_once(node, timeout_sec=0.1)
            if node.begun is None and node.now() > start + PATIENCE:
                sys.exit("error: no controller listens; start ./pam demo robot, or your robot")


if __name__ == "__main__":
    main()
