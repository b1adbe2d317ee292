"""The markers of the muscles stand where the rig file says, and only for measured joints."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("rclpy")

import rclpy
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from visualization_msgs.msg import MarkerArray

from pam_bringup.viewer.markers_node import MarkersNode
from pam_demo.chain import private_domain
from pam_model.rig import load_rig

ELBOW = Path(__file__).parents[2] / "config/elbow.yaml"
RIG = load_rig(ELBOW)


@pytest.fixture
def robot(monkeypatch):
    for name, value in private_domain().items():
        monkeypatch.setenv(name, value)
    rclpy.init(args=["--ros-args", "--params-file", str(ELBOW)])
    markers, peer = MarkersNode(), rclpy.create_node("peer")
    executor = SingleThreadedExecutor()
    for node in (markers, peer):
        executor.add_node(node)
    yield peer, executor
    for node in (markers, peer):
        node.destroy_node()
    rclpy.try_shutdown()


def shown(robot, position: list[float], pressures: list[float]) -> dict[str, object]:
    """The markers by name, for an angle and pressures that are published until they appear."""
    peer, executor = robot
    heard: list[MarkerArray] = []
    peer.create_subscription(MarkerArray, "pam_markers/muscles", heard.append, 1)
    angles = peer.create_publisher(JointState, "joint_states", 1)
    gauges = peer.create_publisher(JointState, "pressure_states", 1)
    for _ in range(400):
        angles.publish(JointState(name=["elbow"][: len(position)], position=position))
        gauges.publish(JointState(name=list(RIG.muscle_names), effort=pressures))
        executor.spin_once(timeout_sec=0.02)
        if len(heard) > 4 or (not position and heard):
            break
    return {marker.ns: marker for marker in heard[-1].markers} if heard else {}


def test_muscles_have_their_length_and_redden_with_their_pressure(robot):
    muscle = RIG.muscle("elbow_flexor")
    found = shown(robot, [0.5], [muscle.max_pressure, 0.0])
    flexor, extensor = found["elbow/elbow_flexor"], found["elbow/elbow_extensor"]
    radius = RIG.joints[0].pulley_radius
    assert flexor.scale.z == pytest.approx(muscle.neutral_length - 0.5 * radius)
    assert extensor.scale.z == pytest.approx(muscle.neutral_length + 0.5 * radius)
    assert flexor.color.r > extensor.color.r
    assert extensor.pose.position.x == pytest.approx(radius)
    assert flexor.header.frame_id == "base_link"
    assert not any(name.endswith("/link") for name in found), "the URDF shows the link"


def test_a_joint_that_is_not_measured_is_not_drawn(robot):
    assert shown(robot, [], [1e5, 1e5]) == {}
