"""Recordings kept as rosbag2 folders (MCAP or SQLite), read without a ROS installation.

The stamp of a value is its header's, the time of measurement; where a publisher leaves that at
zero, the time of recording is taken and said so. A bag that was never finished or lost its end is
read as far as it is whole, and what is missing is a remark.
"""

from __future__ import annotations

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

_COMMANDS = "valve_commands"
_SENT = "sent_valve_commands"
"""What the driver told the boards and when: where it was recorded, it stands for the commands."""

_FIELDS = {
    _SENT: ("position", "effort"),
    _COMMANDS: ("position", "effort"),
    "pressure_states": ("effort",),
    "joint_states": ("position",),
    "muscle_states": ("effort", "position"),
}

GROUND_TRUTH = "ground_truth"
"""Namespace of what a simulated rig tells about itself: no measurement, so never read."""

ESTIMATES = "joint_estimates"
"""Topic of the model node; where it is, `muscle_states` is its answer, not a load cell's."""


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
        if leaf in _FIELDS or leaf == SUPPLY:
            found[leaf].add(connection.topic)
    if any(c.topic.rsplit("/", 1)[-1] == ESTIMATES for c in reader.connections):
        found.pop("muscle_states", None)
    sent = found.get(_SENT, set())
    told = any(c.topic in sent and c.msgcount for c in reader.connections)
    found.pop(_COMMANDS if told else _SENT, None)
    for leaf, topics in found.items():
        if len(topics) > 1:
            raise RecordingError(
                f"{path}: several topics are called {leaf} ({', '.join(sorted(topics))}); "
                "expected a bag of one rig"
            )
    return {
        leaf: [c for c in reader.connections if c.topic in topics] for leaf, topics in found.items()
    }


def _channel(topic: str, name: str, field: str) -> str:
    if topic in (_COMMANDS, _SENT):
        return f"{COMMANDS}{name}"
    if topic == "pressure_states":
        return f"{topic}.{name}"
    return f"{topic}.{name}.{field}"


def _joint_state(topic: str, message: Any) -> list[tuple[str, float]]:
    rows: list[tuple[str, float]] = []
    for field in _FIELDS[topic]:
        values = getattr(message, field)
        if len(values) != len(message.name):
            continue
        known = [
            (_channel(topic, name, field), float(value))
            for name, value in zip(message.name, values, strict=True)
            if np.isfinite(value)
        ]
        rows += known
        if known and topic in (_COMMANDS, _SENT):
            break
    return rows


def read_rosbag(path: Path) -> RawRecording:
    """Read the rig contract's topics from a rosbag2.

    Raises
    ------
    RecordingError
        When nothing of the bag can be read or it holds none of the topics.
    """
    if not is_unfinished(path):
        try:
            return _read([path], path)
        except RecordingError:
            raise
        except Exception as error:  # damage shows in every layer of the reader, each in its own way
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
            said = f"{reason}; {'; '.join(remarks)}"
            raise RecordingError(f"{path}: not a readable rosbag2 ({said})") from error
    recording.remarks[:0] = remarks
    return recording


def _read(files: Sequence[Path], path: Path) -> RawRecording:
    typestore = get_typestore(Stores.ROS2_JAZZY)
    stamps: dict[str, list[float]] = defaultdict(list)
    values: dict[str, list[float]] = defaultdict(list)
    unstamped: dict[str, int] = defaultdict(int)
    spoilt: dict[str, int] = defaultdict(int)
    with AnyReader(files, default_typestore=typestore) as reader:
        topics = _topics(reader, path)
        if not topics:
            seen = sorted({c.topic for c in reader.connections})[:8]
            raise RecordingError(
                f"{path}: none of the topics {', '.join(_FIELDS)}; it holds "
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
                rows = (
                    _joint_state(topic, message)
                    if topic in _FIELDS
                    else [(SUPPLY, float(getattr(message, "fluid_pressure", np.nan)))]
                    if hasattr(message, "fluid_pressure")
                    else [(SUPPLY, float(getattr(message, "data", np.nan)))]
                )
                for name, value in rows:
                    stamps[name].append(time)
                    values[name].append(value)
    channels = {
        name: RawChannel(np.asarray(stamps[name]), np.asarray(values[name])) for name in stamps
    }
    if not channels:
        raise RecordingError(f"{path}: the topics {', '.join(topics)} hold no messages")
    remarks = [
        f"{topic}: {count} messages without a stamp; time of recording taken instead"
        for topic, count in unstamped.items()
    ]
    remarks += [
        f"{topic}: {count} messages cannot be read and are left out"
        for topic, count in spoilt.items()
    ]
    return RawRecording(path, channels, remarks)
