"""Reads recordings that are rosbag2 folders (MCAP or SQLite), without a ROS installation.

The time of a value is the stamp of its header, which is the time of measurement. If a publisher
leaves the stamp at zero, the time of recording is used, with a remark. A bag that was never
finished or is cut short is read as far as it is intact; a remark says what is missing.
"""

from __future__ import annotations

import math
import tempfile
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.typesys import Stores, get_typestore

from pam_gap.recordings.broken_bag import STORAGES, is_unfinished, salvage, storage_files
from pam_gap.recordings.recording import COMMANDS, SUPPLY, RawChannel, RawRecording, RecordingError
from pam_ros.valve_command import commands_of_any_kind

_COMMANDS = "valve_commands"
_SENT = "sent_valve_commands"
"""Commands that the driver sent to the boards; where recorded, they replace `valve_commands`."""

_FIELDS = {
    "pressure_states": ("effort",),
    "joint_states": ("position",),
    "muscle_states": ("effort", "position"),
}

_TOPICS = (_SENT, _COMMANDS, *_FIELDS)

GROUND_TRUTH = "ground_truth"
"""Namespace of the true state of a simulated rig; it is no measurement and is never read."""

ESTIMATES = "joint_estimates"
"""Topic of the model node; if present, `muscle_states` is computed, not measured."""


def is_rosbag(path: Path) -> bool:
    """Whether the path is a rosbag2 folder or one of its storage files."""
    if path.is_dir():
        return (path / "metadata.yaml").is_file() or bool(storage_files(path))
    return path.is_file() and path.suffix in STORAGES


def _topics(reader: AnyReader, path: Path) -> dict[str, list[Any]]:
    found: dict[str, set[str]] = defaultdict(set)
    for connection in reader.connections:
        *namespace, leaf = connection.topic.split("/")
        if GROUND_TRUTH in namespace:
            continue
        if leaf in _TOPICS or leaf == SUPPLY:
            found[leaf].add(connection.topic)
    if any(c.topic.rsplit("/", 1)[-1] == ESTIMATES for c in reader.connections):
        found.pop("muscle_states", None)
    sent = found.get(_SENT, set())
    has_sent = any(c.topic in sent and c.msgcount for c in reader.connections)
    found.pop(_COMMANDS if has_sent else _SENT, None)
    for leaf, topics in found.items():
        if len(topics) > 1:
            raise RecordingError(
                f"{path}: several topics are called {leaf} ({', '.join(sorted(topics))}); "
                "expected a bag of one rig"
            )
    return {
        leaf: [c for c in reader.connections if c.topic in topics] for leaf, topics in found.items()
    }


def _commands(message: Any) -> tuple[list[tuple[str, float]], tuple[str, ...]]:
    """Commands in a message as rows, and the muscles whose command is ambiguous."""
    position, effort = message.position.tolist(), message.effort.tolist()
    read = commands_of_any_kind(message.name, position, effort)
    return [(f"{COMMANDS}{name}", value) for name, value in read.values.items()], read.ambiguous


def _joint_state(topic: str, message: Any) -> list[tuple[str, float]]:
    rows: list[tuple[str, float]] = []
    for field in _FIELDS[topic]:
        values = getattr(message, field).tolist()
        if len(values) != len(message.name):
            continue
        end = "" if topic == "pressure_states" else f".{field}"
        rows += [
            (f"{topic}.{name}{end}", value)
            for name, value in zip(message.name, values, strict=True)
            if math.isfinite(value)
        ]
    return rows


def read_rosbag(path: Path) -> RawRecording:
    """Read the rig contract's topics from a rosbag2.

    Raises
    ------
    RecordingError
        When nothing in the bag can be read, or it holds none of the topics.
    """
    if not is_unfinished(path):
        try:
            return _read([path], path)
        except RecordingError:
            raise
        except Exception as error:  # each layer of the reader reports damage with other exceptions
            reason = " ".join(str(error).split()) or type(error).__name__
    else:
        reason = "not finished"
    with tempfile.TemporaryDirectory(prefix="pam_gap_") as folder:
        files, remarks = salvage(path, Path(folder))
        try:
            recording = _read(files, path)
        except RecordingError as error:
            raise RecordingError(f"{error} ({'; '.join(remarks)})") from None
        except Exception as error:
            reasons = f"{reason}; {'; '.join(remarks)}"
            raise RecordingError(f"{path}: not a readable rosbag2 ({reasons})") from error
    recording.remarks[:0] = remarks
    return recording


def _read(files: Sequence[Path], path: Path) -> RawRecording:
    typestore = get_typestore(Stores.ROS2_JAZZY)
    stamps: dict[str, list[float]] = defaultdict(list)
    values: dict[str, list[float]] = defaultdict(list)
    unstamped: dict[str, int] = defaultdict(int)
    spoilt: dict[str, int] = defaultdict(int)
    ambiguous: dict[tuple[str, str], int] = defaultdict(int)
    with AnyReader(files, default_typestore=typestore) as reader:
        topics = _topics(reader, path)
        if not topics:
            seen = sorted({c.topic for c in reader.connections})[:8]
            raise RecordingError(
                f"{path}: none of the topics {', '.join(_TOPICS)}; it holds "
                f"{', '.join(seen) or 'nothing'}"
            )
        for topic, connections in topics.items():
            for connection, received, data in reader.messages(connections=connections):
                try:
                    message: Any = reader.deserialize(data, connection.msgtype)
                except AnyReaderError:
                    spoilt[topic] += 1
                    continue
                nanoseconds = received
                header = getattr(message, "header", None)
                if header is not None and (header.stamp.sec or header.stamp.nanosec):
                    nanoseconds = header.stamp.sec * 1_000_000_000 + header.stamp.nanosec
                else:
                    unstamped[topic] += 1
                time = 1e-9 * (nanoseconds - reader.start_time)
                if topic in (_COMMANDS, _SENT):
                    rows, unclear = _commands(message)
                    for muscle in unclear:
                        ambiguous[topic, muscle] += 1
                elif topic in _FIELDS:
                    rows = _joint_state(topic, message)
                else:
                    field = "fluid_pressure" if hasattr(message, "fluid_pressure") else "data"
                    rows = [(SUPPLY, float(getattr(message, field, np.nan)))]
                for name, value in rows:
                    stamps[name].append(time)
                    values[name].append(value)
    channels = {
        name: RawChannel(np.asarray(stamps[name]), np.asarray(values[name])) for name in stamps
    }
    if not channels:
        raise RecordingError(f"{path}: the topics {', '.join(topics)} hold no messages")
    remarks = [
        f"{topic}: {count} messages have no stamp; the time of recording is used instead"
        for topic, count in unstamped.items()
    ]
    remarks += [
        f"{topic}: {count} messages cannot be read and are not used"
        for topic, count in spoilt.items()
    ]
    remarks += [
        f"{topic}: {count} commands of {muscle} have a position and an effort, which no valve "
        "accepts; they are not used"
        for (topic, muscle), count in ambiguous.items()
    ]
    return RawRecording(path, channels, remarks)
