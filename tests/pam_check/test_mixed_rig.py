"""A rig with flow valves at one joint and pressure regulators at the other, through every tool."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

from pam_check.faults.campaign import make_chain
from pam_check.faults.chain import FaultChain
from pam_check.faults.host_faults import INJECTIONS
from pam_driver.safety.states import SafetyState
from pam_gap.diagnosis_files import diagnose_files
from pam_gap.live.live_gap import LiveWindow
from pam_gap.prediction.problem import PredictionProblem
from pam_gap.recordings.import_recording import import_recording
from pam_gap.recordings.recording import COMMANDS, JOINTS, PRESSURES
from pam_model.rig import Rig, load_rig
from pam_ros.valve_command import ValveCommandFormat
from support.mixed_rig import TWO_JOINTS, Heard, drive, write_bag

SPOOLS = ("shoulder_flexor", "shoulder_extensor")
REGULATORS = ("elbow_flexor", "elbow_extensor")


@pytest.fixture(scope="module")
def mixed() -> Rig:
    return load_rig(TWO_JOINTS)


@pytest.fixture(scope="module")
def chain(mixed: Rig) -> FaultChain:
    return make_chain(mixed)


@pytest.fixture(scope="module")
def heard(chain: FaultChain) -> list[Heard]:
    return drive(chain, 8.0)


def test_driver_and_controller_move_both_joints(chain: FaultChain, heard: list[Heard]) -> None:
    assert chain.driver.state is SafetyState.ACTIVE
    assert not chain.driver.intake.rejected
    positions = np.array([entry.topics["joint_states"][1] for entry in heard])
    assert (np.ptp(positions, axis=0) > 0.5).all()


def test_both_kinds_of_command_are_imported(heard: list[Heard], mixed: Rig, tmp_path: Path) -> None:
    recording = import_recording(write_bag(tmp_path / "bag", heard))
    commands = {m: recording.values[f"{COMMANDS}{m}"] for m in mixed.muscle_names}
    for muscle in SPOOLS:
        assert np.abs(commands[muscle]).max() <= 1.0
    for muscle in REGULATORS:
        assert commands[muscle].max() > 1e5
        pressure = recording.values[f"{PRESSURES}{muscle}"]
        assert np.corrcoef(commands[muscle], pressure)[0, 1] > 0.9
    for joint in range(2):
        problem = PredictionProblem(mixed, joint, [recording])
        assert problem.has_commands


@pytest.mark.sampled("one of the two joints", cases=1)
@pytest.mark.parametrize("joint", ["shoulder", "elbow"])
def test_a_joint_on_either_kind_of_valve_is_diagnosed(
    heard: list[Heard], tmp_path: Path, joint: str
) -> None:
    """The valve stage is judged; four seconds are too short to ask for the right answer."""
    bag = write_bag(tmp_path / "bag", heard[-2000:])
    (found,) = diagnose_files([bag], TWO_JOINTS, tmp_path / "out", joint=joint, show_progress=False)
    assert found.joint == joint
    assert not [note for note in found.left_out if "valve" in note]
    assert found.location is not None
    gaps = {stage.stage: stage.gap_over_floor for stage in found.location.stages}
    assert gaps["valve"] is not None


def valve_stages(rig: Rig, heard: list[Heard]) -> dict[str, float]:
    """Joint -> gap of the valve stage over its noise, as the monitor sees the last seconds."""
    window, form = LiveWindow(rig, 5.0), ValveCommandFormat(rig.valve_kinds)
    for entry in heard:
        names, position, _, effort = entry.topics["sent_valve_commands"]
        commands = form.known(names, position, effort)
        window.take(COMMANDS, entry.time, [*commands], [*commands.values()])
        window.take(PRESSURES, entry.time, names, entry.topics["pressure_states"][3])
        joints, angles, *_ = entry.topics["joint_states"]
        window.take(JOINTS, entry.time, joints, angles)
    found = {}
    for joint in range(len(rig.joints)):
        gap = window.gap(joint)
        assert not gap.problem
        assert gap.stages is not None
        found[gap.joint] = gap.stages["valve"]
    return found


def test_the_gap_of_both_joints_is_watched_up_to_the_valve(heard: list[Heard], mixed: Rig) -> None:
    ratios = valve_stages(mixed, heard)
    assert set(ratios) == {"shoulder", "elbow"}
    assert max(ratios.values()) < 5.0


@pytest.mark.parametrize(
    ("name", "refused"),
    [
        ("command_nan", "not_finite"),
        ("command_out_of_range", "out_of_range"),
        ("command_wrong_size", "size"),
    ],
)
def test_command_faults_are_brought_about_on_both_kinds_of_valve(
    chain: FaultChain, name: str, refused: str
) -> None:
    before = sum(chain.driver.intake.rejected.values())
    INJECTIONS[name](chain, {"duration": 0.05, "share": 1.0}, random.Random(1))
    # longer than the fault, which is shorter than a command may be old
    drive(chain, 0.06)
    assert sum(chain.driver.intake.rejected.values()) - before == 25
    assert chain.driver.intake.rejected[refused] == 25
    assert chain.driver.state is SafetyState.ACTIVE


def test_two_publishers_are_noticed_on_both_kinds_of_valve(chain: FaultChain) -> None:
    INJECTIONS["command_two_publishers"](chain, {"duration": 0.05, "share": 1.0}, random.Random(1))
    drive(chain, 0.06)
    assert chain.driver.state is SafetyState.FAULT_LOWERING
    assert [fault.kind for fault in chain.driver.faults] == ["two_publishers"]


@pytest.mark.sampled("one of the two kinds of valve", cases=1)
@pytest.mark.parametrize(
    ("joint", "effect", "value"),
    [("shoulder", "leakage.conductance", 6e-10), ("elbow", "valve_lag.extra_time_constant", 0.03)],
)
def test_an_effect_on_the_valves_of_either_kind_shows_at_their_joint(
    chain: FaultChain, mixed: Rig, joint: str, effect: str, value: float
) -> None:
    hidden = {f"{muscle}.{effect}": value for muscle in mixed.joint(joint).muscles}
    # with the gains that are there already: to design them takes longer than this test
    lagging = FaultChain(mixed, chain.controller, effects=hidden)
    lagging.start()
    ratios = valve_stages(mixed, drive(lagging, 5.5))
    assert ratios.pop(joint) > 10.0
    assert max(ratios.values()) < 5.0
