"""A first look (`diagnose --quick`) ranks what is hidden first, and states no verdict."""

import json
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from pam_gap.__main__ import main
from pam_gap.diagnose_recordings import prepared_subject
from pam_gap.first_look import FILE, first_look
from pam_model.plant.compiled import HAVE_NUMBA
from pam_model.rig import Rig, save_rig

from .conftest import Maker

needs_numba = pytest.mark.skipif(not HAVE_NUMBA, reason="many simulations need the compiled plant")


@pytest.mark.sampled("one of the four effects", cases=1)
@needs_numba
@pytest.mark.parametrize(
    ("changes", "stage"),
    [
        ({"leakage.conductance": 8e-11}, "valve"),
        ({"valve_dead_zone.overlap": 0.06}, "valve"),
        ({"viscous_friction.extra": 0.8}, "joint"),
        ({"payload.mass": 0.5, "payload.distance": 0.3}, "joint"),
    ],
)
def test_the_hidden_effect_comes_first(
    rig: Rig, record: Maker, changes: dict[str, float], stage: str
) -> None:
    look = first_look(prepared_subject(rig, rig.joint_names[0], [record(changes)]))
    (hidden,) = {name.split(".")[0] for name in changes}
    assert look.effects[0].effect == hidden
    assert look.effects[0].removes > 0.5
    assert look.stage == stage
    assert hidden.replace("_", " ") in look.text()
    assert "no verdict" in look.text()


@needs_numba
def test_what_the_tolerance_explains_is_ranked_among_no_effects(rig: Rig, record: Maker) -> None:
    recording = record({"agonist.valve.sonic_conductance": 1.01 * 4.0e-9})
    look = first_look(
        prepared_subject(replace(rig, parameter_tolerance=0.02), rig.joint_names[0], [recording])
    )
    assert look.effects == ()
    assert "too small to matter" in look.text()


def test_a_recording_that_is_too_short_says_what_is_missing(rig: Rig, record: Maker) -> None:
    look = first_look(prepared_subject(rig, rig.joint_names[0], [record(duration=4.0)]))
    assert look.missing
    assert look.effects == ()
    assert look.missing[0] in look.text()


@needs_numba
def test_the_command_writes_the_first_look_and_no_diagnosis(
    rig: Rig, record: Maker, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = record({"leakage.conductance": 8e-11})
    table, out = tmp_path / "recording.csv.gz", tmp_path / "out"
    pd.DataFrame({"time": recording.time, **recording.values}).to_csv(table, index=False)
    save_rig(rig, tmp_path / "rig.yaml")
    given = ["diagnose", str(table), "--rig", str(tmp_path / "rig.yaml"), "--out", str(out)]
    assert main([*given, "--quick", "--no-progress"]) == 0
    assert [path.name for path in out.iterdir()] == [FILE]
    document = json.loads((out / FILE).read_text())
    assert document["effects"][0]["effect"] == "leakage"
    assert not {"verdict", "probabilities"} & set(document)
    assert "leakage" in capsys.readouterr().out
