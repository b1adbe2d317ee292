"""No loop of the suite may wait for the shared memory of a node that appears."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pam_demo.chain import private_domain
from pam_ros.transport import PROFILE, leave_out_shared_memory

NAMES_OF_THREADS = """
import os, sys, rclpy
from pathlib import Path
from pam_ros.transport import leave_out_shared_memory
if sys.argv[1] == "as_a_node":
    leave_out_shared_memory()
rclpy.init(args=[])
node = rclpy.create_node("alone")
tasks = Path("/proc/self/task").iterdir()
print(*(task.joinpath("comm").read_text().strip() for task in tasks), flush=True)
os._exit(0)
"""
CLEAN = {
    name: value
    for name, value in os.environ.items()
    if not name.startswith(("FAST", "ROS_AUTOMATIC", "ROS_LOCALHOST", "ROS_STATIC", "RMW"))
}
RANGES = [{}, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, {"ROS_LOCALHOST_ONLY": "1"}]


def _threads(how: str, variables: dict[str, str]) -> str:
    environment = {**CLEAN, "ROS_DOMAIN_ID": private_domain()["ROS_DOMAIN_ID"], **variables}
    command = [sys.executable, "-c", NAMES_OF_THREADS, how]
    return subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=60, check=True
    ).stdout


@pytest.mark.parametrize("variables", RANGES, ids=["network", "localhost", "localhost_only"])
def test_a_node_opens_no_shared_memory_in_any_discovery_range(variables):
    threads = _threads("as_a_node", variables)
    assert "dds.udp" in threads
    assert "dds.shm" not in threads


def test_shared_memory_is_what_the_middleware_opens_by_itself():
    """Otherwise the test above could not fail."""
    assert "dds.shm" in _threads("as_it_is", {})


@pytest.mark.parametrize(
    "choice",
    [
        {"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"},
        {"FASTRTPS_DEFAULT_PROFILES_FILE": "/etc/robot/profiles.xml"},
        {"FASTDDS_DEFAULT_PROFILES_FILE": "/etc/robot/profiles.xml"},
        {"FASTDDS_BUILTIN_TRANSPORTS": "LARGE_DATA"},
        {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_STATIC_PEERS": "10.0.0.2"},
    ],
)
def test_a_choice_of_the_user_is_kept(choice):
    variables = dict(choice)
    assert not leave_out_shared_memory(variables)
    assert variables == choice


def test_a_process_that_inherits_the_variables_leaves_out_shared_memory_again():
    for first in RANGES:
        for then in RANGES:
            variables = dict(first)
            assert leave_out_shared_memory(variables)
            variables.update(then)
            assert leave_out_shared_memory(variables)
            localhost = bool(then)
            assert "LOCALHOST" not in variables.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
            if localhost:
                assert variables["FASTRTPS_DEFAULT_PROFILES_FILE"] == str(PROFILE)


def test_the_profile_is_installed_with_the_package():
    assert Path(PROFILE).is_file()
