"""Tables with other names, units and formats, read with a map of their columns."""

import json
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat

from pam_gap.recordings.array_files import read_arrays
from pam_gap.recordings.column_map import load_column_map
from pam_gap.recordings.import_recording import import_recording
from pam_gap.recordings.recording import RecordingError

FLEXOR = "pressure_states.elbow_flexor"
EXTENSOR = "pressure_states.elbow_extensor"
POSITION = "joint_states.elbow.position"
COMMAND = "valve_commands.elbow_flexor"
TIME = np.arange(400) * 0.002
GAUGE = 2e5 + 5e4 * np.sin(5.0 * TIME)
ANGLE = 0.3 * np.sin(5.0 * TIME)
LOG = {
    "t": 1e3 * TIME,
    "p1": 1e-5 * (GAUGE + 101325.0),
    "phi": -np.degrees(ANGLE),
    "u1": 100.0 * ANGLE,
}
MAP = f"""
time: {{column: t, unit: ms}}
channels:
  {FLEXOR}: {{column: p1, unit: bar, absolute: true}}
  {POSITION}: {{column: phi, unit: deg, sign: -1, offset: 0.5}}
  {COMMAND}: {{column: u1, unit: per cent}}
"""


def write(path: Path, suffix: str) -> Path:
    file = path / f"log{suffix}"
    if suffix == ".npz":
        np.savez(file, **LOG, note=np.array("text"))
    elif suffix == ".mat":
        savemat(file, {**LOG, "fs": 500.0})
    elif suffix == ".7.3.mat":
        with h5py.File(file, "w", userblock_size=512) as table:  # as MATLAB writes -v7.3
            for name, column in LOG.items():
                table[name] = column[None]
    elif suffix == ".h5":
        with h5py.File(file, "w") as table:
            for name, column in LOG.items():
                table[name] = column
            table["remark"] = "text"
    elif suffix == ".json":
        file.write_text(json.dumps({k: v.tolist() for k, v in LOG.items()} | {"robot": "left"}))
    elif suffix == ".jsonl":
        rows = [
            dict(zip(LOG, map(float, row), strict=True)) for row in zip(*LOG.values(), strict=True)
        ]
        file.write_text("\n".join(map(json.dumps, rows)))
    elif suffix == ".parquet":
        pd.DataFrame(LOG).to_parquet(file)
    else:
        pd.DataFrame(LOG).to_csv(file, index=False)
    return file


@pytest.mark.parametrize(
    "suffix", [".csv", ".csv.gz", ".parquet", ".npz", ".mat", ".7.3.mat", ".h5", ".json", ".jsonl"]
)
def test_units_signs_and_names_of_any_table_are_mapped(tmp_path: Path, suffix: str) -> None:
    (tmp_path / "map.yaml").write_text(MAP)
    column_map = load_column_map(tmp_path / "map.yaml")
    recording = import_recording(write(tmp_path, suffix), column_map=column_map)
    assert recording.sample_time == pytest.approx(0.002)
    np.testing.assert_allclose(recording.values[FLEXOR], GAUGE, rtol=1e-6)
    np.testing.assert_allclose(recording.values[POSITION], ANGLE + 0.5, atol=1e-6)
    np.testing.assert_allclose(recording.values[COMMAND][1:-1], ANGLE[1:-1], atol=1e-6)
    assert "map.yaml" in recording.repairs[0]


def test_a_table_without_a_time_has_a_rate_and_arrays_have_columns(tmp_path: Path) -> None:
    savemat(tmp_path / "log.mat", {"p": np.stack([GAUGE, 2.0 * GAUGE])})
    (tmp_path / "map.yaml").write_text(
        f"rate: 250\nchannels: {{{FLEXOR}: p.0, {EXTENSOR}: {{column: p.1, scale: 0.5}}}}\n"
    )
    recording = import_recording(
        tmp_path / "log.mat", column_map=load_column_map(tmp_path / "map.yaml")
    )
    assert recording.sample_time == pytest.approx(0.004)
    for name in (FLEXOR, EXTENSOR):
        np.testing.assert_allclose(recording.values[name], GAUGE, rtol=1e-9)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("channels: [", "not a readable map"),
        ("time: t", "no `channels`"),
        (f"time: t\nrate: 5\nchannels: {{{FLEXOR}: p1}}", "either `time` or `rate`"),
        (f"rate: 5\nchannels: {{{FLEXOR}: {{columns: {{}}}}}}", "`columns` is empty"),
        (f"rate: 5\nchannels: {{{FLEXOR}: {{columns: {{a: x}}}}}}", "a is 'x'; expected a number"),
        (f"rate: 5\nchannels: {{{FLEXOR}: {{columns: {{a: 1}}, column: b}}}}", "expected the name"),
        (f"rate: 0\nchannels: {{{FLEXOR}: p1}}", "rate is 0; expected Hz"),
        (f"rate: 5\nchannels: {{{FLEXOR}: {{column: p1, unit: torr}}}}", "unit 'torr'; expected"),
        (f"rate: 5\nchannels: {{{FLEXOR}: {{column: p1, units: bar}}}}", "unknown key 'units'"),
        (f"rate: 5\nchannels: {{{FLEXOR}: {{column: p1, sign: 2}}}}", "a sign of 1 or -1"),
        (f"rate: 5\nchannels: {{{FLEXOR}: {{column: p1, scale: x}}}}", "scale is 'x'"),
        (f"rate: 5\nchannels: {{{FLEXOR}: 3}}", "expected the name of a column"),
        (f"rate: 5\nchannels: {{{POSITION}: {{column: a, absolute: true}}}}", "only a pressure"),
        (
            f"rate: 5\nchannels: {{{FLEXOR}: p, {POSITION}: {{column: a, held: 1}}}}",
            "one of `column`",
        ),
        (f"rate: 5\nchannels: {{{FLEXOR}: p1, {COMMAND}: {{held: 1}}}}", "only a length"),
        (f"rate: 5\nchannels: {{{POSITION}: {{held: 0.2}}}}", "no column is mapped"),
        ("rate: 5\nchannels: {pressure.flexor: p1}", "'pressure.flexor': no channel"),
        (f"rate: 5\nchannels: {{{FLEXOR}: p1, {FLEXOR}: p2}}", f"{FLEXOR} appears twice"),
        ("rate: 5\nrate: 6\nchannels: {}", "line 2: rate appears twice"),
        (
            f"rate: 5\nchannels: {{{FLEXOR}: {{column: p1, absolute: 'false'}}}}",
            "absolute is 'false'; expected true or false",
        ),
        (
            f"rate: 5\nchannels: {{{FLEXOR}: {{column: p1, ambient: 95000}}}}",
            "`ambient` needs `absolute: true`",
        ),
        (
            f"rate: 5\nchannels: {{{FLEXOR}: {{column: p1, absolute: true, ambient: 1.013}}}}",
            "ambient is 1.013; expected 30000 to 130000 Pa absolute; looks like bar",
        ),
    ],
)
def test_mistakes_in_a_map_are_one_line(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "map.yaml").write_text(text)
    with pytest.raises(RecordingError) as error:
        load_column_map(tmp_path / "map.yaml")
    assert told in str(error.value)
    assert str(error.value).startswith(str(tmp_path / "map.yaml"))
    assert "\n" not in str(error.value)


def test_a_column_that_is_missing_is_named_with_those_there_are(tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(MAP.replace("p1", "p9"))
    file = write(tmp_path, ".csv")
    with pytest.raises(RecordingError, match=r"no column 'p9', .*it has 't', 'p1', 'phi', 'u1'"):
        import_recording(file, column_map=load_column_map(tmp_path / "map.yaml"))


@pytest.mark.parametrize("suffix", [".mat", ".h5", ".json", ".jsonl", ".npz"])
def test_a_broken_file_of_arrays_is_one_line(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"log{suffix}"
    for content in (b"\x89HDF\r\n\x1a\n" + bytes(600), b"no matrix", b"[]", b"\xff\xfe"):
        file.write_bytes(content)
        with pytest.raises(RecordingError, match="not a readable table") as error:
            import_recording(file)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(("line", "column"), [('{"t": 0.1, "p": }', 17), ("{} {}", 4), ("?", 1)])
def test_a_damaged_line_of_a_log_is_named_by_its_number(
    tmp_path: Path, line: str, column: int
) -> None:
    file = tmp_path / "log.jsonl"
    file.write_text(f'{{"t": 0.0, "p": 1}}\n\n{line}\n{{"t": 0.2, "p": 3}}\n')
    with pytest.raises(RecordingError, match=rf"\(line 3, column {column}: .+\)$"):
        import_recording(file)


def test_structures_and_rows_of_objects_have_names_with_dots(tmp_path: Path) -> None:
    savemat(tmp_path / "log.mat", {"arm": {"t": TIME, "p": np.stack([GAUGE, GAUGE])}, "fs": 500.0})
    rows = [{"t": t, "joint": {"q": [a, 0.0]}} for t, a in zip(TIME, ANGLE, strict=True)]
    (tmp_path / "log.json").write_text(json.dumps(rows))
    assert set(read_arrays(tmp_path / "log.mat")) == {"arm.t", "arm.p.0", "arm.p.1"}
    assert set(read_arrays(tmp_path / "log.json")) == {"t", "joint.q.0", "joint.q.1"}
    np.testing.assert_allclose(read_arrays(tmp_path / "log.json")["joint.q.0"], ANGLE)


def test_a_length_that_is_held_needs_no_column(tmp_path: Path) -> None:
    place = "muscle_states.elbow_flexor.position"
    text = MAP + f"  {place}: {{held: 174.5, unit: mm}}\n"
    (tmp_path / "map.yaml").write_text(text)
    recording = import_recording(
        write(tmp_path, ".npz"), column_map=load_column_map(tmp_path / "map.yaml")
    )
    assert recording.values[place] == pytest.approx(0.1745)
    assert recording.values[place].size == recording.values[FLEXOR].size


def test_a_log_of_mean_and_differential_pressure_gives_both_pressures(tmp_path: Path) -> None:
    table = {"t": TIME, "mean": 1e-5 * GAUGE, "difference": 1e-5 * 2e4 * ANGLE}
    pd.DataFrame(table).to_csv(tmp_path / "log.csv", index=False)
    (tmp_path / "map.yaml").write_text(
        "time: t\nchannels:\n"
        f"  {FLEXOR}: {{columns: {{mean: 1, difference: 0.5}}, unit: bar}}\n"
        f"  {EXTENSOR}: {{columns: {{mean: 1, difference: -0.5}}, unit: bar}}\n"
    )
    recording = import_recording(
        tmp_path / "log.csv", column_map=load_column_map(tmp_path / "map.yaml")
    )
    np.testing.assert_allclose(recording.values[FLEXOR], GAUGE + 1e4 * ANGLE, rtol=1e-6)
    np.testing.assert_allclose(recording.values[EXTENSOR], GAUGE - 1e4 * ANGLE, rtol=1e-6)


def write_bag(path: Path, kind: str) -> Path:
    """A bag of another robot: a list of numbers without stamps, and a JointState with names."""
    store = get_typestore(Stores.ROS1_NOETIC if kind == "rosbag1" else Stores.ROS2_JAZZY)
    types = store.types
    header: dict[str, object] = {"seq": 0} if kind == "rosbag1" else {}
    layout = types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    if kind == "rosbag1":
        writer = Writer1(path / "log.bag")
    else:
        writer = Writer(path / "bag", version=9, storage_plugin=StoragePlugin[kind])
    write = store.serialize_ros1 if kind == "rosbag1" else store.serialize_cdr
    with writer as bag:
        names = {
            "/arm/bar": "std_msgs/msg/Float64MultiArray",
            "/arm/j": "sensor_msgs/msg/JointState",
        }
        connections = {t: bag.add_connection(t, n, typestore=store) for t, n in names.items()}
        for t, p, q in zip(TIME, GAUGE, ANGLE, strict=True):
            at = 1_700_000_000_000_000_000 + round(1e9 * t)
            stamp = types["builtin_interfaces/msg/Time"](at // 10**9, at % 10**9)
            messages = {
                "/arm/bar": types[names["/arm/bar"]](layout, 1e-5 * np.array([p, 2.0 * p])),
                "/arm/j": types[names["/arm/j"]](
                    types["std_msgs/msg/Header"](**header, stamp=stamp, frame_id=""),
                    ["shoulder", "elbow"], np.array([0.0, q]), np.zeros(0), np.zeros(0),
                ),
            }  # fmt: skip
            for topic, message in messages.items():
                data = write(message, names[topic])
                bag.write(connections[topic], at, bytes(data))
    return path / ("log.bag" if kind == "rosbag1" else "bag")


@pytest.mark.parametrize("kind", ["MCAP", "SQLITE3", "rosbag1"])
def test_a_bag_of_other_topics_is_mapped_with_its_own_stamps(tmp_path: Path, kind: str) -> None:
    (tmp_path / "map.yaml").write_text(
        "channels:\n"
        f"  {FLEXOR}: {{column: /arm/bar.data.0, unit: bar}}\n"
        f"  {EXTENSOR}: {{columns: {{/arm/bar.data.1: 0.5, /arm/bar.data.0: 0}}, unit: bar}}\n"
        f"  {POSITION}: /arm/j.position.elbow\n"
    )
    bag = write_bag(tmp_path, kind)
    column_map = load_column_map(tmp_path / "map.yaml")
    recording = import_recording(bag, column_map=column_map)
    for name in (FLEXOR, EXTENSOR):
        np.testing.assert_allclose(recording.values[name], GAUGE[: recording.time.size], rtol=1e-6)
    np.testing.assert_allclose(recording.values[POSITION], ANGLE, atol=1e-6)
    (tmp_path / "map.yaml").write_text(f"channels: {{{FLEXOR}: /arm/bar.data.7}}")
    with pytest.raises(RecordingError, match=r"no column '/arm/bar\.data\.7'"):
        import_recording(bag, column_map=load_column_map(tmp_path / "map.yaml"))
    (tmp_path / "map.yaml").write_text(f"rate: 5\nchannels: {{{FLEXOR}: /arm/bar.data.0}}")
    with pytest.raises(RecordingError, match=r"`names`, `time` and `rate` are for tables"):
        import_recording(bag, column_map=load_column_map(tmp_path / "map.yaml"))
