"""Names, units and numbers are found wherever an instrument or a program puts them."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from pam_gap.__main__ import main
from pam_gap.import_log.import_log import columns_of, import_log
from pam_gap.import_log.propose_map import propose
from pam_gap.recordings.column_map import load_column_map
from pam_gap.recordings.import_csv import read_table
from pam_gap.recordings.recording import RecordingError
from pam_model.rig import load_rig
from support.rigs import ELBOW

RIG = load_rig(ELBOW)
ROWS = [(0.01 * k, 2.0 + 0.1 * np.sin(0.2 * k), -5.0 + 0.3 * k) for k in range(40)]
NAMES = ("t", "p1", "phi")


def text(between: str, before: str = "", names: str = "", sign: str = "", end: str = "") -> str:
    """The table with this separator, and what stands before it."""
    plus = f"+{sign}" if sign else ""
    cells = [[f"{x:+.4f}".replace("-", f"-{sign}").replace("+", plus) for x in row] for row in ROWS]
    rows = [between.join(row) + end for row in cells]
    return "\n".join([*filter(None, [before]), names or between.join(NAMES), *rows]) + "\n"


METADATA = {
    "settings in two columns": "Vendor\tLogger X\nData points\t4000\n\nAMP\nCH1\tp1\tDC\t10V\n",
    "one line": "Measured on 2024-01-24",
    "a key with numbers": "Rate\t5\t1000\nRange\t10\t3",
    "comments": "# made by hand\n# 3 channels",
    "many lines": "\n".join(f"key {k} = {k}" for k in range(50)),
}  # fmt: skip


@pytest.mark.parametrize("between", [",", ";", "\t", " ", "   "])
@pytest.mark.parametrize("before", METADATA.values(), ids=METADATA)
@pytest.mark.parametrize("sign", ["", " "])
def test_the_names_are_found_below_what_an_instrument_writes(
    between: str, before: str, sign: str, tmp_path: Path
) -> None:
    if sign and not between.strip(" "):
        return  # a sign apart cannot be told from a separator of blanks
    path = tmp_path / "log.txt"
    path.write_text(text(between, before, sign=sign))
    table = columns_of(path)
    assert tuple(table.columns) == NAMES
    np.testing.assert_allclose(np.array(list(table.columns.values())).T, ROWS, atol=1e-4)
    assert not table.texts


def test_units_below_the_names_are_no_row_and_reach_the_proposal(tmp_path: Path) -> None:
    path = tmp_path / "log.dat"
    path.write_text(text("\t", names="t\tp1\tphi\n[ms]\t(bar)\t°"))
    table = columns_of(path)
    assert table.units == {"t": "ms", "p1": "bar", "phi": "deg"}
    found = {p.column: p.unit for p in propose(table.columns, RIG, units=table.units)}
    assert found == {"t": "ms", "p1": "bar", "phi": "deg"}


@pytest.mark.parametrize(
    ("names", "end"),
    [("# t p1 phi", ""), ("t  p1  phi", ""), ("t,p1,phi,", ","), ("t,p1,phi", ","),
     ("Time (in s)\tp 1\tphi", "")],
)  # fmt: skip
def test_names_behind_a_mark_with_blanks_or_ended_by_a_separator(
    names: str, end: str, tmp_path: Path
) -> None:
    between = "," if end else "\t" if "\t" in names else " "
    path = tmp_path / "log.csv"
    path.write_text(text(between, names=names, end=end))
    table = columns_of(path)
    assert len(table.columns) == 3
    np.testing.assert_allclose(list(table.columns.values())[2], [row[2] for row in ROWS], atol=1e-4)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (text(",").split("\n", 1)[1], "first line holds numbers; expected the names of the 3"),
        (text(",", names="run 5"), "line 1 above it, 'run 5', does not name 3 columns"),
        (text(",", names="a,b,b"), "two columns are called 'b'"),
        (text(",", names="a," + "b" * 300 + "," + "b" * 300), r"b'\.\.\. \(300 characters\)"),
    ],
)
def test_names_that_are_not_found_are_pointed_at(content: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(content)
    with pytest.raises(RecordingError, match=told):
        columns_of(path)


def test_a_line_that_is_too_long_and_a_byte_that_is_no_text_end_nothing(tmp_path: Path) -> None:
    lines = text(",").splitlines()
    lines[20] += ",7,8"
    content = "\n".join(lines).encode().replace(b"\n0.3000", b"\n\xff.3000")
    path = tmp_path / "log.csv"
    path.write_bytes(content)
    table = columns_of(path)
    assert "1 lines, the first of them line 21, have more than 3 columns" in table.remarks[0]
    assert np.isfinite(table.columns["p1"]).sum() == len(ROWS) - 1


def test_a_date_a_time_of_day_and_microseconds_are_one_time(tmp_path: Path) -> None:
    """Over midnight, in whole seconds with the rest apart, as data loggers write it."""
    rows = ["Date\tTime\tus\tp1\tp2\tphi"]
    for k in range(400):
        at = 86398 * 1000 + 10 * k
        day, rest = divmod(at, 86400 * 1000)
        second = rest // 1000
        clock = f"{second // 3600:02}:{second // 60 % 60:02}:{second % 60:02}"
        swing = np.sin(0.1 * k)
        rows.append(
            f"2024/1/{30 + day}\t{clock}\t{rest % 1000 * 1000}\t{2 + swing}\t{2 - swing}\t{swing}"
        )
    path = tmp_path / "log.csv"
    path.write_text("\n".join(rows))
    preview = import_log(path, RIG, tmp_path / "out")
    assert preview.recording is not None
    assert preview.recording.sample_time == pytest.approx(0.01)
    assert preview.recording.duration == pytest.approx(4.0, abs=0.02)
    time = load_column_map(tmp_path / "out" / "map.yaml").time
    assert time is not None and set(time.columns) == {"Date", "Time", "us"}


def test_a_mapped_column_that_is_text_is_named_with_its_first_value(tmp_path: Path) -> None:
    path, place = tmp_path / "log.csv", tmp_path / "map.yaml"
    path.write_text("t,p1\n" + "".join(f"{k},about {k}\n" for k in range(30)))
    muscle = RIG.joints[0].muscles[0]
    place.write_text(f"time: t\nchannels: {{pressure_states.{muscle}: p1}}")
    with pytest.raises(
        RecordingError, match=r"column 'p1' holds no number but text such as 'about 0'"
    ):
        read_table(path, load_column_map(place))


def test_a_time_and_pressures_that_are_text_are_named_with_their_first_value(
    tmp_path: Path,
) -> None:
    names = "time,p elbow_flexor [bar],p elbow_extensor [bar],phi elbow [deg]"
    path = tmp_path / "log.csv"
    path.write_text("\n".join([names, *(f"at {k},2,2.{k},{k}" for k in range(40))]))
    with pytest.raises(RecordingError, match=r"a time .*; column 'time' holds text such as 'at 0'"):
        import_log(path, RIG, tmp_path / "out")
    path.write_text("\n".join([names, *(f"0.{k:03},{2 + k} bar,2,{k}" for k in range(400))]))
    problem, position = import_log(path, RIG, tmp_path / "out").problems
    assert "column 'p elbow_flexor [bar]' holds text such as '2 bar' in row 1" in problem
    assert "joint_states.elbow.position reaches" in position


@pytest.mark.parametrize("channels", ["{}", "{pressure_states.elbow_flexor: q}"])
def test_a_wrong_map_is_named_and_no_symptom(channels: str, tmp_path: Path, capsys) -> None:
    (tmp_path / "log.csv").write_text(text(","))
    (tmp_path / "map.yaml").write_text(f"time: t\nchannels: {channels}")
    command = ["import", str(tmp_path / "log.csv"), "--rig", str(ELBOW), "--check",
               "--map", str(tmp_path / "map.yaml"), "--out", str(tmp_path / "out")]  # fmt: skip
    assert main(command) != 0
    told = "".join(capsys.readouterr())
    assert "8 samples" not in told
    assert "no column is mapped" in told or "no column 'q'" in told


def test_structures_in_cells_are_searched(tmp_path: Path) -> None:
    cells = np.empty(2, dtype=object)
    cells[:] = [{"p": np.arange(50.0), "name": "left"}, {"p": np.arange(50.0) + 1}]
    savemat(tmp_path / "log.mat", {"trials": cells, "arm": {"runs": cells}})
    names = set(columns_of(tmp_path / "log.mat").columns)
    assert names == {f"{name}.{k}.p" for name in ("trials", "arm.runs") for k in (0, 1)}


def regulated(tmp_path: Path) -> object:
    """The elbow with pressure regulators."""
    content = ELBOW.read_text()
    content = content.replace("kind: flow", "kind: pressure_regulator")
    (tmp_path / "regulated.yaml").write_text(content)
    return load_rig(tmp_path / "regulated.yaml")


def test_units_follow_from_the_kind_of_valve(tmp_path: Path) -> None:
    """A set point of a regulator is a pressure and never an opening, and the other way round."""
    wave = 200.0 + 50.0 * np.sin(0.1 * np.arange(200))
    log = {"Time": np.arange(200.0), "Setpoint_kPa": wave, "Feedback_kPa": wave}
    commands = {p.channel: p for p in propose(log, regulated(tmp_path))}  # type: ignore[arg-type]
    assert commands["valve_commands.elbow_flexor"].column == "Setpoint_kPa"
    assert commands["valve_commands.elbow_flexor"].unit == "kPa"
    assert commands["pressure_states.elbow_flexor"].column == "Feedback_kPa"
    spool = {p.channel: p for p in propose(log, RIG)}
    assert "valve_commands.elbow_flexor" not in spool


def test_the_words_of_public_logs_are_known(tmp_path: Path) -> None:
    """Two logs of real robots: measured and desired pressure of agonist and antagonist."""
    wave = 1e5 + 5e4 * np.sin(0.1 * np.arange(200))
    names = ("time", "obs_ago", "obs_antago", "des_ago", "des_antago", "q_des", "q_obs")
    log = dict.fromkeys(names, wave) | {"time": 0.01 * np.arange(200)}
    found = {p.channel: p.column for p in propose(log, regulated(tmp_path))}  # type: ignore[arg-type]
    assert found == {
        "time": "time",
        "pressure_states.elbow_flexor": "obs_ago",
        "pressure_states.elbow_extensor": "obs_antago",
        "valve_commands.elbow_flexor": "des_ago",
        "valve_commands.elbow_extensor": "des_antago",
        "joint_states.elbow.position": "q_obs",
    }


@pytest.mark.parametrize(("rate", "code"), [(20.0, 1), (200.0, 0)])
def test_check_fails_where_no_verdict_can_follow(
    rate: float, code: int, tmp_path: Path, capsys
) -> None:
    """At 20 Hz the motion of a joint falls between the samples."""
    time = np.arange(int(12 * rate)) / rate
    swing = np.sin(3.0 * time)
    noise = np.random.default_rng(1).normal(size=(3, time.size))
    rows = np.stack(
        [time, 2.0 + 0.8 * swing + 1e-3 * noise[0], 2.0 - 0.8 * swing + 1e-3 * noise[1],
         0.3 * swing + 1e-4 * noise[2]]
    ).T  # fmt: skip
    path = tmp_path / "log.csv"
    np.savetxt(path, rows, delimiter=",", header="time,p1_bar,p2_bar,angle_rad", comments="")
    command = ["import", str(path), "--rig", str(ELBOW), "--out", str(tmp_path / "out"), "--check"]
    assert main(command) == code
    assert ("Too slow: 20 samples per second" in capsys.readouterr().out) == bool(code)
    assert (tmp_path / "out" / "recording.parquet").exists()


def test_a_bench_log_without_a_length_is_refused_by_the_name_of_what_it_lacks(
    tmp_path: Path, capsys
) -> None:
    content = ELBOW.read_text()
    begin, end = content.index("    joints:"), content.index("    elbow_flexor:")
    bench = content[:begin] + "    joints: []\n    bench_muscles: [elbow_flexor]\n" + content[end:]
    rig, path = tmp_path / "bench.yaml", tmp_path / "log.csv"
    rig.write_text(bench[: bench.index("    elbow_extensor:")])
    time = np.arange(2000.0)
    rows = np.stack([2.0 * time, 2.0 + np.sin(0.01 * time), 50.0 + 20.0 * np.sin(0.01 * time)]).T
    names = "Time (in ms),Pressure (in bar),Force (in N)"
    np.savetxt(path, rows, delimiter=",", header=names, comments="")
    command = ["import", str(path), "--rig", str(rig), "--out", str(tmp_path / "o"), "--check"]
    assert main(command) == 1
    out = capsys.readouterr().out
    assert "pressure_states.elbow_flexor: 'Pressure (in bar)'" in out
    assert "muscle_states.elbow_flexor.position is not recorded; expected" in out
