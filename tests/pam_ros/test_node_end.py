"""When `main` of a node returns, no thread of the middleware is alive any more.

The process could end with a segmentation fault otherwise: Fast DDS frees its static objects while
the threads of a participant that nobody has deleted still use them.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from pam_demo.chain import private_domain
from support.source_tree import ROOT

ELBOW = ROOT / "config/elbow.yaml"
BUS = ["-p", "bus.interface:=udp_multicast", "-p", "bus.channel:=239.74.163.9"]
NODES = {
    "pam_driver.driver_node": BUS,
    "pam_sim.rig_node": BUS,
    "pam_control.controller_node": [],
    "pam_model.model_node": [],
    "pam_gap.live.monitor_node": [],
    "pam_bringup.viewer.markers_node": [],
}

# The node is asked to end once its participant is alive, by the same signal as in a terminal.
ENDED = """
import contextlib, importlib, os, signal, sys, threading, time
from pathlib import Path

def middleware():
    names = []
    for task in Path("/proc/self/task").iterdir():
        with contextlib.suppress(OSError):  # it has just ended
            names.append((task / "comm").read_text().strip())
    return sorted(name for name in names if name.startswith("dds."))

def end():
    while not middleware():
        time.sleep(0.05)
    time.sleep(1.0)
    print("while it ran:", *middleware(), flush=True)
    os.kill(os.getpid(), signal.SIGINT)

main = importlib.import_module(sys.argv[1]).main
threading.Thread(target=end, daemon=True).start()
code = main(sys.argv[2:])
print("afterwards:", *middleware(), flush=True)
sys.exit(code)
"""


def ended(words: list[str], folder: Path) -> tuple[int, dict[str, list[str]]]:
    """Run a node until it has ended; its exit code, and the middleware's threads by time."""
    process = subprocess.run(
        [sys.executable, "-c", ENDED, *words],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        cwd=folder,
        env=os.environ | private_domain() | {"ROS_LOG_DIR": str(folder)},
    )
    lines = [line.partition(":") for line in process.stdout.splitlines()]
    assert "afterwards" in process.stdout, process.stderr
    return process.returncode, {key: names.split() for key, _, names in lines}


def command_line(node: str, *more: str) -> list[str]:
    return [node, "--ros-args", "--params-file", str(ELBOW), *NODES[node], *more]


@pytest.mark.sampled("one of the nodes, which one function runs", cases=1)
@pytest.mark.system
@pytest.mark.parametrize("node", NODES)
def test_the_threads_of_the_middleware_end_with_the_node(node: str, tmp_path: Path) -> None:
    code, threads = ended(command_line(node), tmp_path)
    assert code == 0
    assert threads["while it ran"]
    assert threads["afterwards"] == []


@pytest.mark.sampled("one of the nodes, which one function runs", cases=1)
@pytest.mark.system
@pytest.mark.parametrize("node", NODES)
def test_they_end_too_where_a_mistake_keeps_the_node_from_being_made(
    node: str, tmp_path: Path
) -> None:
    code, threads = ended(command_line(node, "-p", "no_such_parameter:=1"), tmp_path)
    assert code == 2
    assert threads["afterwards"] == []
