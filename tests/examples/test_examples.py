"""The scripts in examples/ run and give what they promise."""

from __future__ import annotations

import itertools
import os
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.rig import load_rig
from support.processes import end

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
ELBOW = str(ROOT / "config/elbow.yaml")


def example(name: str) -> dict[str, Any]:
    """The names that a script defines; its part for the command line does not run."""
    return runpy.run_path(str(EXAMPLES / f"{name}.py"))


def test_every_script_is_on_the_page_and_tested_here():
    here, page = Path(__file__).read_text(), (ROOT / "docs/python.md").read_text()
    names = [path.stem for path in EXAMPLES.glob("*.py")]
    assert len(names) == 7
    for name in names:
        assert f'("{name}")' in here or f'"{name}.py"' in here
        assert f"examples/{name}.py)" in page


def test_muscle_curves(tmp_path):
    assert example("muscle_curves")["main"](tmp_path).stat().st_size > 10_000


def test_fit_my_csv_prefers_the_model_that_made_the_points(tmp_path):
    script = example("fit_my_csv")
    errors = script["main"](script["make_points"](tmp_path / "points.csv"))
    assert errors["tondu_lopez"] < 3.0  # the noise is 2 N
    assert errors["tondu_lopez"] < 0.3 * errors["chou_hannaford"]


def test_simulate_and_plot(tmp_path):
    assert 0.005 < example("simulate_and_plot")["main"](ELBOW, tmp_path) < 0.2
    assert (tmp_path / "dry_friction.png").exists()


def test_control_without_ros_reaches_the_angle():
    assert example("control_without_ros")["main"](ELBOW, 0.3) == pytest.approx(0.3, abs=2e-3)


@pytest.mark.long("test_diagnosis finds the same friction through the same functions")
@pytest.mark.skipif(not HAVE_NUMBA, reason="a whole search needs the compiled plant")
def test_diagnose_recording_finds_the_hidden_friction(tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    script = example("diagnose_recording")
    named = script["main"](script["make_recording"](tmp_path / "run.csv"), ELBOW, tmp_path)
    assert "coulomb_friction" in named
    improved = load_rig(tmp_path / "improved.yaml").joints[0].effects["coulomb_friction"]
    assert improved["torque"] == pytest.approx(0.6, rel=0.15)


def test_motion_for_diagnosis_uses_the_range_slowly_enough_and_begins_with_a_rest():
    """What `pam_gap record` asks for: rest, half of the range, 40 s."""
    points = example("motion_for_diagnosis")["waypoints"](0.6)
    times, positions = zip(*points, strict=True)
    steps = list(itertools.pairwise(points))
    assert points[0] == (3.0, 0.0)
    assert 40.0 < times[-1] < 60.0
    assert max(positions) - min(positions) > 0.9
    assert max(map(abs, positions)) <= 0.6
    assert all(b[0] > a[0] for a, b in steps)
    fastest = max(abs(b[1] - a[1]) / (b[0] - a[0]) for a, b in steps)
    assert fastest < 0.6 * min(joint.max_velocity for joint in load_rig(ELBOW).joints)


@pytest.mark.system
def test_sinusoid_node_streams_a_sine_from_where_the_joint_is(probe, ros_environment):
    from sensor_msgs.msg import JointState

    process = subprocess.Popen(
        [sys.executable, str(EXAMPLES / "sinusoid_node.py"), "knee"],
        env={**os.environ, **ros_environment},
    )
    try:
        commands = probe.listen(JointState, "pam_controller/commands")
        states = probe.publisher(JointState, "joint_states", 60.0)
        states.publish(JointState(name=["ankle"], position=[9.0]))
        states.publish(JointState(name=["ankle", "knee"], position=[9.0, 0.2]))
        probe.wait_for("100 commands", lambda: len(commands) > 100, 60.0)
    finally:
        end(process)
    assert all(list(message.name) == ["knee"] for message in commands)
    assert commands[0].position[0] == pytest.approx(0.2, abs=0.02)
    assert 0.25 < max(message.position[0] for message in commands) < 0.51
