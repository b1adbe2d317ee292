"""What keeps ROS from starting is told in one line, by nodes and by commands."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
ELBOW = str(Path(__file__).parents[2] / "config" / "elbow.yaml")
STARTS = {
    "model": ("pam_model.model_node", "--ros-args", "--params-file", ELBOW),
    "driver": ("pam_driver.driver_node", "--ros-args", "--params-file", ELBOW),
    "record": ("pam_gap", "record", "--rig", ELBOW, "--out", "bag"),
}


@pytest.mark.parametrize(
    ("variable", "value", "told"),
    [
        ("ROS_DOMAIN_ID", "kitchen", "ROS_DOMAIN_ID is not an integral number"),
        ("ROS_LOG_DIR", "/dev/null/log", "set ROS_LOG_DIR to a folder that can be written"),
    ],
)
@pytest.mark.parametrize("start", STARTS)
def test_an_environment_that_ros_cannot_use_is_one_line(start, variable, value, told, tmp_path):
    ended = subprocess.run(
        [sys.executable, "-m", *STARTS[start]],
        check=False,
        env={**os.environ, variable: value},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert ended.returncode == 2
    (line,) = ended.stderr.splitlines()
    assert line.startswith("error: ROS does not start: ")
    assert told in line
    assert list(tmp_path.iterdir()) == []
