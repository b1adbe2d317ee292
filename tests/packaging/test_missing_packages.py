"""A package that only pip can install may be missing: what needs it says so in one line."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from pam_ros.missing_packages import NEEDED_FOR, what_to_install
from support.source_tree import ROOT

from .test_dependencies import INDEX_NAMES, OPTIONAL

TYPES = get_typestore(Stores.ROS2_JAZZY)
ELBOW = ROOT / "config/elbow.yaml"
# command lines, each with its package of ours
COMMANDS = """
import importlib, json, sys
for package, *words in map(json.loads, sys.argv[1:]):
    code = importlib.import_module(f"{package}.__main__").main(words)
    print("ended with", code, file=sys.stderr, flush=True)
sys.exit(code)
"""
# at the start of each Python, also of those that a node starts: names that cannot be imported
WITHOUT = "import sys\nsys.modules.update(dict.fromkeys({names!r}))\n"
ZST = b"\x28\xb5\x2f\xfd"  # the first bytes of a file that zstd has packed
ROS = "rclpy,rosidl_parser,sensor_msgs,std_msgs,diagnostic_msgs"
NODE = ["--ros-args", "--params-file", str(ELBOW)]


def run(missing: str, *commands: Sequence[object], cache: Path) -> list[str]:
    """What commands say, one after the other in one process; the last word is the exit code."""
    start = WITHOUT.format(names=missing.split(","))
    (cache / "sitecustomize.py").write_text(start, encoding="utf-8")
    ended = subprocess.run(
        [sys.executable, "-c", COMMANDS, *(json.dumps([*map(str, words)]) for words in commands)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env={"PATH": "/usr/bin:/bin", "HOME": str(cache), "PYTHONPATH": str(cache),
             "ROS_DOMAIN_ID": "87", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
    )  # fmt: skip
    lines = [line for line in ended.stderr.splitlines() if not line.startswith("[INFO]")]
    said = re.split(r"(?<=ended with \d)\n", "\n".join(lines))
    assert len(said) == len(commands), ended.stderr
    return said


@pytest.fixture
def places(tmp_path: Path) -> dict[str, Path]:
    """The files that commands are given."""
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=TYPES)
    (tmp_path / "a.csv.zst").write_bytes(ZST)
    (tmp_path / "a.parquet").write_bytes(b"PAR1")
    names = {"BAG": "bag", "OUT": "out", "PACKED": "a.csv.zst", "PARQUET": "a.parquet"}
    return {word: tmp_path / name for word, name in names.items()}


COMMANDS_WITHOUT = [
    ("cantools", "pam_driver", "check-rig", ELBOW),
    ("rosbags", "pam_gap", "diagnose", "BAG", "--rig", ELBOW, "--out", "OUT"),
    ("backports", "pam_gap", "import", "PACKED", "--rig", ELBOW, "--out", "OUT"),
    ("gymnasium", "pam_check", "trained-policy"),
    ("pyarrow", "pam_gap", "import", "PARQUET", "--rig", ELBOW, "--out", "OUT"),
    (ROS, "pam_gap", "monitor"),
    (ROS, "pam_driver", "node"),
    (ROS, "pam_gap", "record", "--rig", ELBOW, "--out", "OUT"),
]
"""What is missing, and a command that needs it."""
WITH_ROS = [("cantools", "pam_driver", "node", *NODE), ("control", "pam_control", "node", *NODE)]
ONE_BY_ONE = pytest.mark.long(
    "the same commands say the same in one process, where everything is missing"
)


def check_sentence(missing: str, said: str) -> None:
    name = missing.partition(",")[0]
    line, *end = said.splitlines()
    assert end == ["ended with 2"], said
    assert f"the Python package {name} is not installed" in line
    assert NEEDED_FOR[name][1] in line


def test_each_command_names_the_package_that_it_needs_where_all_are_missing(places, tmp_path):
    commands = [[places.get(w, w) for w in map(str, words)] for _, *words in COMMANDS_WITHOUT]
    everything = ",".join(dict.fromkeys(missing for missing, *_ in COMMANDS_WITHOUT))
    said = run(everything, *commands, cache=tmp_path)
    for (missing, *_), text in zip(COMMANDS_WITHOUT, said, strict=True):
        check_sentence(missing, text)


@pytest.mark.parametrize(
    ("missing", "words"),
    [
        pytest.param(missing, words, marks=() if missing == "control" else ONE_BY_ONE)
        for missing, *words in (*WITH_ROS, *COMMANDS_WITHOUT)
    ],
)
def test_a_missing_package_is_one_line_that_says_what_to_install(missing, words, places, tmp_path):
    (said,) = run(missing, [places.get(w, w) for w in map(str, words)], cache=tmp_path)
    check_sentence(missing, said)


def test_only_the_driver_of_canopen_devices_needs_canopen(tmp_path):
    rigs = ELBOW, ROOT / "config/elbow_canopen.yaml"
    said = run("canopen", *(["pam_driver", "check-rig", rig] for rig in rigs), cache=tmp_path)
    assert said[0] == "ended with 0"
    check_sentence("canopen", said[1])


def test_a_table_is_diagnosed_and_shown_without_bags_figures_or_ros(tmp_path):
    log = tmp_path / "log.csv"
    rows = [f"{0.01 * i:.2f},0,0,100000,100000,0.0" for i in range(400)]
    muscles = ("elbow_flexor", "elbow_extensor")
    names = [f"{topic}.{m}" for topic in ("valve_commands", "pressure_states") for m in muscles]
    head = ",".join(["time", *names, "joint_states.elbow.position"])
    log.write_text("\n".join([head, *rows]))
    missing = f"rosbags,bokeh,backports,{ROS}"
    ways = {"diagnose": tmp_path / "out", "import": tmp_path / "preview"}
    commands = [["pam_gap", way, log, "--rig", ELBOW, "--out", out] for way, out in ways.items()]
    assert run(missing, *commands, cache=tmp_path) == ["ended with 0"] * 2
    (page,) = ways["import"].glob("*.html")
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
