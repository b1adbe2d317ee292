"""Reads the demo's recording into arrays."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pam_gap.recordings.bag_columns import read_bag_columns
from pam_gap.recordings.broken_bag import bag_reader, beginning, read_bag

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Series:
    """One number of a topic over time, or several of equal stamps."""

    # shape (n,): stamps of measurement, or of reception for messages without a header [s since the
    # epoch]
    times: Array
    values: Array  # shape (n,): in the topic's unit

    def between(self, start: float, end: float) -> Series:
        """The samples from `start` to `end` [s]."""
        first, last = np.searchsorted(self.times, (start, end))
        return Series(self.times[first:last], self.values[first:last])

    def during(self, start: float, duration: float) -> Series:
        """The samples of `duration` seconds from `start` [s], from which their times count."""
        part = self.between(start, start + duration)
        return Series(part.times - start, part.values)


LOOP_COUNTS = ("cycles", "late cycles", "skipped cycles")


def read_series(bag: Path, columns: Collection[str]) -> dict[str, Series]:
    """Read numbers from a recording.

    Parameters
    ----------
    bag : Path
        A rosbag2 folder.
    columns : collection of str
        Topic, field and name or place, such as `/joint_states.position.elbow`.

    Returns
    -------
    dict of str to Series
        By column; what was not recorded is missing.

    Raises
    ------
    RecordingError
        If the bag cannot be read.
    """
    found, _ = read_bag_columns(bag, frozenset(columns))
    began, _ = read_bag(bag, beginning)
    return {name: Series(began + raw.time, raw.value) for name, raw in found.items()}


def read_loop_counts(bag: Path, node: str) -> Series:
    """Read the timing counts of a node's loop from its diagnostics.

    Parameters
    ----------
    bag : Path
        A rosbag2 folder.
    node : str
        Prefix of the status names.

    Returns
    -------
    Series
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
    return Series(np.asarray(times), np.asarray(rows, dtype=float).reshape(-1, len(LOOP_COUNTS)))
