"""A controller that got another name, a namespace and other topics on its command line."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState

from support.rigs import ELBOW

MUSCLES = ["elbow_flexor", "elbow_extensor"]


@pytest.mark.system
def test_a_renamed_controller_is_one_node_of_that_name(
    probe: Any, ros_environment: dict[str, str], patience: float, tmp_path: Path
) -> None:
    commands = probe.listen(JointState, "/robot1/valve_commands")
    references = probe.listen(JointState, "/robot1/left_controller/reference")
    reports = probe.listen(DiagnosticArray, "/diagnostics")
    process = subprocess.Popen(
        [sys.executable, "-m", "pam_control.controller_node", "--ros-args",
         "--params-file", str(ELBOW), "-r", "__node:=left_controller", "-r", "__ns:=/robot1",
         "-r", "joint_states:=/arm/joint_states", "-p", "loop.stale_after:=0.25"],
        env=os.environ | ros_environment | {"ROS_LOG_DIR": str(tmp_path)},
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        wait = 60.0 * patience
        angles = probe.publisher(JointState, "/arm/joint_states", wait)
        pressures = probe.publisher(JointState, "/robot1/pressure_states", wait)

        def controls() -> bool:
            assert process.poll() is None
            angles.publish(JointState(name=["elbow"], position=[0.0]))
            pressures.publish(JointState(name=MUSCLES, effort=[2e5, 2e5]))
            return bool(commands and references and reports)

        probe.wait_for("commands and a reference", controls, wait)
        nodes = probe.node.get_node_names_and_namespaces()
        assert nodes.count(("left_controller", "/robot1")) == 1
        assert not [name for name, _ in nodes if "pam_controller" in name]
        names = {status.name for message in reports for status in message.status}
        assert "robot1/left_controller: loop" in names
    finally:
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=20.0 * patience)
    assert process.returncode == 0, errors
