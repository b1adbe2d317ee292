"""A recording of another robot than the rig file's is refused before any search, by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pam_gap import diagnose_recordings
from pam_gap.__main__ import main
from pam_model.errors import PamError
from pam_model.rig import Rig, save_rig

TIME = np.arange(0.0, 4.0, 0.004)
CHANNELS = {
    "valve_commands.elbow_flexor": 0.4 * np.sin(TIME),
    "valve_commands.elbow_extensor": -0.4 * np.sin(TIME),
    "pressure_states.elbow_flexor": 2e5 + 5e4 * np.sin(TIME),
    "pressure_states.elbow_extensor": 2e5 - 5e4 * np.sin(TIME),
    "joint_states.elbow.position": 0.2 * np.sin(TIME),
}


def renamed(old: str, new: str) -> dict[str, np.ndarray]:
    return {name.replace(old, new): values for name, values in CHANNELS.items()}


def with_commands(factor: float) -> dict[str, np.ndarray]:
    return {
        name: factor * values if name.startswith("valve") else values
        for name, values in CHANNELS.items()
    }


@pytest.fixture
def answer(rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys):
    """What `diagnose` says of channels beside a rig file; "searched" if it lets them in."""

    def no_search(*_: object, **__: object) -> None:
        raise PamError("searched")

    monkeypatch.setattr(diagnose_recordings, "JointDiagnosis", no_search)

    def ask(channels: Mapping[str, np.ndarray], kind: str = "flow") -> str:
        valves = [replace(m, valve=replace(m.valve, kind=kind)) for m in rig.muscles]
        changed = rig
        for muscle in valves:
            changed = changed.with_muscle(muscle)
        save_rig(changed, tmp_path / "rig.yaml")
        table = tmp_path / "recording.csv"
        pd.DataFrame({"time": TIME, **channels}).to_csv(table, index=False)
        arguments = ["--rig", str(tmp_path / "rig.yaml"), "--out", str(tmp_path / "out")]
        assert main(["diagnose", str(table), *arguments]) == 2
        return str(capsys.readouterr().err)

    return ask


@pytest.mark.parametrize(
    ("channels", "told"),
    [
        (renamed("joint_states.elbow", "joint_states.wrist"),
         ("joint_states.elbow is not recorded", "joint_states.wrist")),
        (renamed("valve_commands.elbow_flexor", "valve_commands.wrist_flexor"),
         ("valve_commands.elbow_flexor is not", "valve_commands.wrist_flexor")),
        (renamed("elbow", "wrist"),
         ("expected elbow_flexor and elbow_extensor", "wrist_extensor, wrist_flexor")),
        (CHANNELS | {"muscle_states.bench.effort": 100.0 + TIME},
         ("muscle_states.elbow_flexor, elbow_extensor is not", "muscle_states.bench")),
        (with_commands(1e5),
         ("valve_commands.elbow_flexor", "valve_commands.elbow_extensor", "Pa", "flow valve")),
    ],
)  # fmt: skip
def test_names_that_differ_are_told_before_the_search(answer, channels, told) -> None:
    said = answer(channels)
    assert all("recording.csv" in line for line in said.splitlines())
    for text in told:
        assert text in said


def test_spool_openings_are_no_commands_of_a_regulator(answer) -> None:
    line = answer(CHANNELS, "pressure_regulator")
    assert "spool opening" in line
    assert "elbow_flexor.valve.kind" in line
    assert "searched" in answer(with_commands(1e5), "pressure_regulator")


def test_what_is_missing_or_of_other_joints_as_well_is_let_in(answer) -> None:
    assert "searched" in answer(CHANNELS)
    without = {n: v for n, v in CHANNELS.items() if not n.startswith(("joint", "valve"))}
    assert "searched" in answer(without)
    assert "searched" in answer(CHANNELS | {"joint_states.wrist.position": TIME})
