"""A table with one row for each sample of each signal is read as one column per signal."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
import pytest

from pam_gap.import_log.import_log import import_log
from pam_gap.import_log.propose_map import propose
from pam_gap.recordings.column_map import load_column_map
from pam_gap.recordings.import_csv import read_columns
from pam_gap.recordings.import_recording import import_recording
from pam_gap.recordings.recording import RecordingError
from pam_model.rig import Rig

TIME: Final = np.arange(400) * 0.004
FIRST, SECOND = (2.0 + s * 0.6 * np.sin(5.0 * TIME) for s in (1.0, -1.0))  # bar
ANGLE: Final = 15.0 * np.sin(5.0 * TIME)  # deg
COMMAND: Final = np.where(TIME < 0.8, 0.2, -0.1)
SIGNALS: Final = {  # unit, values, and how much later than the first it is sampled [s]
    "p1": ("bar", FIRST, 0.0),
    "p2": ("bar", SECOND, 0.0004),
    "angle": ("deg", ANGLE, 0.0011),
    "u1": ("", COMMAND, 0.0017),
    "u2": ("", -COMMAND, 0.0021),
}
STATE: Final = ((0.0001, "state", "", "idle"), (0.5, "state", "", "running"))
FLEXOR, EXTENSOR = "pressure_states.elbow_flexor", "pressure_states.elbow_extensor"
Row = tuple[float, str, str, str]


def samples(*, later: bool = True) -> list[Row]:
    """Time, signal, unit and value of each sample in the order of time, with a word among them."""
    rows = [
        (float(t) + late * later, name, unit, f"{value:.5f}")
        for name, (unit, values, late) in SIGNALS.items()
        for t, value in zip(TIME, values, strict=True)
    ]
    return sorted([*rows, *STATE])


def iso(time: float) -> str:
    return f"{np.datetime64('2026-03-04T23:59:59') + np.timedelta64(round(1e6 * time), 'us')}Z"


def plain(rows: list[Row]) -> str:
    return "time,signal,value\n" + "".join(f"{t:.4f},{n},{v}\n" for t, n, _, v in rows)


def of_a_bus(rows: list[Row]) -> str:
    lines = (f"{t:.4f},can0,0x10{len(n)},{n},{v},{u}\n" for t, n, u, v in rows)
    return "Time,Bus,ID,Signal,Value,Unit\n" + "".join(lines)


def of_a_broker(rows: list[Row]) -> str:
    lines = (f"{1.7e12 + 1e3 * t:.1f};rig/{n};{v}\n" for t, n, _, v in rows)
    return "timestamp;topic;payload\n" + "".join(lines)


def of_a_panel(rows: list[Row]) -> str:
    by_name = sorted(rows, key=lambda row: row[1])
    return '"Series";"Time";"Value"\n' + "".join(f'"{n}";{iso(t)};{v}\n' for t, n, _, v in by_name)


def of_a_database(rows: list[Row]) -> str:
    """Annotated, in the order of signals, with the names above each of them."""
    text = "#group,false,false,true,false,false,true,true\n#default,_result,,,,,,\n"
    for place, signal in enumerate([*SIGNALS, "state"]):
        text += ",result,table,_start,_time,_value,_field,_measurement\n"
        own = (row for row in rows if row[1] == signal)
        start = "2026-03-04T00:00:00Z"
        text += "".join(f",,{place},{start},{iso(t)},{v},{n},arm\n" for t, n, _, v in own)
    return text


def of_a_historian(rows: list[Row]) -> str:
    lines = (f"{n};{iso(t)[:-1].replace('T', ' ')};{v};Good\n" for t, n, _, v in rows)
    return "TagName;TimeStamp;Value;Quality\n" + "".join(lines).replace(".", ",")


EXPORTS: Final = (plain, of_a_bus, of_a_broker, of_a_panel, of_a_database, of_a_historian)


@pytest.mark.parametrize("export", EXPORTS)
def test_every_signal_is_a_channel_with_its_own_times(
    export: Callable[[list[Row]], str], rig: Rig, tmp_path: Path
) -> None:
    """The values of all signals were one column, which was taken for a pressure or left out."""
    path = tmp_path / "log.csv"
    path.write_text(export(samples()))
    found = import_log(path, rig, tmp_path / "out", is_rough=True)
    assert not found.problems
    recording = found.recording
    assert recording is not None
    assert not recording.one_clock
    assert recording.sample_time == pytest.approx(0.004)
    begin = 0.0021  # when every signal is known
    for channel, name in (
        (FLEXOR, "p1"),
        (EXTENSOR, "p2"),
        ("joint_states.elbow.position", "angle"),
        ("valve_commands.elbow_flexor", "u1"),
        ("valve_commands.elbow_extensor", "u2"),
    ):
        _, values, late = SIGNALS[name]
        factor = {"p": 1e5, "a": np.pi / 180.0}.get(name[0], 1.0)
        true = factor * np.interp(recording.time + begin, TIME + late, values)
        held = name.startswith("u")
        near = np.abs(recording.values[channel] - true) < (0.31 if held else 0.002 * factor)
        assert near.all()
    assert not any("missing samples" in text for text in recording.repairs)


def test_signals_at_the_same_times_share_their_rows(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(plain([row for row in samples(later=False) if row[1] != "state"]))
    table = read_columns(path)
    assert table.one_clock
    assert list(table.columns) == ["time", "angle", "p1", "p2", "u1", "u2"]
    np.testing.assert_allclose(table.columns["time"], TIME, atol=1e-4)
    np.testing.assert_allclose(table.columns["p1"], FIRST, atol=1e-4)


def test_a_signal_that_is_a_word_is_no_number_and_takes_nothing_with_it(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(plain(samples()))
    table = read_columns(path)
    assert table.texts["state"].first == "idle"
    assert not np.isfinite(table.columns["state"]).any()
    assert np.isfinite(table.columns["p1"]).sum() == TIME.size


@pytest.mark.parametrize("suffix", [".jsonl", ".json", ".parquet"])
def test_long_tables_of_other_formats_are_read_alike(suffix: str, rig: Rig, tmp_path: Path) -> None:
    """Text in a list of JSON was left out, dates too."""
    path = tmp_path / f"log{suffix}"
    rows = [
        {"ts": iso(t), "topic": name, "value": float(v)}
        for t, name, _, v in samples()
        if name != "state"
    ]
    if suffix == ".parquet":
        pd.DataFrame(rows).assign(ts=lambda of: pd.to_datetime(of["ts"])).to_parquet(path)
    elif suffix == ".json":
        path.write_text(json.dumps(rows))
    else:
        path.write_text("\n".join(map(json.dumps, rows)))
    found = import_log(path, rig, tmp_path / "out", is_rough=True)
    assert not found.problems
    assert found.recording is not None
    assert np.ptp(found.recording.values[FLEXOR]) == pytest.approx(1.2e5, rel=0.01)


def test_a_table_with_the_muscle_in_a_column_has_one_pressure_for_each(
    rig: Rig, tmp_path: Path
) -> None:
    """The pressures of both muscles were taken for that of the first."""
    rows = "".join(
        f"{t:.3f},{muscle},{p:.4f},{u:.3f}\n"
        for t, *both in zip(TIME, FIRST, SECOND, COMMAND, strict=True)
        for muscle, p, u in (("flexor", both[0], both[2]), ("extensor", both[1], -both[2]))
    )
    path = tmp_path / "log.csv"
    path.write_text(f"time,muscle,pressure_bar,command\n{rows}")
    found = {one.channel: one.column for one in propose(read_columns(path).columns, rig)}
    assert found[FLEXOR] == "flexor.pressure_bar"
    assert found[EXTENSOR] == "extensor.pressure_bar"
    assert found["valve_commands.elbow_extensor"] == "extensor.command"


def test_a_tag_that_differs_between_signals_is_a_part_of_the_name(tmp_path: Path) -> None:
    """Without it, the pressures of two muscles would be one signal."""
    rows = "".join(
        f"{t:.3f},pressure,{side},{p:.4f},{'idle' if t < 0.5 else 'running'}\n"
        for t, *both in zip(TIME, FIRST, SECOND, strict=True)
        for side, p in (("left", both[0]), ("right", both[1]))
    )
    path = tmp_path / "log.csv"
    path.write_text(f"_time,_field,limb,_value,mode\n{rows}")
    assert list(read_columns(path).columns) == ["_time", "pressure.left", "pressure.right"]


@pytest.mark.parametrize(
    ("names", "cell"),
    [
        ("time,state,p1,p2", lambda k: "running" if k > 100 else "idle"),
        ("time,channel,p1,p2", lambda k: f"{15.0 * np.sin(0.02 * k):.0f}"),
        ("time,id,p1,value", lambda k: f"{k}"),
        ("time,message,p1,p2", lambda k: "valve stuck" if k == 200 else ""),
        ("time,message,p1_value,p2_value", lambda k: "valve stuck" if k == 200 else ""),
        ("time,device_id,p1_value,p2_value", lambda _: "rig"),
    ],
)
def test_a_table_with_a_column_per_signal_stays_as_it_is(
    names: str, cell: Callable[[int], str], tmp_path: Path
) -> None:
    rows = [
        f"{t:.3f},{cell(k)},{FIRST[k]:.4f},{SECOND[k]:.4f}" for k, t in enumerate(TIME.tolist())
    ]
    path = tmp_path / "log.csv"
    path.write_text("\n".join([names, *rows]))
    table = read_columns(path)
    assert list(table.columns) == names.split(",")
    assert table.one_clock


def test_a_signal_with_two_units_is_refused(tmp_path: Path) -> None:
    rows = [
        f"{t:.3f},{name},2.0,{'kPa' if t > 1.0 and name == 'p1' else 'bar'}"
        for t in TIME
        for name in ("p1", "p2")
    ]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["time,signal,value,unit", *rows]))
    with pytest.raises(RecordingError, match="'p1' has the units 'bar', 'kPa'; expected one"):
        read_columns(path)


def test_a_signal_called_like_the_time_is_refused(tmp_path: Path) -> None:
    rows = [f"{t:.3f},{name},1.5" for t in TIME for name in ("time", "p1")]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["time,signal,value", *rows]))
    with pytest.raises(RecordingError, match="two columns are called 'time'"):
        read_columns(path)


def test_a_sum_of_signals_without_a_common_time_is_refused(tmp_path: Path) -> None:
    path, place = tmp_path / "log.csv", tmp_path / "map.yaml"
    path.write_text(plain(samples()))
    place.write_text(f"time: time\nchannels: {{{FLEXOR}: {{columns: {{p1: 1, p2: 1}}}}}}")
    with pytest.raises(RecordingError, match="'p1', 'p2' have no time in common"):
        import_recording(path, column_map=load_column_map(place))


def test_a_time_in_ms_is_found_although_the_signals_take_turns(rig: Rig, tmp_path: Path) -> None:
    """The steps between two signals, of tenths of a millisecond, looked like seconds."""
    rows = "".join(f"{1e3 * t:.2f},{name},{v}\n" for t, name, _, v in samples())
    path = tmp_path / "log.csv"
    path.write_text(f"t,signal,value\n{rows}")
    found = {one.channel: one.unit for one in propose(read_columns(path).columns, rig)}
    assert found["time"] == "ms"
