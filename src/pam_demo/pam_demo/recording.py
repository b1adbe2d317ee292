"""Reads the demo's recording into arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt
from rosbags.highlevel import AnyReaderError

from pam_gap.recordings.broken_bag import bag_reader
from pam_model.errors import PamError
from pam_ros.valve_command import commands_of_any_kind

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TopicSeries:
    """One field of one topic.

    Attributes
    ----------
    times : array, shape (n,)
        Stamps of measurement, or of reception for messages without a header [s since the epoch].
    values : array, shape (n, elements)
        In the topic's unit.
    names : tuple of str
        Of the elements; their numbers, as text, where a message has no names.
    """

    times: Array
    values: Array
    names: tuple[str, ...] = ()

    def between(self, start: float, end: float) -> TopicSeries:
        """The samples from `start` to `end` [s]."""
        first, last = np.searchsorted(self.times, (start, end))
        return TopicSeries(self.times[first:last], self.values[first:last], self.names)

    def during(self, start: float, duration: float) -> TopicSeries:
        """The samples of `duration` seconds from `start` [s], from which their times count."""
        part = self.between(start, start + duration)
        return TopicSeries(part.times - start, part.values, part.names)

    def only(self, names: Sequence[str]) -> TopicSeries:
        """The elements that have one of these names."""
        columns = [self.names.index(name) for name in names if name in self.names]
        kept = tuple(self.names[column] for column in columns)
        return TopicSeries(self.times, self.values[:, columns], kept)


LOOP_COUNTS = ("cycles", "late cycles", "skipped cycles")
COMMAND = "command"
"""Stands for the field that holds a muscle's valve command: `position` or `effort`."""
FIELDS = {
    "/joint_states": "position",
    "/pressure_states": "effort",
    "/valve_commands": COMMAND,
    "/pam_controller/reference": "position",
    "/joint_stiffness": "data",
    "/ground_truth/joint_states": "position",
}


def _values(message: Any, field: str) -> dict[str, float]:
    """The numbers of a message by name, or by place where it has no names."""
    names = getattr(message, "name", None)
    if field == COMMAND:
        commands = commands_of_any_kind(message.name, message.position, message.effort).values
        return {name: commands.get(name, math.nan) for name in message.name}
    values = cast(Sequence[float], getattr(message, field))
    return dict(zip(names or map(str, range(len(values))), values, strict=False))


def _series(times: Sequence[float], rows: Sequence[dict[str, float]]) -> TopicSeries:
    """One column for each name; `joint_states` leaves a joint out that is not measured."""
    names = tuple(dict.fromkeys(name for row in rows for name in row))
    values = np.array([[row.get(name, math.nan) for name in names] for row in rows])
    return TopicSeries(np.asarray(times), values, names)


def read_recording(bag: Path, fields: dict[str, str] | None = None) -> dict[str, TopicSeries]:
    """Read one field of each topic.

    Parameters
    ----------
    bag : Path
        A rosbag2 folder.
    fields : dict, optional
        Topic -> field of its message, or COMMAND.

    Returns
    -------
    dict of str to TopicSeries
        By topic; topics that were not recorded are missing.

    Raises
    ------
    PamError
        If the bag cannot be read.
    """
    fields = fields or FIELDS
    stamps: dict[str, list[float]] = {topic: [] for topic in fields}
    rows: dict[str, list[dict[str, float]]] = {topic: [] for topic in fields}
    try:
        with bag_reader([bag]) as reader:
            wanted = [entry for entry in reader.connections if entry.topic in fields]
            for connection, received, raw in reader.messages(connections=wanted):
                message = reader.deserialize(raw, connection.msgtype)
                values = _values(message, fields[connection.topic])
                header = getattr(message, "header", None)
                stamp = (
                    received * 1e-9
                    if header is None
                    else header.stamp.sec + header.stamp.nanosec * 1e-9
                )
                if len(values):
                    stamps[connection.topic].append(stamp)
                    rows[connection.topic].append(values)
    except (AnyReaderError, OSError) as error:
        raise PamError(f"{bag}: cannot be read as a recording: {error}") from None
    return {topic: _series(stamps[topic], rows[topic]) for topic in fields if rows[topic]}


def read_loop_counts(bag: Path, node: str) -> TopicSeries:
    """Read the timing counts of a node's loop from its diagnostics.

    Parameters
    ----------
    bag : Path
        A rosbag2 folder.
    node : str
        Prefix of the status names.

    Returns
    -------
    TopicSeries
        LOOP_COUNTS since the loop's start, once a second; empty if the node published none.
    """
    times: list[float] = []
    rows: list[list[float]] = []
    with bag_reader([bag]) as reader:
        wanted = [entry for entry in reader.connections if entry.topic == "/diagnostics"]
        for connection, received, raw in reader.messages(connections=wanted):
            for status in reader.deserialize(raw, connection.msgtype).status:
                values = {pair.key: pair.value for pair in status.values}
                if status.name.startswith(node) and all(key in values for key in LOOP_COUNTS):
                    times.append(received * 1e-9)
                    rows.append([float(values[key]) for key in LOOP_COUNTS])
    return TopicSeries(
        np.asarray(times), np.asarray(rows, dtype=float).reshape(-1, len(LOOP_COUNTS))
    )
