"""The laws that let a person or a planner move the joint, in the node, spoken to over ROS alone."""

from __future__ import annotations

import contextlib
import math
import os
import subprocess
import time

import pytest

rclpy = pytest.importorskip("rclpy")

from std_msgs.msg import Float64MultiArray  # noqa: E402

from pam_demo.chain import private_domain  # noqa: E402
from pam_model.rig import load_rig  # noqa: E402
from support.processes import end  # noqa: E402
from support.reruns import HOST_STALLS  # noqa: E402

from .controller_bench import ELBOW, Bench, command, environment  # noqa: E402

pytestmark = [pytest.mark.system, pytest.mark.rerun_because(HOST_STALLS)]
WEIGHT = load_rig(ELBOW).joints[0].gravity_torque  # N m


@pytest.fixture
def bench():
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    made = Bench(int(private_domain()["ROS_DOMAIN_ID"]))
    yield made
    made.close()


@contextlib.contextmanager
def running(bench: Bench, law: str, **parameters: float):
    """A controller with this law, which controls the arm of the bench."""
    given = {name.replace("__", "."): value for name, value in parameters.items()}
    asked = {"law": law, "loop.stale_after": 0.25, **given}
    process = subprocess.Popen(
        command(ELBOW, parameters=asked),
        env=environment(bench.domain),
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        bench.wait(lambda: bench.commands or process.poll() is not None, "valve commands")
        assert process.poll() is None, process.stderr.read()
        bench.wait_until_heard()
        values = bench.health["pam_controller: loop"].values
        assert [each.value for each in values if each.key == "law"] == [law]
        yield
    finally:
        end(process)


def push(bench: Bench, torque: float) -> None:
    """Let an outside torque -torque cos(q) act from now on."""
    bench.change = {
        "joint.gravity_torque": math.hypot(WEIGHT, torque),
        "joint.gravity_angle": -math.atan2(torque, WEIGHT),
    }


def rest(bench: Bench, what: str) -> float:
    """Wait until the joint has stood still for a second; where it is [rad]."""

    def stands() -> bool:
        last = [q for at, q in list(bench.trace) if at > bench.trace[-1][0] - 1.0]
        return len(last) > 100 and max(last) - min(last) < 4e-3

    begin = time.monotonic()
    bench.wait(lambda: time.monotonic() > begin + 1.0 and stands(), what)
    return bench.position


@pytest.mark.long("test_hands_on_laws holds the same of the law without ROS")
def test_float_is_moved_by_a_hand_no_faster_than_its_limit_and_stays_where_it_is_put(bench):
    with running(bench, "gravity_compensation", float__speed_limit=0.3, float__hold_torque=0.2):
        start = rest(bench, "the joint at rest")
        push(bench, -1.0)
        bench.wait(lambda: bench.position > start + 0.15, "the joint lifted")
        since = bench.trace[-1][0]
        bench.wait(lambda: bench.position > start + 0.45, "the joint lifted further")
        moved = [(at, q) for at, q in list(bench.trace) if at > since]
        push(bench, 0.0)
        put = rest(bench, "the joint where it was put")
        assert put > start + 0.3
        assert (moved[-1][1] - moved[0][1]) / (moved[-1][0] - moved[0][0]) < 1.2 * 0.3
        bench.send([start], 1.0)
        commands = "pam_controller: commands"
        bench.wait(lambda: "moved by hand" in bench.health[commands].message, "the refusal")
        assert abs(bench.position - put) < 0.02


def test_impedance_gives_way_by_torque_over_stiffness_and_follows_trajectories(bench):
    with running(bench, "impedance"):
        bench.stiffness.publish(Float64MultiArray(data=[10.0]))
        bench.send([0.3], 1.0)
        bench.wait(lambda: abs(bench.position - 0.3) < 0.01, "the joint at 0.3 rad")
        before = rest(bench, "the joint at 0.3 rad")
        push(bench, 1.5)
        bench.wait(lambda: bench.position < before - 0.08, "the joint pushed away")
        after = rest(bench, "the joint pushed away")
        assert 10.0 * (before - after) == pytest.approx(1.5 * math.cos(after), rel=0.1)
        push(bench, 0.0)
        bench.wait(lambda: abs(bench.position - before) < 0.01, "the joint back")


@pytest.mark.long("test_hands_on_laws holds the same of the law without ROS")
def test_torques_are_given_and_the_joint_is_held_when_they_cease(bench):
    topic = "pam_controller/torque_commands"
    torques = bench.node.create_publisher(Float64MultiArray, topic, 1)
    with running(bench, "torque", stream__timeout=0.5):
        bench.wait(lambda: torques.get_subscription_count() > 0, "the torque topic")
        asked, given = [], []
        begin = time.monotonic()
        while (now := time.monotonic() - begin) < 5.0:
            q = bench.position
            wanted = WEIGHT * math.sin(q) + 3.0 * (0.3 - q)  # a planner: gravity and a spring
            torques.publish(Float64MultiArray(data=[wanted]))
            if now > 3.0:
                asked.append(wanted)
                given.append(bench.plant.output["torque"])
            time.sleep(0.01)
        assert abs(bench.position - 0.3) < 0.1
        off = sum(g - a for g, a in zip(given, asked, strict=True)) / len(asked)
        assert abs(off) < 0.15
        held = rest(bench, "the joint held after the last torque")
        assert abs(held - 0.3) < 0.15
