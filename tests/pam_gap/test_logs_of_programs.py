"""Exports of programs of other makers: where their names, units and times stand."""

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from pam_gap.import_log.import_log import import_log
from pam_gap.import_log.propose_map import Proposed, propose
from pam_gap.recordings.import_csv import read_columns
from pam_gap.recordings.recording import RecordingError
from pam_model.rig import Rig
from support.lab_logs import ANGLE, FIRST, PRESSURE, SECOND, TIME, written

EXTENSOR: Final = "pressure_states.elbow_extensor"
POSITION: Final = "joint_states.elbow.position"
LABVIEW: Final = "\n".join([
    "LabVIEW Measurement\t", "Writer_Version\t2", "Separator\tTab", "Date\t2024/01/24",
    "***End_of_Header***\t", "\t", "Channels\t3\t\t\t", "Samples\t400\t400\t400\t",
    "Date\t2024/01/24\t2024/01/24\t2024/01/24\t", "Time\t16:53:12.1\t16:53:12.1\t16:53:12.1\t",
    "Y_Unit_Label\tbar\tbar\trad\t", "X0\t0.0E+0\t0.0E+0\t0.0E+0\t",
    "Delta_X\t0.004\t0.004\t0.004\t", "***End_of_Header***\t\t\t\t",
    "X_Value\tp1\tp2\tangle\tComment",
])  # fmt: skip
DSPACE: Final = "\n".join([
    '"type","csv"', '"version","1.0"', '"path","x-axis","Model/p1","Model/p2","Model/angle"',
    '"unit","s","bar","bar","deg"', '"trace_values"',
])  # fmt: skip


def proposed(path: Path, rig: Rig) -> dict[str, Proposed]:
    table = read_columns(path)
    return {one.channel: one for one in propose(table.columns, rig, units=table.units)}


@pytest.mark.parametrize("first", [TIME, [""] * TIME.size])
def test_settings_of_channels_above_the_names_are_no_rows(
    first: np.ndarray | list[str], tmp_path: Path
) -> None:
    """The numbers of samples, dates and steps of LabVIEW were taken for the first rows."""
    none = [""] * TIME.size
    columns = (first, 1e-5 * FIRST, 1e-5 * SECOND, ANGLE, none)
    table = read_columns(written(tmp_path / "log.lvm", LABVIEW, *columns, between="\t"))
    assert list(table.columns) == ["X_Value", "p1", "p2", "angle", "Comment"]
    np.testing.assert_allclose(table.columns["p1"], 1e-5 * FIRST, atol=1e-4)


def test_names_and_units_may_stand_above_a_line_that_says_that_rows_begin(
    rig: Rig, tmp_path: Path
) -> None:
    """The table of dSPACE was refused; its first cells say what a line holds."""
    none = [""] * TIME.size
    columns = (none, TIME, 1e-5 * FIRST, 1e-5 * SECOND, np.degrees(ANGLE))
    path = written(tmp_path / "log.csv", DSPACE, *columns, between=",")
    found = proposed(path, rig)
    assert found["time"].column == "x-axis"
    assert (found[PRESSURE].column, found[PRESSURE].unit) == ("Model/p1", "bar")
    assert (found[POSITION].column, found[POSITION].unit) == ("Model/angle", "deg")


def test_a_quoted_name_may_have_its_unit_in_a_second_line(rig: Rig, tmp_path: Path) -> None:
    """A spreadsheet writes it so; no line seemed to hold the names."""
    names = '"Time\n[ms]";"p1\n[bar]";"p2\n[bar]";"phi"'
    columns = (1e3 * TIME, 1e-5 * FIRST, 1e-5 * SECOND, ANGLE)
    path = written(tmp_path / "log.csv", names, *columns)
    found = proposed(path, rig)
    assert (found["time"].column, found["time"].unit) == ("Time [ms]", "ms")
    assert read_columns(path).columns["p1 [bar]"].size == TIME.size


@pytest.mark.parametrize("word", ["n.a.", "Bad", "OVERFLOW"])
def test_words_in_the_first_rows_are_no_names(word: str, tmp_path: Path) -> None:
    """The last row of words was taken for the line of names."""
    cells = [word] * 5 + [f"{p:.4f}" for p in FIRST[5:]]
    table = read_columns(written(tmp_path / "log.csv", "t;p1;p2", TIME, cells, cells))
    assert list(table.columns) == ["t", "p1", "p2"]
    assert table.texts["p1"].count == 5


@pytest.mark.parametrize("names", ["p:1({})", "/pressures/data[{}]", "p[{}] [bar]"])
@pytest.mark.parametrize("first", [0, 1])
def test_a_number_in_brackets_counts_columns(names: str, first: int, rig: Rig) -> None:
    """The 1 of `data[1]` was taken for the unit of a number without one."""
    columns = {names.format(first + k): 1e-5 * p for k, p in enumerate((FIRST, SECOND))}
    found = {one.channel: one.column for one in propose({"t": TIME, **columns}, rig)}
    assert [found[PRESSURE], found[EXTENSOR]] == list(columns)


def test_the_number_of_a_unit_is_not_that_of_a_muscle(rig: Rig, tmp_path: Path) -> None:
    names = "t;p1 [kgf/cm2];p2 [kgf/cm2];phi"
    path = written(tmp_path / "log.csv", names, TIME, FIRST, SECOND, ANGLE)
    with pytest.raises(RecordingError):
        import_log(path, replace(rig, joints=()), tmp_path / "out")
    doubts = import_log(path, rig, tmp_path / "out", is_rough=True).doubts
    assert [text.partition(" looks")[0] for text in doubts] == [
        f"{PRESSURE}: 'p1 [kgf/cm2]'",
        f"{EXTENSOR}: 'p2 [kgf/cm2]'",
    ]


def test_topics_of_the_suite_are_known_as_plotjuggler_writes_them(rig: Rig, tmp_path: Path) -> None:
    """The commands were taken for the reference of a joint, and the unit was in doubt."""
    muscles = [muscle.name for muscle in rig.muscles]
    names = ["__time", "/joint_states/elbow/position"]
    names += [f"/pressure_states/{muscle}/effort" for muscle in muscles]
    names += [f"/valve_commands/{muscle}/position" for muscle in muscles]
    opening = 0.2 * np.cos(5.0 * TIME)
    columns = (TIME, ANGLE, FIRST, SECOND, opening, -opening)
    path = written(tmp_path / "log.csv", ",".join(names), *columns, between=",")
    preview = import_log(path, rig, tmp_path / "out", is_rough=True)
    assert not preview.doubts
    assert preview.column_map.channels["valve_commands.elbow_flexor"].column == names[4]


def test_dates_of_matlab_have_the_month_as_a_word(tmp_path: Path) -> None:
    stamps = [f"04-Mar-2026 12:00:{s:06.3f}" for s in TIME]
    table = read_columns(written(tmp_path / "log.csv", "Time;p1", stamps, FIRST))
    np.testing.assert_allclose(table.columns["Time"] - table.columns["Time"][0], TIME, atol=1e-3)
    assert not table.texts


def test_a_time_in_minutes_is_read_if_it_says_so(rig: Rig, tmp_path: Path) -> None:
    minutes = [f"{t / 60.0:.8f}" for t in TIME]
    names = "time [min];p1 [bar];p2 [bar];phi"
    path = written(tmp_path / "log.csv", names, minutes, 1e-5 * FIRST, 1e-5 * SECOND, ANGLE)
    recording = import_log(path, rig, tmp_path / "out", is_rough=True).recording
    assert recording is not None
    assert recording.sample_time == pytest.approx(0.004)


def test_days_of_a_spreadsheet_are_refused_with_what_to_write(rig: Rig, tmp_path: Path) -> None:
    days = [f"{45315.7 + t / 86400.0:.11f}" for t in TIME]
    names = "Date;p1 [bar];p2 [bar];phi"
    path = written(tmp_path / "log.csv", names, days, 1e-5 * FIRST, 1e-5 * SECOND, ANGLE)
    (problem,) = import_log(path, rig, tmp_path / "out", is_rough=True).problems
    assert "time advances by 4.6e-08 s per sample" in problem.replace("4.63e", "4.6e")
    assert "`scale: 86400`" in problem


@pytest.mark.parametrize("upper", ["time;pressure;pressure;joint", "time;pressure;;joint"])
def test_names_may_be_spread_over_two_lines(upper: str, tmp_path: Path) -> None:
    """They were refused as two columns with one name."""
    names = f"{upper}\nt;flexor;extensor;flexor"
    path = written(tmp_path / "log.csv", names, TIME, FIRST, SECOND, ANGLE)
    found = list(read_columns(path).columns)
    assert found == ["time t", "pressure flexor", "pressure extensor", "joint flexor"]
    alike = written(path, f"{upper}\nt;elbow;elbow;elbow", TIME, FIRST, SECOND, ANGLE)
    with pytest.raises(RecordingError, match="two columns are called 'pressure elbow'"):
        read_columns(alike)


def test_names_that_are_repeated_between_the_rows_are_no_row(tmp_path: Path) -> None:
    rows = [f"{t:.3f};{p:.3f}" for t, p in zip(TIME, FIRST, strict=True)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["t;p", *rows[:50], "t;p", *rows[50:]]))
    table = read_columns(path)
    np.testing.assert_allclose(table.columns["t"], TIME)
    assert not table.texts


@pytest.mark.parametrize(
    ("first", "second"),
    [("biceps", "triceps"), ("agonist", "antagonist"), ("a", "b"), ("A", "B"), ("flexor", "ext")],
)
@pytest.mark.parametrize("is_second_first", [False, True])
def test_words_of_sides_and_letters_say_which_muscle_it_is(
    first: str, second: str, is_second_first: bool, rig: Rig
) -> None:
    """The column that stood first was taken for the first muscle."""
    columns = {f"p_{first} [bar]": 1e-5 * FIRST, f"p_{second} [bar]": 1e-5 * SECOND}
    if is_second_first:
        columns = dict(reversed(columns.items()))
    found = {one.channel: one for one in propose({"t": TIME, **columns}, rig)}
    assert found[PRESSURE].column == f"p_{first} [bar]"
    assert not found[PRESSURE].alike


def test_a_word_of_a_side_that_names_another_muscle_of_the_rig_is_that_muscle(rig: Rig) -> None:
    """Of a knee, the extensor may be the first muscle of the joint."""
    names = {"elbow_flexor": "knee_extensor", "elbow_extensor": "knee_flexor"}
    knee = replace(
        rig,
        muscles=tuple(replace(m, name=names[m.name]) for m in rig.muscles),
        joints=(replace(rig.joints[0], muscles=("knee_extensor", "knee_flexor")),),
    )
    columns = {"t": TIME, "p_flexor": FIRST, "p_extensor": SECOND}
    found = {one.channel: one.column for one in propose(columns, knee)}
    assert found["pressure_states.knee_extensor"] == "p_extensor"


@pytest.mark.parametrize(("mark", "point"), [(",", "."), (".", ","), ("'", ".")])
def test_whole_numbers_may_have_marks_of_thousands(mark: str, point: str, tmp_path: Path) -> None:
    """199.744 Pa with decimal commas elsewhere was read as 200 Pa."""
    cells = [f"{value:,.0f}".replace(",", mark) for value in FIRST - 1.4e5]
    cells[3] = "999"
    angle = [f"{a:.4f}".replace(".", point) for a in ANGLE]
    times = [f"{t:.3f}".replace(".", point) for t in TIME]
    table = read_columns(written(tmp_path / "log.csv", "t;p [Pa];phi", times, cells, angle))
    expected = np.round(FIRST - 1.4e5)
    expected[3] = 999.0
    np.testing.assert_allclose(table.columns["p [Pa]"], expected)
    np.testing.assert_allclose(table.columns["t"], TIME, atol=1e-6)
