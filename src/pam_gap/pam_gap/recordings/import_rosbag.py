"""Reads recordings that are rosbag2 folders (MCAP or SQLite), without a ROS installation.

The time of a value is the stamp of its header, which is the time of measurement. If a publisher
leaves the stamp at zero, the time of recording is used, with a remark. A bag that was never
finished or is cut short is read as far as it is intact; a remark says what is missing.
"""

from __future__ import annotations

import contextlib
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pam_gap.recordings.broken_bag import (
    STORAGES,
    bag_reader,
    read_bag,
    stamp_in,
    storage_files,
)
from pam_gap.recordings.joint_state_columns import JointStateColumns
from pam_gap.recordings.recording import (
    COMMANDS,
    SUPPLY,
    RawChannel,
    RawRecording,
    RecordingError,
    is_name,
)
from pam_ros.errors import MalformedMessageError
from pam_ros.foreign_text import all_shown
from pam_ros.joint_state_bytes import JointStateFields, JointStateReader, is_little_endian

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

_JOINT_STATE = "sensor_msgs/msg/JointState"
_COMMANDS = "valve_commands"
_SENT = "sent_valve_commands"
"""Commands that the driver sent to the boards; where recorded, they replace `valve_commands`."""

_FIELDS = {
    "pressure_states": {"effort": "pressure_states.{}"},
    "joint_states": {"position": "joint_states.{}.position"},
    "muscle_states": {"effort": "muscle_states.{}.effort", "position": "muscle_states.{}.position"},
}
"""By topic the fields that are read, and the names of their channels."""

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
                f"{path}: several topics are called {leaf} ({all_shown(sorted(topics))}); "
                "expected a bag of one rig"
            )
    return {
        leaf: [c for c in reader.connections if c.topic in topics] for leaf, topics in found.items()
    }


def read_rosbag(path: Path) -> RawRecording:
    """Read the rig contract's topics from a rosbag2.

    Raises
    ------
    RecordingError
        When nothing in the bag can be read, or it holds none of the topics.
    """
    recording, remarks = read_bag(path, lambda files: _read(files, path))
    recording.remarks[:0] = remarks
    return recording


def _read(files: Sequence[Path], path: Path) -> RawRecording:
    channels: dict[str, RawChannel] = {}
    remarks: list[str] = []
    with bag_reader(files) as reader:
        topics = _topics(reader, path)
        if not topics:
            seen = sorted({c.topic for c in reader.connections})
            raise RecordingError(
                f"{path}: none of the topics {', '.join(_TOPICS)}; it holds "
                f"{all_shown(seen) or 'nothing'}"
            )
        for topic, connections in topics.items():
            counts = _Counts()
            if topic == SUPPLY:
                channels |= _read_supply(reader, connections, counts)
            else:
                columns = _read_joint_states(reader, connections, counts)
                if topic in _FIELDS:
                    channels |= columns.measured(_FIELDS[topic])
                else:
                    commands, counts.ambiguous = columns.commands(f"{COMMANDS}{{}}")
                    channels |= commands
            remarks += counts.remarks(topic)
    strangers = [name for name in channels if not is_name(name)]
    if strangers:
        remarks.append(f"{all_shown(strangers)}: no names of channels, so they are not used")
        channels = {name: channel for name, channel in channels.items() if is_name(name)}
    if not channels:
        raise RecordingError(f"{path}: the topics {', '.join(topics)} hold no messages")
    return RawRecording(path, channels, remarks)


@dataclass(slots=True)
class _Counts:
    """What was wrong with the messages of one topic, by the number of messages."""

    unstamped: int = 0
    spoilt: int = 0
    ambiguous: dict[str, int] = field(default_factory=dict)

    def remarks(self, topic: str) -> list[str]:
        """What a reader of the recording should know."""
        found = []
        if self.unstamped:
            found.append(
                f"{topic}: {self.unstamped} messages have no stamp; the time of recording is used "
                "instead"
            )
        if self.spoilt:
            found.append(f"{topic}: {self.spoilt} messages cannot be read and are not used")
        found += [
            f"{topic}: {count} commands of {muscle} have a position and an effort, which no valve "
            "accepts; they are not used"
            for muscle, count in self.ambiguous.items()
        ]
        return found


def _read_joint_states(
    reader: AnyReader, connections: Sequence[Any], counts: _Counts
) -> JointStateColumns:
    """The messages of a JointState topic; its usual layout is read without rosbags."""
    from rosbags.highlevel import AnyReaderError  # noqa: PLC0415  (optional)

    columns, fast = JointStateColumns(), JointStateReader()
    start = reader.start_time
    for connection, received, data in reader.messages(connections=connections):
        message = None
        if reader.is2 and connection.msgtype == _JOINT_STATE and is_little_endian(data):
            with contextlib.suppress(MalformedMessageError):
                message = fast.read(data)
        if message is None:
            try:
                message = _fields_of(reader.deserialize(data, connection.msgtype))
            except AnyReaderError:
                counts.spoilt += 1
                continue
        nanoseconds = message.seconds * 1_000_000_000 + message.nanoseconds
        if not nanoseconds:
            counts.unstamped += 1
            nanoseconds = received
        columns.add(1e-9 * (nanoseconds - start), message)
    return columns


def _read_supply(
    reader: AnyReader, connections: Sequence[Any], counts: _Counts
) -> dict[str, RawChannel]:
    """The channel of the supply pressure, from a FluidPressure or a number."""
    from rosbags.highlevel import AnyReaderError  # noqa: PLC0415  (optional)

    times, values = [], []
    for connection, received, data in reader.messages(connections=connections):
        try:
            message: Any = reader.deserialize(data, connection.msgtype)
        except AnyReaderError:
            counts.spoilt += 1
            continue
        nanoseconds = stamp_in(message)
        if not nanoseconds:
            counts.unstamped += 1
            nanoseconds = received
        number = "fluid_pressure" if hasattr(message, "fluid_pressure") else "data"
        times.append(1e-9 * (nanoseconds - reader.start_time))
        values.append(float(getattr(message, number, np.nan)))
    return {SUPPLY: RawChannel(np.asarray(times), np.asarray(values))} if times else {}


def _fields_of(message: Any) -> JointStateFields:
    """A message of rosbags."""
    return JointStateFields(
        message.header.stamp.sec,
        message.header.stamp.nanosec,
        message.header.frame_id,
        tuple(message.name),
        tuple(message.position.tolist()),
        tuple(message.velocity.tolist()),
        tuple(message.effort.tolist()),
    )
