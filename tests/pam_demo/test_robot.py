"""The simulated robot for nodes of one's own: runs until a signal, and passes warnings on."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from types import SimpleNamespace

import pytest

from pam_demo.robot import _pass_on
from support.rigs import ELBOW


def test_every_warning_of_a_node_is_passed_on_once(capsys):
    """The controller stopped on a slow host, and the terminal said nothing."""
    process = SimpleNamespace(output="[INFO] gains\n[ERROR] stopped")
    chain, said = SimpleNamespace(processes={"controller": process}), {}
    _pass_on(chain, said)
    process.output += "\n[WARN] rejected"
    _pass_on(chain, said)
    _pass_on(chain, said)
    assert capsys.readouterr().out == "controller: [ERROR] stopped\ncontroller: [WARN] rejected\n"


@pytest.mark.system
def test_the_robot_is_ready_to_move_and_ends_at_a_signal(tmp_path, ros_environment):
    words = [sys.executable, "-m", "pam_demo", "robot", "--rig", str(ELBOW), "--out", str(tmp_path)]
    environment = {**os.environ, **ros_environment, "PYTHONUNBUFFERED": "1"}
    robot = subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, text=True)
    assert robot.stdout
    assert "starting" in robot.stdout.readline()
    assert robot.stdout.readline() == "elbow: ready to move; Ctrl-C ends it\n"
    robot.send_signal(signal.SIGTERM)
    robot.communicate(timeout=60.0)
    assert robot.returncode == 0
    assert {path.stem for path in tmp_path.iterdir()} == {"rig", "robot"}
    assert "active: valves follow" in (tmp_path / "robot.log").read_text()
