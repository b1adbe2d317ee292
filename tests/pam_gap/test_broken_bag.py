"""Bags that were never finished or lost their end: read as far as they are whole, and said so."""

from __future__ import annotations

import os
import random
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import textwrap
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from pam_bringup.viewer.robot_view import RobotView
from pam_bringup.viewer.show_bag import show_bag
from pam_gap.__main__ import main as pam_gap
from pam_gap.fleet.recording_time import time_of
from pam_gap.recordings.column_map import load_column_map
from pam_gap.recordings.import_recording import import_recording
from pam_gap.recordings.recording import RecordingError
from support.rigs import ELBOW

POSITION = "joint_states.elbow.position"
PERIOD = 4_000_000  # ns
COUNT = 15_000  # 60 s, some chunks
MCAP, SQLITE = StoragePlugin.MCAP, StoragePlugin.SQLITE3


def angle(k: np.ndarray) -> np.ndarray:
    return 0.4 * np.sin(0.01 * k)


def write_bag(folder: Path, plugin: StoragePlugin, packed: bool = False) -> Path:
    store = get_typestore(Stores.ROS2_JAZZY)
    state = store.types["sensor_msgs/msg/JointState"]
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    writer = Writer(folder, version=9, storage_plugin=plugin)
    if packed:
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        link = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
        for k in range(COUNT):
            now = 1_700_000_000_000_000_000 + k * PERIOD
            message = state(
                header=header(stamp(now // 10**9, now % 10**9), "a frame with a long name" * 4),
                name=["elbow"],
                position=np.array([angle(np.array(k)).item()]),
                velocity=np.zeros(0),
                effort=np.zeros(0),
            )
            writer.write(link, now, store.serialize_cdr(message, state.__msgtype__))
    return folder


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    root = tmp_path_factory.mktemp("whole")
    return {
        "mcap": write_bag(root / "plain", MCAP),
        "packed": write_bag(root / "packed", MCAP, packed=True),
        "db3": write_bag(root / "table", SQLITE),
    }


def cut(bag: Path, folder: Path, share: float, *, metadata: bool) -> Path:
    """A copy of a bag that ends early."""
    shutil.copytree(bag, folder)
    if not metadata:
        (folder / "metadata.yaml").unlink()
    storage = next(child for child in folder.iterdir() if child.suffix in (".mcap", ".db3"))
    os.truncate(storage, int(share * storage.stat().st_size))
    return folder


# a database of this size is cut in half with the only page that leads to its rows
@pytest.mark.parametrize(("kind", "share"), [("mcap", 0.6), ("packed", 0.6), ("db3", 0.9)])
@pytest.mark.parametrize("metadata", [True, False])
def test_a_bag_cut_short_is_read_to_there(bags, tmp_path, kind, share, metadata) -> None:
    recording = import_recording(cut(bags[kind], tmp_path / "bag", share, metadata=metadata))
    values = recording.values[POSITION]
    assert 0.2 * COUNT < values.size < 0.95 * COUNT
    np.testing.assert_allclose(values, angle(np.arange(values.size)), atol=1e-6)
    said = recording.repairs[0]
    told = re.search(r"ends in the middle of .*: ([\d.]+) s (of .* s )?read", said)
    assert told, said
    assert float(told[1]) == pytest.approx(recording.duration, abs=0.1)
    if metadata:
        assert "s of 60.0 s read" in said


def test_a_plain_chunk_cut_in_the_middle_is_read_to_its_last_message(bags, tmp_path) -> None:
    share = 0.6
    plain = import_recording(cut(bags["mcap"], tmp_path / "plain", share, metadata=True))
    assert plain.values[POSITION].size == pytest.approx(share * COUNT, rel=0.1)
    assert "in the middle of a chunk" in plain.repairs[0]


@pytest.mark.parametrize("kind", ["mcap", "db3"])
def test_a_bag_without_metadata_is_read_whole(bags, tmp_path, kind) -> None:
    folder = cut(bags[kind], tmp_path / "bag", 1.0, metadata=False)
    recording = import_recording(folder)
    assert recording.values[POSITION].size == COUNT
    assert "never finished" in recording.repairs[0]


def test_a_spoilt_chunk_is_left_out_and_counted(bags, tmp_path) -> None:
    """Even the first, which holds the definitions of all: the summary has them again."""
    folder = cut(bags["packed"], tmp_path / "bag", 1.0, metadata=True)
    storage = folder / "packed.mcap"
    data = bytearray(storage.read_bytes())
    place = data.index(b"zstd") + 12  # the compressed bytes begin
    data[place : place + 2000] = random.Random(1).randbytes(2000)
    storage.write_bytes(data)
    recording = import_recording(folder)
    assert 0.3 * COUNT < recording.values[POSITION].size < COUNT
    assert "1 chunks cannot be read and are not used" in recording.repairs[0]


@pytest.mark.sampled("each kind of bag, with or without its metadata")
@pytest.mark.parametrize(("kind", "share"), [("mcap", 0.6), ("packed", 0.6), ("db3", 0.9)])
@pytest.mark.parametrize("metadata", [True, False])
def test_an_import_reads_a_bag_cut_short_as_a_diagnosis_does(
    bags, tmp_path, kind, share, metadata, capsys
) -> None:
    """The same samples, a warning on the terminal and the same words on the page."""
    bag = cut(bags[kind], tmp_path / "bag", share, metadata=metadata)
    arguments = ["import", str(bag), "--rig", str(ELBOW), "--out", str(tmp_path / "out")]
    assert pam_gap(arguments) == 0
    plain = import_recording(bag)
    assert f"warning: {plain.repairs[0]}\n" in capsys.readouterr().err
    page = (tmp_path / "out" / "preview.html").read_text()
    assert page.count(plain.repairs[0]) == 2  # at the top and among the repairs
    column_map = load_column_map(tmp_path / "out" / "map.yaml")
    mapped = import_recording(bag, column_map=column_map)
    np.testing.assert_array_equal(mapped.values[POSITION], plain.values[POSITION])


def test_a_whole_bag_is_imported_without_a_warning(bags, tmp_path, capsys) -> None:
    out = str(tmp_path / "out")
    assert pam_gap(["import", str(bags["mcap"]), "--rig", str(ELBOW), "--out", out]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("kind", ["mcap", "db3"])
def test_the_viewer_and_the_dates_of_a_fleet_know_a_bag_cut_short(
    bags, tmp_path, rig, kind, capsys
) -> None:
    bag = cut(bags[kind], tmp_path / "bag", 0.9, metadata=False)
    view = RobotView(rig, Mock())
    assert 0.2 * COUNT < show_bag(bag, "", view) < COUNT
    assert "warning: " in capsys.readouterr().err
    assert time_of(bag) == time_of(bags[kind])


@pytest.mark.parametrize("kind", ["mcap", "packed", "db3"])
def test_damage_anywhere_ends_in_a_recording_or_one_line(bags, tmp_path, kind) -> None:
    draw = random.Random(kind)
    whole = next(child for child in bags[kind].iterdir() if child.suffix in (".mcap", ".db3"))
    data = whole.read_bytes()[: 1 << 18]  # what the walk over it costs grows with its size
    for number in range(60):
        spoilt = bytearray(data[: draw.choice((draw.randrange(200), draw.randrange(len(data))))])
        for _ in range(draw.choice((0, 1, 30)) if spoilt else 0):
            spoilt[draw.randrange(len(spoilt))] = draw.randrange(256)
        path = tmp_path / f"{number}{whole.suffix}"
        path.write_bytes(spoilt)
        try:
            recording = import_recording(path)
        except RecordingError as error:
            assert "\n" not in str(error)
        else:
            assert recording.repairs
        path.unlink()


def test_a_writer_killed_within_a_transaction_leaves_what_was_committed(bags, tmp_path) -> None:
    """As rosbag2's SQLite storage: its journal takes back what was half written."""
    folder = shutil.copytree(bags["db3"], tmp_path / "bag")
    (folder / "metadata.yaml").unlink()
    script = f"""
        import os, signal, sqlite3
        bag = sqlite3.connect({str(folder / "table.db3")!r}, isolation_level=None)
        bag.execute("PRAGMA cache_size = 4")
        bag.execute("BEGIN")
        bag.execute("UPDATE messages SET data = zeroblob(300)")
        os.kill(os.getpid(), signal.SIGKILL)
    """
    killed = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)], check=False, timeout=60
    )
    assert killed.returncode == -signal.SIGKILL
    assert (folder / "table.db3-journal").stat().st_size > 0
    recording = import_recording(folder)
    assert recording.values[POSITION].size == COUNT
    np.testing.assert_allclose(recording.values[POSITION], angle(np.arange(COUNT)), atol=1e-6)
    assert "never finished" in recording.repairs[0]


@pytest.mark.parametrize("name", ["bag.mcap", "bag.db3"])
@pytest.mark.parametrize("content", [b"", b"no bag at all", bytes(5000)])
def test_what_is_no_bag_is_refused_in_one_line(tmp_path, name, content) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError) as caught:
        import_recording(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_names_in_a_database_are_quoted(tmp_path) -> None:
    """A column's name comes from the file and is no command."""
    path = tmp_path / "bag.db3"
    with sqlite3.connect(path) as bag:
        bag.execute('CREATE TABLE topics (id, "x"") ; DROP TABLE messages; --")')
        bag.execute("CREATE TABLE messages (id, topic_id, timestamp, data)")
    with pytest.raises(RecordingError):
        import_recording(path)
