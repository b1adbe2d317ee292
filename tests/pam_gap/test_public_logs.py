"""Public logs are read from clones as their origins wrote them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pam_model.errors import PamError
from pam_model.rig import load_rig

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import public_logs
import real_recordings


def test_the_arm_is_read_block_by_block(tmp_path: Path) -> None:
    path = tmp_path / public_logs.ARM
    path.parent.mkdir(parents=True)
    blocks = np.arange(7.0)[:, None] + 0.01 * np.arange(5)
    path.write_text("\n".join(map(str, [1, 10, 5, *blocks.ravel()])))
    table = public_logs.arm_table(tmp_path)
    assert table["position"].tolist() == pytest.approx(blocks[6])
    channels = public_logs.as_channels(table, "j", ("a", "b"), -1.0)
    assert channels["joint_states.j.position"].tolist() == pytest.approx(-blocks[6])
    assert channels["valve_commands.a"].tolist() == pytest.approx(public_logs.ARM_UNIT * blocks[2])
    assert channels["pressure_states.b"].tolist() == pytest.approx(public_logs.ARM_UNIT * blocks[5])


@pytest.mark.parametrize("read", [public_logs.arm_table, lambda c: public_logs.held_muscle(c, c)])
def test_a_clone_that_is_missing_is_named(tmp_path: Path, read) -> None:
    with pytest.raises(PamError, match=r"expected a clone of (Pamy_OCO|Muscle_Sensory)"):
        read(tmp_path)


def test_a_polynomial_predicts_what_is_one_and_misses_what_is_none() -> None:
    pressure, length = np.meshgrid(np.linspace(1e5, 6e5, 20), [0.15, 0.14, 0.13])
    points = pd.DataFrame({"pressure": pressure.ravel(), "length": length.ravel()})
    points["block"] = np.arange(len(points)) % 3
    contraction = 1.0 - points["length"] / 0.15
    points["force"] = 1e-3 * points["pressure"] * (1.0 - 3.0 * contraction)
    assert public_logs.polynomial_error(points, 0.15) < 1e-6
    points["force"] += 5.0 * np.sin(points["pressure"] / 2e4)
    assert 2.0 < public_logs.polynomial_error(points, 0.15) < 8.0


def test_the_rig_file_of_the_bench_is_one(tmp_path: Path) -> None:
    rig = load_rig(public_logs.bench_rig(tmp_path / "rig.yaml", 0.182, "pressure_regulator"))
    assert rig.muscles[0].rest_length == pytest.approx(0.182)


def test_each_subfolder_with_a_rig_file_and_tables_is_a_case(tmp_path: Path) -> None:
    for name, files in {
        "a": ("rig.yaml", "log.csv"),
        "b": ("rig.yaml",),
        "c": ("log.csv",),
    }.items():
        (tmp_path / name).mkdir()
        for file in files:
            (tmp_path / name / file).write_text("")
    assert [case.name for case in real_recordings.of_folder(tmp_path)] == ["a"]
