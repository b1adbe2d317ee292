"""A package that only pip can install may be missing: what needs it says so in one line."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from pam_ros.missing_packages import NEEDED_FOR, what_to_install
from support.source_tree import ROOT

from .test_dependencies import INDEX_NAMES, OPTIONAL

TYPES = get_typestore(Stores.ROS2_JAZZY)
ELBOW = ROOT / "config/elbow.yaml"
# a package of ours and its command line
COMMAND = """
import importlib, sys
package, *words = sys.argv[1:]
sys.exit(importlib.import_module(f"{package}.__main__").main(words))
"""
# at the start of each Python, also of those that a node starts: names that cannot be imported
WITHOUT = "import sys\nsys.modules.update(dict.fromkeys({names!r}))\n"
ZST = b"\x28\xb5\x2f\xfd"  # the first bytes of a file that zstd has packed
ROS = "rclpy,rosidl_parser,sensor_msgs,std_msgs,diagnostic_msgs"
NODE = ["--ros-args", "--params-file", str(ELBOW)]


def run(
    missing: str, package: str, *words: object, cache: Path
) -> subprocess.CompletedProcess[str]:
    start = WITHOUT.format(names=missing.split(","))
    (cache / "sitecustomize.py").write_text(start, encoding="utf-8")
    return subprocess.run(
        [sys.executable, "-c", COMMAND, package, *map(str, words)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env={"PATH": "/usr/bin:/bin", "HOME": str(cache), "PYTHONPATH": str(cache),
             "ROS_DOMAIN_ID": "87", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
    )  # fmt: skip


@pytest.fixture
def bag(tmp_path):
    folder = tmp_path / "bag"
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=TYPES)
    return folder


@pytest.mark.sampled(
    "one command for each package that may be missing",
    alike=lambda missing, package, words: missing,
)
@pytest.mark.parametrize(
    ("missing", "package", "words"),
    [
        ("cantools", "pam_driver", ["check-rig", ELBOW]),
        ("cantools", "pam_driver", ["node", *NODE]),
        ("canopen", "pam_driver", ["check-rig", ROOT / "config/elbow_canopen.yaml"]),
        ("control", "pam_control", ["node", *NODE]),
        ("rosbags", "pam_gap", ["diagnose", "BAG", "--rig", ELBOW, "--out", "OUT"]),
        ("backports", "pam_gap", ["import", "PACKED", "--rig", ELBOW, "--out", "OUT"]),
        ("gymnasium", "pam_check", ["trained-policy"]),
        ("pyarrow", "pam_gap", ["import", "PARQUET", "--rig", ELBOW, "--out", "OUT"]),
        (ROS, "pam_gap", ["monitor"]),
        (ROS, "pam_driver", ["node"]),
        (ROS, "pam_gap", ["record", "--rig", ELBOW, "--out", "OUT"]),
    ],
)
def test_a_missing_package_is_one_line_that_says_what_to_install(
    missing, package, words, bag, tmp_path
):
    places = {"BAG": bag, "OUT": tmp_path / "out"}
    for word, name, start in (("PACKED", "a.csv.zst", ZST), ("PARQUET", "a.parquet", b"PAR1")):
        places[word] = tmp_path / name
        places[word].write_bytes(start)
    ended = run(missing, package, *(places.get(str(w), w) for w in words), cache=tmp_path)
    said = [line for line in ended.stderr.splitlines() if not line.startswith("[INFO]")]
    assert (ended.returncode, len(said)) == (2, 1), ended.stderr
    name = missing.partition(",")[0]
    assert f"the Python package {name} is not installed" in said[0]
    assert NEEDED_FOR[name][1] in said[0]


def test_a_driver_of_other_boards_needs_no_canopen(tmp_path):
    ended = run("canopen", "pam_driver", "check-rig", ELBOW, cache=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_a_table_is_diagnosed_and_shown_without_bags_figures_or_ros(tmp_path):
    log = tmp_path / "log.csv"
    rows = [f"{0.01 * i:.2f},0,0,100000,100000,0.0" for i in range(400)]
    muscles = ("elbow_flexor", "elbow_extensor")
    names = [f"{topic}.{m}" for topic in ("valve_commands", "pressure_states") for m in muscles]
    head = ",".join(["time", *names, "joint_states.elbow.position"])
    log.write_text("\n".join([head, *rows]))
    missing = f"rosbags,bokeh,backports,{ROS}"
    words = ["diagnose", log, "--rig", ELBOW, "--out", tmp_path / "out"]
    ended = run(missing, "pam_gap", *words, cache=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, ""), ended.stderr
    words = ["import", log, "--rig", ELBOW, "--out", tmp_path / "preview"]
    ended = run(missing, "pam_gap", *words, cache=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, ""), ended.stderr
    (page,) = (tmp_path / "preview").glob("*.html")
    assert "There are no plots here: the Python package bokeh is not installed" in page.read_text()


def test_every_optional_package_is_explained_once():
    """The others tell their users where they are imported; numba is replaced by plain Python."""
    assert OPTIONAL - {"numba", "dask", "distributed", "rerun"} == NEEDED_FOR.keys() - {"rclpy"}
    for name, (_, remedy) in NEEDED_FOR.items():
        if name != "rclpy":
            assert remedy == f"pip install {INDEX_NAMES.get(name, name)}"


def test_a_fault_of_the_program_is_no_missing_package():
    assert what_to_install(ModuleNotFoundError("No module named 'pam_x'", name="pam_x")) is None
    assert (
        what_to_install(ImportError("cannot import name 'x' from 'rosbags'", name="rosbags"))
        is None
    )
