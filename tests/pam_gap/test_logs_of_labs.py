"""A log is understood as laboratories write it, or its strange column is named; never guessed."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from pam_gap.__main__ import main
from pam_gap.import_log.import_log import MAP, import_log
from pam_gap.import_log.propose_map import Proposed, propose
from pam_gap.recordings.column_map import load_column_map
from pam_gap.recordings.import_csv import read_columns
from pam_gap.recordings.import_recording import import_recording
from pam_gap.recordings.recording import RawChannel, RawRecording, RecordingError
from pam_gap.recordings.resample import resample
from pam_model.rig import Rig, save_rig
from support.lab_logs import ANGLE, FIRST, PRESSURE, SECOND, TIME, written


def proposed(path: Path, rig: Rig) -> dict[str, Proposed]:
    table = read_columns(path)
    return {one.channel: one for one in propose(table.columns, rig, units=table.units)}


UNITS: Final = {
    "bar": (1e5, False), "BAR": (1e5, False), "bar(g)": (1e5, False), "barg": (1e5, False),
    "psig": (6894.757, False), "kPa gauge": (1e3, False), "mbar rel": (1e2, False),
    "psia": (6894.757, True), "bar(a)": (1e5, True), "bar abs": (1e5, True), "kPa_abs": (1e3, True),
    "Pa absolute": (1.0, True),
}  # fmt: skip


@pytest.mark.parametrize("place", ["p1 [{}]", "p1 ({})", "p1 {}", "below"])
@pytest.mark.parametrize("unit", UNITS)
def test_a_stated_unit_of_pressure_is_read_with_its_zero(
    unit: str, place: str, rig: Rig, tmp_path: Path
) -> None:
    """Taken for kPa by its size was a pressure in psia, and an absolute one for gauge."""
    factor, absolute = UNITS[unit]
    one, two = ((p + 101325.0 * absolute) / factor for p in (FIRST, SECOND))
    name = place.format(unit)
    if place == "below":
        names = f"t;p1;p2;phi\ns;{unit};{unit};rad"
    else:
        names = f"t;{name};{name.replace('1', '2', 1)};phi"
    path = written(tmp_path / "log.csv", names, TIME, one, two, ANGLE)
    import_log(path, rig, tmp_path / "out")
    entry = load_column_map(tmp_path / "out" / MAP).channels[PRESSURE]
    np.testing.assert_allclose(entry.factor * one + entry.offset, FIRST, atol=1.0)


@pytest.mark.parametrize("name", ["p1 [V]", "p1 [inHg]", "p1 (kgf/cm2)", "p1 (0-10V)", "p1 [Torr]"])
def test_a_unit_that_no_channel_has_is_not_guessed_by_its_size(
    name: str, rig: Rig, tmp_path: Path
) -> None:
    names = f"t;{name};{name.replace('1', '2', 1)};phi"
    path = written(tmp_path / "log.csv", names, TIME, 1e-5 * FIRST, 1e-5 * SECOND, ANGLE)
    assert PRESSURE not in proposed(path, rig)
    only = written(tmp_path / "only.csv", f"t;{name}", TIME, 1e-5 * FIRST)
    with pytest.raises(RecordingError, match="in a unit that no channel has") as told:
        import_log(only, rig, tmp_path / "out")
    assert name in str(told.value)


@pytest.mark.parametrize("word", ["raw", "adc", "counts", "LSB"])
def test_steps_of_a_converter_are_no_pressure(word: str, rig: Rig, tmp_path: Path) -> None:
    """Taken for mbar were whole numbers up to 4095."""
    steps = [np.round(4095.0 * p / 7e5) for p in (FIRST, SECOND)]
    names = f"t;p1_{word};p2_{word};phi"
    path = written(tmp_path / "log.csv", names, TIME, *steps, ANGLE)
    assert PRESSURE not in proposed(path, rig)


@pytest.mark.parametrize("names", ["valve.{}", "valve_{}", "u{}", "u[{}]", "valve_0{} [%]"])
@pytest.mark.parametrize("first", [0, 1])
def test_the_first_of_two_numbers_is_the_first_muscle(names: str, first: int, rig: Rig) -> None:
    """Of columns that are counted from 0, the second went to the first muscle."""
    at_hand = {"t": TIME, "p_flexor": FIRST, "p_extensor": SECOND}
    commands = [names.format(first + k) for k in range(2)]
    at_hand |= {name: 0.2 * np.cos(5.0 * TIME) for name in commands}
    found = {one.channel: one.column for one in propose(at_hand, rig)}
    assert [found[f"valve_commands.elbow_{m}"] for m in ("flexor", "extensor")] == commands


def clock(form: str) -> Callable[[float], str]:
    """Writes a time after eight seconds before noon of the fourth of March, in a form."""

    def write(time: float) -> str:
        seconds = 11 * 3600 + 59 * 60 + 58.0 + time
        hour, minute, second = int(seconds // 3600), int(seconds // 60) % 60, seconds % 60.0
        half = "AM" if hour < 12 else "PM"
        parts = {"h": hour, "m": minute, "s": f"{second:06.3f}", "c": f"{second:06.3f}"}
        parts |= {"half": half, "twelve": (hour - 1) % 12 + 1, "c": parts["c"].replace(".", ",")}
        return form.format(**parts)

    return write


FORMS: Final = {
    "ISO": "2026-03-04T{h:02}:{m:02}:{s}",
    "German": "04.03.2026 {h:02}:{m:02}:{c}",
    "American": "03/04/2026 {twelve:02}:{m:02}:{s} {half}",
    "British": "14/03/2026 {h:02}:{m:02}:{s}",
    "time of day": "{h:02}:{m:02}:{s}",
    "twelve hours": "{twelve}:{m:02}:{s} {half}",
}


@pytest.mark.parametrize("name", ["Timestamp", "Datum", "DateTime"])
@pytest.mark.parametrize("form", FORMS)
def test_a_time_is_read_as_clocks_write_it(form: str, name: str, rig: Rig, tmp_path: Path) -> None:
    names = f"{name};p1 [bar];p2 [bar];phi"
    stamps = [clock(FORMS[form])(float(t)) for t in TIME * 10.0]
    path = written(tmp_path / "log.csv", names, stamps, 1e-5 * FIRST, 1e-5 * SECOND, ANGLE)
    table = read_columns(path)
    assert {p.channel: p.column for p in propose(table.columns, rig)}["time"] == name
    passed = table.columns[name] - table.columns[name][0]
    np.testing.assert_allclose(passed, 10.0 * TIME, atol=2e-3)


def test_the_order_of_day_and_month_is_that_of_a_short_recording(tmp_path: Path) -> None:
    """From 04/03 to 05/03 in two seconds: the day stands first."""
    late = [f"04/03/2026 23:59:{s:06.3f}" for s in (58.0, 59.0)]
    path = written(tmp_path / "log.csv", "Date;p", [*late, "05/03/2026 00:00:00.000"], ["1"] * 3)
    np.testing.assert_allclose(np.diff(read_columns(path).columns["Date"]), 1.0)


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
@pytest.mark.parametrize("since_1970", [False, True])
def test_the_unit_of_a_time_follows_from_its_steps(unit: str, since_1970: bool, rig: Rig) -> None:
    factor = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}[unit]
    stamps = (TIME + 1.7e9 * since_1970) * factor
    found = propose({"stamp": stamps, "p1": FIRST, "p2": SECOND, "phi": ANGLE}, rig)
    assert (found[0].channel, found[0].unit) == ("time", "" if unit == "s" else unit)


WORDS_FOR_NOTHING: Final = (
    *(
        "-",
        "--",
        "n/a",
        "N.A.",
        "#NV",
        "#N/A",
        "#DIV/0!",
        "#VALUE!",
        "NULL",
        "?",
        "OVF",
        "nan(ind)",
    ),
    *("1.#IND", "-1.#IND", "1.#QNAN", "1.#INF", "-1.#INF", "inf", "-Infinity", "---.---", ""),
)


@pytest.mark.parametrize("word", WORDS_FOR_NOTHING)
def test_a_word_for_nothing_is_no_number_and_takes_nothing_with_it(
    word: str, rig: Rig, tmp_path: Path
) -> None:
    """Read was 1.#IND as 1, without the rest of its row; one inf hid the unit of its column."""
    cells = [f"{p:.4f}" for p in 1e-5 * FIRST]
    cells[100] = cells[200] = word
    names = "t;p1;p2;phi"
    path = written(tmp_path / "log.csv", names, TIME, cells, 1e-5 * SECOND, ANGLE)
    table = read_columns(path)
    assert not np.isfinite(table.columns["p1"][[100, 200]]).any()
    np.testing.assert_allclose(table.columns["phi"], ANGLE, atol=1e-4)
    assert {p.channel: p.unit for p in propose(table.columns, rig)}[PRESSURE] == "bar"


@pytest.mark.parametrize("sign", ["−", "–", "- ", "− "])
def test_a_minus_may_be_that_of_a_word_processor(sign: str, tmp_path: Path) -> None:
    cells = [f"{a:.4f}".replace("-", sign) for a in ANGLE]
    table = read_columns(written(tmp_path / "log.csv", "t;phi", TIME, cells))
    np.testing.assert_allclose(table.columns["phi"], ANGLE, atol=1e-4)


def test_comments_stand_between_rows_and_behind_them(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    rows = [f"{t:.3f},{p:.3f}" for t, p in zip(TIME, FIRST, strict=True)]
    rows[7] += " # valve knocked"
    path.write_text("\n".join(["% t,p", *rows[:50], "# a pause", "% and one", *rows[50:]]))
    table = read_columns(path)
    np.testing.assert_allclose(table.columns["t"], TIME)
    np.testing.assert_allclose(table.columns["p"], FIRST, atol=1e-3)
    assert not table.texts


def test_the_first_column_may_be_a_time_of_any_name_but_not_the_number_of_the_row(rig: Rig) -> None:
    others = {"p1": FIRST, "p2": SECOND, "phi": ANGLE}
    for name, values, is_time in (
        ("X_Value", TIME, True),
        ("n", np.arange(TIME.size, dtype=float), False),
        ("p3", FIRST, False),
    ):
        found = {one.channel for one in propose({name: values, **others}, rig)}
        assert ("time" in found) == is_time, name


def test_a_time_with_too_few_digits_is_named(rig: Rig, tmp_path: Path) -> None:
    stamps = [f"{1.7e12 + 1e3 * t:.5e}" for t in TIME]
    names = "t;p1;p2;phi"
    path = written(tmp_path / "log.csv", names, stamps, FIRST, SECOND, ANGLE)
    (problem,) = import_log(path, rig, tmp_path / "out").problems
    assert "the time has only 1 different values in 400 rows" in problem


def test_what_was_left_out_is_said_on_the_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a log whose angle nobody recognised, nothing was said."""
    names = "t;p1;p2;knee"
    path = written(tmp_path / "log.csv", names, TIME, FIRST, SECOND, ["-"] * 9 + ["1"] * 391)
    example = Path(__file__).parents[2] / "config" / "elbow.yaml"
    main(["import", str(path), "--rig", str(example), "--out", str(tmp_path / "out")])
    out = capsys.readouterr().out
    assert "columns that are not used: 'knee'" in out
    assert "missing: joint_states.elbow.position" in out


def test_a_time_in_seconds_and_nanoseconds_is_both(rig: Rig, tmp_path: Path) -> None:
    """The whole seconds alone were taken for milliseconds, as their steps are too long."""
    whole = [str(1_700_000_000 + int(5.0 * t)) for t in TIME]
    rest = [str(round(5.0 * t % 1.0 * 1e9)) for t in TIME]
    for one, other in (("header.stamp.sec", "header.stamp.nanosec"), ("secs", "nsecs")):
        names = f"{one};{other};p1 [bar];p2 [bar];phi"
        path = written(tmp_path / "log.csv", names, whole, rest, 1e-5 * FIRST, 1e-5 * SECOND, ANGLE)
        found = import_log(path, rig, tmp_path / "out").recording
        assert found is not None
        assert found.sample_time == pytest.approx(0.02)
    found_time = proposed(path, rig)["time"]
    assert found_time.more == (("nsecs", 1e-9),)


@pytest.mark.parametrize(("name", "digits"), [("sec", 0), ("t", 1)])
def test_a_time_with_few_digits_is_still_in_seconds(name: str, digits: int, rig: Rig) -> None:
    stamps = np.round(10.0 * TIME, digits)
    found = propose({name: stamps, "p1": FIRST, "p2": SECOND, "phi": ANGLE}, rig)
    assert (found[0].channel, found[0].unit) == ("time", "")


MULTIPLES: Final = {
    "time": "t [0.1 ms];p1 [bar];p2 [bar];phi",
    "joint_states.elbow.position": "t;p1 [bar];p2 [bar];phi [0.01 deg]",
    PRESSURE: "t;p1 [kPa x10];p2 [bar];phi",
    "pressure_states.elbow_extensor": "t;p1 [bar];p2_10kpa;phi",
}


@pytest.mark.parametrize("channel", MULTIPLES)
def test_a_multiple_of_a_unit_is_not_taken_for_the_unit(
    channel: str, rig: Rig, tmp_path: Path
) -> None:
    columns = (TIME, 1e-5 * FIRST, 1e-5 * SECOND, ANGLE)
    assert channel not in proposed(written(tmp_path / "log.csv", MULTIPLES[channel], *columns), rig)


@pytest.mark.parametrize("unit", ["mA", "V", "mV", "Volt"])
def test_a_raw_signal_is_no_pressure_in_another_unit(unit: str, rig: Rig, tmp_path: Path) -> None:
    """4 to 20 mA were taken for psi."""
    names = f"t;P1 {unit};P2_{unit};phi"
    columns = (TIME, 4.0 + 16e-6 * FIRST, 4.0 + 16e-6 * SECOND, ANGLE)
    assert PRESSURE not in proposed(written(tmp_path / "log.csv", names, *columns), rig)


def test_what_was_computed_of_pressures_is_not_the_pressure_of_a_muscle(rig: Rig) -> None:
    columns = {"t": TIME, "p_mean": FIRST, "p_diff": SECOND, "angle_error": ANGLE, "angle": ANGLE}
    assert {one.channel: one.column for one in propose(columns, rig)} == {
        "time": "t", "joint_states.elbow.position": "angle",
    }  # fmt: skip


def test_a_short_form_of_a_name_is_that_muscle(rig: Rig) -> None:
    columns = {"t": TIME, "p_ext": SECOND, "p_flex": FIRST, "phi": ANGLE}
    found = {one.channel: one.column for one in propose(columns, rig)}
    assert found[PRESSURE] == "p_flex"


def test_columns_that_fit_alike_are_named(rig: Rig, tmp_path: Path) -> None:
    names, columns = "t;p_left;p_right;phi", (TIME, FIRST, SECOND, ANGLE)
    preview = import_log(written(tmp_path / "log.csv", names, *columns), rig, tmp_path / "out")
    assert preview.doubts[0] == f"{PRESSURE}: 'p_right' fits as well as 'p_left'"
    assert "fits as well as" in (tmp_path / "out" / "preview.html").read_text()
    equal = written(tmp_path / "log.csv", names, TIME, FIRST, FIRST, ANGLE)
    assert not any("fits" in text for text in import_log(equal, rig, tmp_path / "out").doubts)


def test_a_unit_that_only_the_size_says_is_to_be_checked(rig: Rig, tmp_path: Path) -> None:
    """Set points from 0 to 1 of a regulator looked like MPa."""
    columns = (1e3 * TIME, 1e-5 * FIRST, 1e-5 * SECOND, np.degrees(ANGLE))
    path = written(tmp_path / "log.csv", "t;p1;p2;phi", *columns)
    told = ["'t': taken for ms by the size", "'p1', 'p2': taken for bar by the size",
            "'phi': taken for deg by the size"]  # fmt: skip
    assert sorted(import_log(path, rig, tmp_path / "out").doubts) == sorted(told)
    stated = written(tmp_path / "log.csv", "t_ms;p1_bar;p2_bar;phi_deg", *columns)
    assert not import_log(stated, rig, tmp_path / "out").doubts


def test_a_pressure_without_a_unit_is_to_be_checked(rig: Rig, tmp_path: Path) -> None:
    """Integers of a public arm, of an unknown unit, passed for Pa without a word."""
    columns = (TIME, 0.3 * FIRST, 0.3 * SECOND, ANGLE)
    path = written(tmp_path / "log.csv", "t_s;obs_ago;obs_ant;phi_rad", *columns)
    doubts = import_log(path, rig, tmp_path / "out").doubts
    assert doubts == ["'obs_ago', 'obs_ant': no unit is stated; taken for Pa"]
    first, second = (f"pressure_states.{muscle.name}" for muscle in rig.muscles)
    ours = written(tmp_path / "log.csv", f"t_s;{first};{second};phi_rad", *columns)
    assert not import_log(ours, rig, tmp_path / "out").doubts


def test_seconds_since_1970_are_seconds_however_slow_the_log(rig: Rig, tmp_path: Path) -> None:
    slow = 1.769e9 + 3.1 * np.arange(TIME.size)
    names = "timestamp;p1_kPa;p2_kPa;phi_rad"
    path = written(tmp_path / "log.csv", names, slow, 1e-3 * FIRST, 1e-3 * SECOND, ANGLE)
    found = propose(read_columns(path).columns, rig)
    assert next(one.unit for one in found if one.channel == "time") == ""


def test_whole_numbers_of_a_pwm_are_no_pressure(rig: Rig, tmp_path: Path) -> None:
    regulated = tuple(
        replace(muscle, valve=replace(muscle.valve, kind="pressure_regulator"))
        for muscle in rig.muscles
    )
    rig = replace(rig, muscles=regulated)
    pwm = np.round(np.linspace(0.0, 255.0, TIME.size))
    path = written(
        tmp_path / "log.csv", "t_s;p1_kPa;p2_kPa;phi_rad;pwm_input1",
        TIME, 1e-3 * FIRST, 1e-3 * SECOND, ANGLE, pwm,
    )  # fmt: skip
    assert "pwm_input1" not in {one.column for one in propose(read_columns(path).columns, rig)}


@pytest.mark.parametrize(
    ("name", "values", "reason"),
    [
        ("phi [gon]", ANGLE, "has another unit; `scale` and `offset`"),
        ("phi", [f"{v:.3f} rad" for v in ANGLE], "holds text such as '0.000 rad' in row 1"),
    ],
)
def test_a_column_that_is_left_out_says_why(
    name: str, values: np.ndarray | list[str], reason: str, rig: Rig, tmp_path: Path
) -> None:
    names = f"t;p1;p2;{name}"
    path = written(tmp_path / "log.csv", names, TIME, FIRST, SECOND, values)
    (doubt,) = (d for d in import_log(path, rig, tmp_path / "out").doubts if "joint" in d)
    assert doubt.startswith(f"joint_states.elbow.position: '{name}' looks like it, but {reason}")


def test_a_contraction_of_a_muscle_on_a_bench_is_explained(rig: Rig, tmp_path: Path) -> None:
    bench = replace(rig, joints=(), muscles=rig.muscles[:1])
    names, contraction = "t;p [bar];contraction [%];load [kg]", 5.0 + 10.0 * ANGLE
    path = written(tmp_path / "log.csv", names, TIME, 1e-5 * FIRST, contraction, 20.0 + ANGLE)
    doubts = import_log(path, bench, tmp_path / "out").doubts
    rest = f"{rig.muscles[0].rest_length:g}"
    assert [text.split(": ", 1)[1] for text in doubts] == [
        f"'contraction [%]' looks like a contraction; for a share of the rest length, write "
        f"`scale: -{rest}, offset: {rest}` (`scale: -0.00{rest[2:]}` for per cent)",
        "'load [kg]' looks like it, but has another unit; `scale` and `offset` of the map can "
        "convert it",
    ]


GROUPED: Final = {
    "English": ("{:,.1f}", "."), "German": ("{:,.1f}", ","), "Swiss": ("{:,.1f}", "'"),
}  # fmt: skip


@pytest.mark.parametrize("form", GROUPED)
def test_marks_between_thousands_are_no_decimal_marks(form: str, rig: Rig, tmp_path: Path) -> None:
    """Only what is below a thousand was read."""

    def cell(value: float) -> str:
        text = f"{value:,.1f}"
        if form == "German":
            return text.translate(str.maketrans(",.", ".,"))
        return text.replace(",", "'") if form == "Swiss" else text

    one, two = ([cell(v) for v in p - 1.9e5] for p in (FIRST, SECOND))
    times = [f"{t:.3f}".replace(".", "," if form == "German" else ".") for t in TIME]
    path = written(tmp_path / "log.csv", "t;p1 [Pa];p2 [Pa]", times, one, two)
    table = read_columns(path)
    np.testing.assert_allclose(table.columns["p1 [Pa]"], FIRST - 1.9e5, atol=0.06)
    assert not table.texts


def test_a_time_before_each_channel_is_read_once(tmp_path: Path) -> None:
    path = written(tmp_path / "log.csv", "Time;p1;Time;p2", TIME, FIRST, TIME, SECOND)
    assert list(read_columns(path).columns) == ["Time", "p1", "p2"]
    other = written(tmp_path / "log.csv", "Time;p1;Time;p2", TIME, FIRST, TIME + 1.0, SECOND)
    with pytest.raises(RecordingError, match="two columns are called 'Time'"):
        read_columns(other)


@pytest.mark.parametrize("mark", [-999.0, 9999.99])
def test_marks_of_an_error_in_a_row_are_no_pressures(mark: float, rig: Rig, tmp_path: Path) -> None:
    """One in a thousand samples was not looked at by the check of units."""
    broken = 1e-5 * FIRST
    broken[[100, 101, 250, 251]] = mark
    names = "t;p1 [bar];p2 [bar];phi"
    path = written(tmp_path / "log.csv", names, TIME, broken, 1e-5 * SECOND, ANGLE)
    recording = import_log(path, rig, tmp_path / "out").recording
    assert recording is not None
    assert np.abs(recording.values[PRESSURE]).max() < 3e5
    assert any("as where a device writes an error" in text for text in recording.repairs)


@pytest.mark.parametrize("values", [np.where(TIME < 0.8, 0.3, 0.1), np.clip(ANGLE, -0.2, 0.2)])
def test_a_joint_that_stands_and_a_sensor_at_its_end_are_no_errors(values: np.ndarray) -> None:
    raw = RawRecording(Path("log"), {"joint_states.elbow.position": RawChannel(TIME, values)})
    assert not resample(raw).repairs


@pytest.mark.parametrize(("scale", "shift"), [(1.0, 0.0), (0.5, 0.5), (0.2, 0.3)])
def test_an_opening_counted_from_the_exhaust_is_refused(
    scale: float, shift: float, rig: Rig, tmp_path: Path
) -> None:
    """A 5/3 valve is shut at half of its signal; the openings were read as they stand."""
    opening = 0.8 * np.cos(5.0 * TIME)
    names = "t;p1;p2;phi;u1;u2"
    commands = (shift + scale * opening, shift - scale * opening)
    path = written(tmp_path / "log.csv", names, TIME, FIRST, SECOND, ANGLE, *commands)
    problems = import_log(path, rig, tmp_path / "out").problems
    assert [("is never below 0, and" in text) for text in problems] == [True] * (shift > 0.0)


def test_a_table_without_names_gets_them_from_the_map(
    rig: Rig, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Public logs of a bench and of a platform begin with numbers."""
    path = tmp_path / "log.csv"
    np.savetxt(path, np.column_stack([TIME, FIRST, SECOND, ANGLE]), delimiter=",")
    rig_path, map_path, out = tmp_path / "rig.yaml", tmp_path / "map.yaml", str(tmp_path / "out")
    save_rig(rig, rig_path)
    given = ["import", str(path), "--rig", str(rig_path), "--out", out]
    assert main(given) == 2
    assert "or in the map, as `names: [...]`" in capsys.readouterr().err
    first, second = (f"pressure_states.{muscle.name}" for muscle in rig.muscles)
    channels = f"{{{first}: p1, {second}: p2, joint_states.elbow.position: phi}}"
    map_path.write_text(f"names: [t, p1, p2, phi]\ntime: t\nchannels: {channels}\n")
    assert main([*given, "--map", str(map_path)]) == 0
    read = import_recording(tmp_path / "out" / "recording.parquet")
    assert np.ptp(read.values[first]) == pytest.approx(np.ptp(FIRST), rel=0.01)
    for names, said in (
        ("[t, p1, p2]", "it has 4 columns, and `names` in the map are 3"),
        ("[t, p1, p1, phi]", "expected a list with one name for each column"),
        ("t", "expected a list with one name for each column"),
    ):
        map_path.write_text(f"names: {names}\ntime: t\nchannels: {channels}\n")
        assert main([*given, "--map", str(map_path)]) == 2
        assert said in capsys.readouterr().err
    named = written(path, "t;p1;p2;phi", TIME, FIRST, SECOND, ANGLE)
    map_path.write_text(f"names: [t, p1, p2, phi]\ntime: t\nchannels: {channels}\n")
    with pytest.raises(RecordingError, match="expected no `names` in the map"):
        import_log(named, rig, tmp_path / "out", map_path=map_path)
