"""Logs of other programs: a map is proposed, shown before anything is fitted, or asked for."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from pam_gap.__main__ import main
from pam_gap.import_log.import_log import MAP, PAGE, TABLE, ask_about, import_log
from pam_gap.import_log.propose_map import Proposed, propose
from pam_gap.recordings.import_recording import import_recording
from pam_model.rig import Rig, load_rig

DATA = Path(__file__).parents[1] / "data" / "closed_pair"
TIME = np.arange(600) * 0.004
P1, P2 = (2e5 + s * 6e4 * np.sin(5.0 * TIME) for s in (1.0, -1.0))
ANGLE = 0.3 * np.sin(5.0 * TIME)
LOG = {
    "t_ms": 1e3 * TIME,
    "p1 [bar]": 1e-5 * P1,
    "p2 [bar]": 1e-5 * P2,
    "theta_deg": np.degrees(ANGLE),
    "u1": 0.2 * np.cos(5.0 * TIME),
    "u2": -0.2 * np.cos(5.0 * TIME),
    "battery": np.full(TIME.size, 24.0),
}


@pytest.fixture
def log(tmp_path: Path) -> Path:
    pd.DataFrame(LOG).to_csv(tmp_path / "log.csv", index=False)
    return tmp_path / "log.csv"


def test_a_map_is_proposed_shown_and_gives_the_recording(
    log: Path, rig: Rig, tmp_path: Path
) -> None:
    preview = import_log(log, rig, tmp_path / "out")
    assert not preview.problems
    recording = import_recording(tmp_path / "out" / TABLE)
    first, second = rig.joints[0].muscles
    for name, values in (
        (f"pressure_states.{first}", P1),
        (f"pressure_states.{second}", P2),
        ("joint_states.elbow.position", ANGLE),
        (f"valve_commands.{first}", LOG["u1"]),
    ):
        np.testing.assert_allclose(recording.values[name][1:-1], values[1:-1], rtol=0.03, atol=1e-3)
    page = (tmp_path / "out" / PAGE).read_text()
    for text in ("p1 [bar]", "× 100000", "battery", "260 kPa", "muscle_states", "Understood"):
        assert text in page
    again = import_log(log, rig, tmp_path / "again", map_path=tmp_path / "out" / MAP)
    assert again.column_map.channels == preview.column_map.channels


def test_a_log_is_imported_with_the_rough_rig_file_that_a_calibration_begins_with(
    log: Path, rig: Rig, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A map needs the names of the rig file and its kinds of valve, not its numbers."""
    tree = rig.to_parameters()
    del tree["elbow"]["inertia"]
    tree[rig.joints[0].muscles[0]]["valve"]["sonic_conductance"] = {"between": [1e-9, 1e-8]}
    rough = tmp_path / "rough.yaml"
    rough.write_text(yaml.safe_dump({"/**": {"ros__parameters": tree}}), encoding="utf-8")
    arguments = ["import", str(log), "--rig", str(rough), "--out", str(tmp_path / "out"), "--check"]
    assert main(arguments) == 0
    assert "pam gap calibrate" in capsys.readouterr().out
    assert (tmp_path / "out" / TABLE).exists()


def test_what_a_diagnosis_would_refuse_is_said_on_the_page_and_gives_no_table(
    log: Path, rig: Rig, tmp_path: Path
) -> None:
    flexor = rig.joints[0].muscles[0]
    (tmp_path / "map.yaml").write_text(
        f"time: {{column: t_ms, unit: ms}}\nchannels: {{pressure_states.{flexor}: 'p1 [bar]', "
        f"pressure_states.{rig.joints[0].muscles[1]}: 'p2 [bar]'}}\n"
    )
    preview = import_log(log, rig, tmp_path / "out", map_path=tmp_path / "map.yaml")
    assert "looks like bar (multiply by 100000)" in preview.problems[0]
    assert "A diagnosis would refuse this" in (tmp_path / "out" / PAGE).read_text()
    assert not (tmp_path / "out" / TABLE).exists()


def test_on_a_terminal_every_channel_is_asked_about(rig: Rig) -> None:
    """Enter keeps the offer, `-` leaves a channel out, and a wrong name is asked again."""
    flexor, extensor = (f"pressure_states.{muscle}" for muscle in rig.joints[0].muscles)
    given = {flexor: ["p9", "", "p2 [bar] bar"], extensor: ["-"]}

    def answer(text: str) -> str:
        channel = text.partition(" [")[0]
        return given[channel].pop(0) if channel in given else given[flexor].pop(0) if (
            text.startswith("no column")
        ) else ""  # fmt: skip

    offers = propose(LOG, rig)
    kept = {p.channel: p for p in ask_about(offers, LOG, rig, is_bag=False, ask=answer)}
    assert kept[flexor] == Proposed(flexor, "p2 [bar]", "bar")
    assert extensor not in kept
    assert kept["time"] == Proposed("time", "t_ms", "ms")


def test_a_bag_of_the_suite_is_understood_without_what_only_a_simulation_knows(rig: Rig) -> None:
    """Proposed were the true angle of the simulated rig, and absolute pressures as gauge."""
    flexor, extensor = rig.joints[0].muscles
    at_hand = [
        *(f"/{muscle}/pressure.fluid_pressure" for muscle in (flexor, extensor)),
        *(f"/ground_truth/muscle_states.effort.{muscle}" for muscle in (flexor, extensor)),
        "/ground_truth/joint_states.position.elbow",
        "/joint_estimates.effort.elbow",
        *(f"/muscle_states.effort.{muscle}" for muscle in (flexor, extensor)),
    ]
    wanted = {
        f"pressure_states.{flexor}": f"/arm/pressure_states.effort.{flexor}",
        f"pressure_states.{extensor}": f"/arm/pressure_states.effort.{extensor}",
        "joint_states.elbow.position": "/arm/joint_states.position.elbow",
        f"valve_commands.{flexor}": f"/arm/sent_valve_commands.position.{flexor}",
        f"valve_commands.{extensor}": f"/arm/sent_valve_commands.position.{extensor}",
    }
    asked = [f"/arm/valve_commands.position.{muscle}" for muscle in (flexor, extensor)]
    columns = dict.fromkeys((*at_hand, *asked, *wanted.values()), 200000.0 + P1)
    assert {p.channel: p.column for p in propose(columns, rig, is_bag=True)} == wanted


def test_the_measured_pair_of_muscles_is_understood(tmp_path: Path) -> None:
    """Its columns are named by their authors; only the displacement, in m, is not an angle."""
    rig = load_rig(DATA / "rig.yaml")
    preview = import_log(DATA / "recording.csv.gz", rig, tmp_path)
    found = {c: e.columns for c, e in preview.column_map.channels.items()}
    assert found["pressure_states.muscle_1"] == ("pressure_1_kPa",)
    assert found["pressure_states.muscle_2"] == ("pressure_2_kPa",)
    assert preview.recording is not None
    assert preview.recording.values["pressure_states.muscle_1"].max() > 5e4


def test_columns_of_different_runs_in_one_log_are_not_mixed(rig: Rig) -> None:
    """Structures in a cell have the same names; the first run that is complete is proposed."""
    run = {"time": TIME, "p_flexor": P1, "p_extensor": P2, "angle": ANGLE}
    log = {"runs.0.angle": ANGLE, "runs.0.time": TIME}
    log |= {f"runs.{k}.{name}": column for k in (1, 2) for name, column in run.items()}
    found = {one.channel: one.column for one in propose(log, rig)}
    assert set(found.values()) == {f"runs.1.{name}" for name in run}
    sides = {
        "t": TIME,
        **{f"muscle.{k}.{name}": P1 for k in (1, 2) for name in ("pressure", "command")},
    }
    both = {one.channel: one.column for one in propose(sides, rig)}
    assert both["pressure_states.elbow_flexor"] == "muscle.1.pressure"
    assert both["pressure_states.elbow_extensor"] == "muscle.2.pressure"


def test_a_bench_has_a_length_and_what_has_moved_only_is_refused_with_advice(
    rig: Rig, tmp_path: Path
) -> None:
    flexor = rig.joints[0].muscles[0]
    bench = replace(rig, joints=(), muscles=(rig.muscle(flexor),))
    log = {
        "Time (in ms)": 1e3 * TIME,
        "Laser (in mm)": 12.0 * np.sin(TIME),
        "Pressure (in bar)": 1e-5 * P1,
        "Force (in N)": 1e-3 * P1,
    }
    pd.DataFrame(log).to_csv(tmp_path / "bench.csv", index=False)
    preview = import_log(tmp_path / "bench.csv", bench, tmp_path / "out")
    found = {c: e.columns for c, e in preview.column_map.channels.items()}
    assert found == {
        f"pressure_states.{flexor}": ("Pressure (in bar)",),
        f"muscle_states.{flexor}.position": ("Laser (in mm)",),
        f"muscle_states.{flexor}.effort": ("Force (in N)",),
    }
    assert "add the length at 0" in preview.problems[0]


def test_mistakes_are_one_line(
    tmp_path: Path, rig_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pd.DataFrame({"a": TIME, "b": TIME}).to_csv(tmp_path / "x.csv", index=False)
    pd.DataFrame({"p1": P1, "p2": P2}).to_csv(tmp_path / "y.csv", index=False)
    for log, told in (
        (tmp_path / "x.csv", "no column was mapped: none of 'a', 'b' looks like"),
        (tmp_path / "y.csv", "no column looks like a time"),
        (rig_path, "not a log"),
    ):
        command = ["import", str(log), "--rig", str(rig_path), "--out", str(tmp_path / "out")]
        assert main(command) == 2
        error = capsys.readouterr().err
        assert told in error and error.count("\n") == 1
