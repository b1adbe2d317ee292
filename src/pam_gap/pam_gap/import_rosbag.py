"""Recordings kept as rosbag2 folders (MCAP or SQLite), read without a ROS installation.

The stamp of a value is its header's, the time of measurement; where a publisher leaves that at
zero, the time of recording is taken and said so.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.typesys import Stores, get_typestore

from pam_gap.recording import SUPPLY, RawChannel, RawRecording, RecordingError

_FIELDS = {
    "valve_commands": ("position", "effort"),
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
    return (path.is_dir() and (path / "metadata.yaml").is_file()) or (
        path.is_file() and path.suffix in (".mcap", ".db3")
    )


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
    if topic in ("valve_commands", "pressure_states"):
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
        if known and topic == "valve_commands":
            break
    return rows


def read_rosbag(path: Path) -> RawRecording:
    """Read the rig contract's topics from a rosbag2.

    Raises
    ------
    RecordingError
        When the bag cannot be opened or holds none of the topics.
    """
    typestore = get_typestore(Stores.ROS2_JAZZY)
    stamps: dict[str, list[float]] = defaultdict(list)
    values: dict[str, list[float]] = defaultdict(list)
    unstamped: dict[str, int] = defaultdict(int)
    try:
        with AnyReader([path], default_typestore=typestore) as reader:
            topics = _topics(reader, path)
            if not topics:
                seen = sorted({c.topic for c in reader.connections})[:8]
                raise RecordingError(
                    f"{path}: none of the topics {', '.join(_FIELDS)}; it holds "
                    f"{', '.join(seen) or 'nothing'}"
                )
            for topic, connections in topics.items():
                for connection, received, data in reader.messages(connections=connections):
                    message: Any = reader.deserialize(data, connection.msgtype)
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
    except (AnyReaderError, OSError) as error:
        raise RecordingError(f"{path}: not a readable rosbag2 ({error})") from error
    channels = {
        name: RawChannel(np.asarray(stamps[name]), np.asarray(values[name])) for name in stamps
    }
    if not channels:
        raise RecordingError(f"{path}: the topics {', '.join(topics)} hold no messages")
    remarks = [
        f"{topic}: {count} messages without a stamp; time of recording taken instead"
        for topic, count in unstamped.items()
    ]
    return RawRecording(path, channels, remarks)
