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
from pam_gap.experiments.loop import ExperimentLoop, holding_commands
from pam_model.plant.parameters import PlantParameters
from pam_model.plant.simulate import Plant
from pam_model.rig import load_rig
from pam_ros.valve_command import ValveCommandFormat
from support.mixed_rig import TWO_JOINTS
from support.reruns import HOST_STALLS

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


@pytest.mark.sampled("one of the two, as of those on a rig with one kind", cases=1)
@pytest.mark.system
@pytest.mark.parametrize("joint", ["shoulder", "elbow"])
def test_on_a_rig_with_both_kinds_of_valve_the_driver_takes_every_command(
    probe: Any, ros_environment: dict[str, str], patience: float, tmp_path: Path, joint: str
) -> None:
    """Also those for the muscles of the joint that does not play, which keep their air."""
    from sensor_msgs.msg import JointState

    rig = load_rig(TWO_JOINTS)
    number = rig.joint_names.index(joint)
    whole = next(e for e in Menu(rig, number, 0.01).entries() if e.name == "chirp")
    cut = slice(0, 50)
    short = replace(
        whole, time=whole.time[cut], position=whole.position[cut], level=whole.level[cut],
        difference=whole.difference[cut],
    )  # fmt: skip
    write_experiment(tmp_path, rig, number, short, {})
    heard = probe.listen(JointState, "valve_commands")
    measured = dict(zip(rig.muscle_names, (1.1e5, 1.2e5, 1.3e5, 1.4e5), strict=True))
    node = subprocess.Popen(
        [sys.executable, "-m", "pam_gap.experiments.play_node",
         "--ros-args", "--params-file", str(TWO_JOINTS), "-p", f"experiment:={tmp_path}",
         "-p", f"joint:={joint}", "-p", "approach:=1.0", "-p", "max_age:=0.9"],
        env=os.environ | ros_environment, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        positions = probe.publisher(JointState, "joint_states", 30.0 * patience)
        pressures = probe.publisher(JointState, "pressure_states", 30.0 * patience)
        deadline = time.monotonic() + 60.0 * patience
        while node.poll() is None:
            assert time.monotonic() < deadline
            positions.publish(JointState(name=rig.joint_names, position=[0.0, 0.0]))
            pressures.publish(JointState(name=[*measured], effort=[*measured.values()]))
            time.sleep(PERIOD)
    finally:
        if node.poll() is None:
            node.kill()
        _, errors = node.communicate(timeout=20.0 * patience)
    assert node.returncode == 0, errors
    form = ValveCommandFormat(rig.valve_kinds)
    taken = [form.unpack(m.name, m.position, m.velocity, m.effort) for m in heard]
    assert len(taken) > 100
    others = [i for i, m in enumerate(rig.muscle_names) if m not in rig.joints[number].muscles]
    for commands in taken:
        for i in others:
            assert commands[i] == (0.0 if joint == "elbow" else measured[rig.muscle_names[i]])
    own = [i for i in range(4) if i not in others]
    assert [taken[-1][i] for i in own] == [form.vented[i] for i in own]


def test_no_regulator_is_asked_for_more_than_its_full_scale() -> None:
    rig = load_rig(TWO_JOINTS)
    muscle = rig.muscle("elbow_flexor")
    weak = rig.with_muscle(replace(muscle, valve=replace(muscle.valve, full_scale=2e5)))
    excitation = next(e for e in Menu(weak, 1, 0.01).entries() if e.name == "co_contraction_sweep")
    loop = ExperimentLoop(weak, 1, excitation)
    asked = [loop.commands(time, 0.0, (0.0, 0.0))[0] for time in excitation.time.tolist()]
    assert max(asked) == 2e5
    held = holding_commands(weak, {"elbow_flexor": 2.004e5, "elbow_extensor": -300.0})
    assert held == [0.0, 0.0, 2e5, 0.0]


@pytest.mark.sampled("one of the two ends", cases=1)
@pytest.mark.system
@pytest.mark.rerun_because(HOST_STALLS)
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
