"""The model node: measurements in as bytes, estimates out."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from pam_demo.chain import private_domain
from pam_model.model_node import ModelNode

ELBOW = Path(__file__).parents[2] / "config/elbow.yaml"
PATIENCE = 30.0


class Bench:
    """The node, a driver that measures, and ears, all in one thread."""

    def __init__(self, rate: float) -> None:
        words = ["--ros-args", "--params-file", str(ELBOW), "-p", f"publish_rate:={rate}"]
        rclpy.init(args=words, domain_id=int(private_domain()["ROS_DOMAIN_ID"]))
        self.model, self.peer = ModelNode(), Node("peer")
        self.executor = SingleThreadedExecutor()
        for node in (self.model, self.peer):
            self.executor.add_node(node)
        self.heard: dict[str, list[Any]] = {}
        self.pressures = self.peer.create_publisher(JointState, "pressure_states", 10)
        self.positions = self.peer.create_publisher(JointState, "joint_states", 10)

    def hear(self, kind: type, topic: str) -> list[Any]:
        heard = self.heard[topic] = []
        self.peer.create_subscription(kind, topic, heard.append, 10)
        return heard

    def measure(self) -> None:
        stamp = self.peer.get_clock().now().to_msg()
        pressures = JointState(name=["elbow_extensor", "elbow_flexor"], effort=[1e5, 2e5])
        positions = JointState(name=["gripper", "elbow"], position=[0.3, 0.1], velocity=[0.0, 0.0])
        pressures.header.stamp = positions.header.stamp = stamp
        self.pressures.publish(pressures)
        self.positions.publish(positions)

    def spin(self, until: Callable[[], object]) -> None:
        end = time.monotonic() + PATIENCE
        while not until():
            assert time.monotonic() < end
            self.measure()
            self.executor.spin_once(timeout_sec=0.01)

    def close(self) -> None:
        self.executor.shutdown()
        self.peer.destroy_node()
        self.model.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture(params=[100.0, 2.0], ids=["fast", "slow"])
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    made = Bench(request.param)
    yield made
    made.close()


def test_estimates_follow_from_measurements_at_any_rate_of_publishing(bench: Bench) -> None:
    muscles = bench.hear(JointState, "muscle_states")
    joints = bench.hear(JointState, "joint_estimates")
    stiffness = bench.hear(Float64MultiArray, "joint_stiffness")
    health = bench.hear(DiagnosticArray, "/diagnostics")

    def known() -> bool:
        return bool(muscles and joints and stiffness) and muscles[-1].effort[0] > 0.0

    bench.spin(known)
    # on a slow host, measurements may become too old meanwhile, and estimates NaN
    bench.spin(lambda: len(health) >= 2 and health[-1].status[0].message == "estimating")
    bench.spin(known)
    assert list(muscles[-1].name) == ["elbow_flexor", "elbow_extensor"]
    assert muscles[-1].effort[0] > muscles[-1].effort[1] > 0.0, "200 kPa pull more than 100 kPa"
    assert joints[-1].effort[0] > 0.0
    assert stiffness[-1].data[0] > 0.0
    counted = {pair.key: pair.value for pair in health[-1].status[0].values}
    assert float(counted["measurements per second"]) > 20, "none is lost between two estimates"
