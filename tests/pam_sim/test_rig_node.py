"""The rig node as a process: truth on topics, health, clean end, clear refusals."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

from pam_demo.chain import private_domain
from support.rigs import ELBOW

rclpy = pytest.importorskip("rclpy")

ENVIRONMENT = os.environ | private_domain()
PORT = 44000 + os.getpid() % 999


def command(*parameters, rig=True):
    arguments = [sys.executable, "-m", "pam_sim.rig_node", "--ros-args"]
    if rig:
        arguments += ["--params-file", str(ELBOW)]
    for entry in (
        "bus.interface:=udp_multicast",
        "bus.channel:=239.74.163.2",
        f"bus.port:={PORT}",
        *parameters,
    ):
        arguments += ["-p", entry]
    return arguments


@pytest.mark.sampled("one of the two signals, which one function answers", cases=1)
@pytest.mark.system
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_truth_on_topics_and_a_clean_end(number, monkeypatch):
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import FluidPressure, JointState

    for key in ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_DOMAIN_ID"):
        monkeypatch.setenv(key, ENVIRONMENT[key])
    process = subprocess.Popen(
        command("seed:=3"), env=ENVIRONMENT, stderr=subprocess.PIPE, text=True
    )
    context = rclpy.Context()
    try:
        rclpy.init(context=context)
        node = rclpy.create_node("listener", context=context)
        heard = {}
        for topic, kind in (
            ("ground_truth/joint_states", JointState),
            ("ground_truth/muscle_states", JointState),
            ("ground_truth/pressure_states", JointState),
            ("ground_truth/supply_pressure", FluidPressure),
            ("/diagnostics", DiagnosticArray),
        ):
            node.create_subscription(
                kind, topic, lambda m, topic=topic: heard.__setitem__(topic, m), QoSProfile(depth=1)
            )
        executor = rclpy.executors.SingleThreadedExecutor(context=context)
        executor.add_node(node)
        end = time.monotonic() + 60.0
        while len(heard) < 5 and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.1)
        assert len(heard) == 5
        joints, muscles = heard["ground_truth/joint_states"], heard["ground_truth/muscle_states"]
        assert list(joints.name) == ["elbow"]
        assert list(muscles.name) == ["elbow_flexor", "elbow_extensor"]
        assert list(muscles.position) == pytest.approx([0.225, 0.225], abs=0.031)
        assert list(heard["ground_truth/pressure_states"].effort) == pytest.approx([0, 0], abs=1.0)
        assert heard["ground_truth/supply_pressure"].fluid_pressure == 701325.0
        assert abs(joints.header.stamp.sec - time.time()) < 30.0
        node.destroy_node()
        process.send_signal(number)
        assert process.wait(20) == 0
        assert "Traceback" not in process.stderr.read()
    finally:
        process.kill()
        process.wait()
        rclpy.try_shutdown(context=context)


@pytest.mark.sampled("two of the five mistakes", cases=2)
@pytest.mark.parametrize(
    ("parameters", "rig", "message"),
    [
        (["hidden_effects:='wind.force=3'"], True, "wind.force"),
        (["pressure_noise:=-1.0"], True, "pressure_noise"),
        (["presure_noise:=1.0"], True, "presure_noise"),
        (["true_rig:='/nowhere/rig.yaml'"], True, "/nowhere/rig.yaml"),
        ([], False, "no rig"),
    ],
)
def test_bad_input_is_one_message(parameters, rig, message):
    done = subprocess.run(
        command(*parameters, rig=rig),
        env=ENVIRONMENT,
        stderr=subprocess.PIPE,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
