"""A joint pushed from outside: friction holds it as it holds against its own muscles."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.recording import SHUT, Recording
from pam_model.plant.parameters import INDEX
from pam_model.rig import Rig

ROOT = Path(__file__).parents[2]
FRICTION = 0.8  # N m


def pushed(rig: Rig, torque: float) -> Recording:
    """Two seconds of a resting joint with shut valves, pushed harder and harder up to `torque`."""
    time = np.arange(1000) * 0.002
    joint = rig.joints[0]
    noise = np.random.default_rng(3).standard_normal((time.size, 3))
    values = {
        f"pressure_states.{joint.agonist}": 2e5 + 100.0 * noise[:, 0],
        f"pressure_states.{joint.antagonist}": 2e5 + 100.0 * noise[:, 1],
        f"joint_states.{joint.name}.position": 1e-4 * noise[:, 2],
        f"joint_states.{joint.name}.effort": torque * time / time[-1],
    }
    valid = {name: np.ones(time.size, dtype=np.bool_) for name in values}
    return Recording(Path("pushed"), 0.002, time, values, valid, (), mounting=SHUT)


@pytest.mark.parametrize(("share", "moves"), [(0.9, False), (3.0, True)])
def test_a_push_moves_the_joint_only_beyond_dry_friction(
    rig: Rig, share: float, moves: bool
) -> None:
    level = replace(rig, joints=(replace(rig.joints[0], gravity_torque=0.0),))
    problem = PredictionProblem(level, 0, [pushed(level, share * FRICTION)])
    values = problem.base.values.copy()
    values[INDEX["coulomb_friction.torque"]] = FRICTION
    error = problem.errors(values[None])[0][:, 2] * problem.data[0].block_deviation[2]
    assert (float(np.abs(error[-20:]).mean()) > 0.01) == moves


@pytest.mark.long(
    "test_measured_guards fits the hysteresis of the same recording without the search"
)
def test_hysteresis_is_found_in_the_measured_pair(tmp_path: Path) -> None:
    script = ROOT / "benchmarks" / "measured_pair.py"
    subprocess.run([sys.executable, script, "--out", tmp_path], check=True, capture_output=True)
    answer = json.loads((tmp_path / "diagnosis.json").read_text())
    # At one pressure all that opposes the motion looks alike; whether hysteresis or dry friction
    # leads is a toss-up.
    alike = {"hysteresis", "coulomb_friction", "stribeck_friction", "viscous_friction"}
    assert "hysteresis" in answer["effects"]
    assert set(answer["effects"]) <= alike
    assert answer["verdict"] == ("named" if answer["effects"] == ["hysteresis"] else "ambiguous")
