"""The play node as a process, with a plant in place of driver and rig."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pam_gap.experiments.excitations import Excitation, Menu
from pam_gap.experiments.files import write_experiment
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import Plant
from pam_model.rig import load_rig

ELBOW = Path(__file__).parents[2] / "config" / "elbow.yaml"
MUSCLES = ["elbow_flexor", "elbow_extensor"]
PERIOD = 0.01


def short_excitation() -> Excitation:
    """The beginning of the vented swing, its valves opened at 1 s."""
    rig = load_rig(ELBOW)
    whole = next(e for e in Menu(rig, 0, 0.01).entries() if e.name == "vented_swing")
    cut = slice(0, 250)
    return replace(
        whole, time=whole.time[cut], position=whole.position[cut], level=whole.level[cut],
        difference=whole.difference[cut], open_from=2.0,
    )  # fmt: skip


@pytest.mark.system
@pytest.mark.parametrize("falls_silent", [False, True])
def test_plays_then_vents(
    probe: Any, ros_environment: dict[str, str], patience: float, tmp_path: Path, falls_silent: bool
) -> None:
    from sensor_msgs.msg import JointState

    excitation = short_excitation()
    write_experiment(tmp_path, load_rig(ELBOW), 0, excitation, {})
    heard = probe.listen(JointState, "valve_commands")
    node = subprocess.Popen(
        [sys.executable, "-m", "pam_gap.experiments.play_node",
         "--ros-args", "--params-file", str(ELBOW),
         "-p", f"experiment:={tmp_path}", "-p", "approach:=1.0", "-p", "max_age:=0.9"],
        env=os.environ | ros_environment, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    plant = Plant(PlantParameters.from_rig(load_rig(ELBOW)))
    seen = plant.step((0.0, 0.0), PERIOD)
    highest = 0.0
    try:
        positions = probe.publisher(JointState, "joint_states", 30.0 * patience)
        pressures = probe.publisher(JointState, "pressure_states", 30.0 * patience)
        deadline = time.monotonic() + 60.0 * patience
        last = time.monotonic()
        while node.poll() is None:
            assert time.monotonic() < deadline
            if not (falls_silent and highest > 1e5):
                positions.publish(JointState(name=["elbow"], position=[seen[0]]))
                pressures.publish(JointState(name=MUSCLES, effort=list(seen[1:])))
            time.sleep(PERIOD)
            now = time.monotonic()
            spools = tuple(heard[-1].position) if heard else (0.0, 0.0)
            seen = plant.step(spools, min(now - last, 0.1))
            highest, last = max(highest, *seen[1:]), now
    finally:
        if node.poll() is None:
            node.kill()
        _, errors = node.communicate(timeout=20.0 * patience)
    assert tuple(heard[-1].position) == (-1.0, -1.0)
    if falls_silent:
        assert node.returncode == 2
        assert "measurements are missing or too old" in errors
    else:
        assert node.returncode == 0, errors
        assert highest == pytest.approx(float(excitation.level[0]), rel=0.3)
