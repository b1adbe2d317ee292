"""Collects the messages of one JointState topic of a bag, and turns them into channels at once.

Messages of the same form (names and lengths of the arrays) are kept as rows of one table, so that
nothing is done for each number before the whole bag was read.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pam_gap.recordings.recording import Array, RawChannel
from pam_ros.joint_state_bytes import JointStateFields


@dataclass(slots=True)
class _Table:
    """The messages of one form: their places in the topic, times [s] and numbers."""

    places: list[int] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    rows: list[tuple[float, ...]] = field(default_factory=list)


class JointStateColumns:
    """The messages of one topic.

    Attributes
    ----------
    count : int
        Number of messages.
    """

    def __init__(self) -> None:
        self.count = 0
        self._tables: dict[tuple[tuple[str, ...], int, int], _Table] = {}

    def add(self, time: float, message: JointStateFields) -> None:
        """Take the next message, whose time [s] is given."""
        position, effort = message.position, message.effort
        key = (message.name, len(position), len(effort))
        table = self._tables.get(key)
        if table is None:
            table = self._tables[key] = _Table()
        table.places.append(self.count)
        table.times.append(time)
        table.rows.append(position + effort)
        self.count += 1

    def measured(self, fields: dict[str, str]) -> dict[str, RawChannel]:
        """A channel for each name and field.

        Parameters
        ----------
        fields : dict of str to str
            "position" or "effort" -> name of the channel, where {} stands for the name in the
            message. A field whose length differs from that of the names is ignored, a number that
            is not finite is left out.
        """
        found = _Parts()
        for (names, positions, efforts), table in self._tables.items():
            rows = np.array(table.rows, dtype=float).reshape(len(table.rows), -1)
            for which, text in fields.items():
                first, count = (0, positions) if which == "position" else (positions, efforts)
                if count == len(names):
                    for place, name in enumerate(names):
                        found.add(text.format(name), table, rows[:, first + place])
        return found.channels()

    def commands(self, text: str) -> tuple[dict[str, RawChannel], dict[str, int]]:
        """A channel for each muscle that is commanded, whatever its kind of valve is.

        Parameters
        ----------
        text : str
            Name of the channel, where {} stands for the muscle.

        Returns
        -------
        channels : dict of str to RawChannel
            The number of the field that has a finite one.
        ambiguous : dict of str to int
            By muscle the messages with a finite number in both fields, which are not used.
        """
        found = _Parts()
        ambiguous: dict[str, int] = defaultdict(int)
        for (names, positions, efforts), table in self._tables.items():
            rows = np.array(table.rows, dtype=float).reshape(len(table.rows), -1)
            unknown = np.full(len(rows), np.nan)
            for place, name in enumerate(names):
                position = rows[:, place] if positions == len(names) else unknown
                effort = rows[:, positions + place] if efforts == len(names) else unknown
                both = np.isfinite(position) & np.isfinite(effort)
                if np.any(both):
                    ambiguous[name] += int(np.count_nonzero(both))
                values = np.where(np.isfinite(position), position, effort)
                found.add(text.format(name), table, np.where(both, np.nan, values))
        return found.channels(), dict(ambiguous)


class _Parts:
    """Channels that are put together from the tables."""

    def __init__(self) -> None:
        self._parts: dict[str, list[tuple[NDArray[np.int64], Array, Array]]] = defaultdict(list)

    def add(self, name: str, table: _Table, values: Array) -> None:
        """Take the finite values of one column."""
        finite = np.isfinite(values)
        if np.any(finite):
            places, times = np.asarray(table.places, dtype=np.int64), np.asarray(table.times)
            self._parts[name].append((places[finite], times[finite], values[finite]))

    def channels(self) -> dict[str, RawChannel]:
        """The channels, in the order in which their messages were recorded."""
        found = {}
        for name, parts in self._parts.items():
            places, times, values = (np.concatenate(column) for column in zip(*parts, strict=True))
            order = np.argsort(places, kind="stable")
            found[name] = RawChannel(times[order], values[order])
        return found
