"""Every number in a bag of any topics as a column with stamps of its own, for a map of columns.

rosbag2 (MCAP, SQLite) and rosbag1 are read by rosbags. A column is called by its topic and the
field of the message: `/arm/pressure.data.0`. Where a message has a list `name`, the elements of
lists of the same length are called by these names: `/joint_states.position.elbow`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from pam_gap.recordings.broken_bag import bag_reader, read_bag, stamp_in
from pam_gap.recordings.recording import Array, RawChannel

_MOST_ELEMENTS: Final = 64
"""Longest list whose elements become columns; pictures and point clouds are no signals."""


def _numbers(name: str, value: Any, names: list[str]) -> Iterator[tuple[str, float]]:
    """The numbers in a field of a message, with their names."""
    if isinstance(value, bool | int | float | np.number):
        yield name, float(value)
    elif isinstance(value, np.ndarray | list | tuple):
        if len(value) > _MOST_ELEMENTS:
            return
        keys = names if len(names) == len(value) else [str(k) for k in range(len(value))]
        for key, element in zip(keys, value, strict=True):
            yield from _numbers(f"{name}.{key}", element, [])
    elif hasattr(value, "__dataclass_fields__"):
        listed = getattr(value, "name", [])
        inner = [str(entry) for entry in listed] if isinstance(listed, list) else []
        for field in value.__dataclass_fields__:
            if field not in ("header", "__msgtype__", "name"):
                yield from _numbers(f"{name}.{field}", getattr(value, field), inner)


def read_bag_columns(
    path: Path, wanted: Collection[str] | None = None
) -> tuple[dict[str, RawChannel], list[str]]:
    """The numbers in the messages of a bag.

    Parameters
    ----------
    path : Path
        rosbag2 folder or storage file, or rosbag1 file.
    wanted : collection of str, optional
        The only columns that are read; topics without any of them are skipped.

    Returns
    -------
    tuple of dict of str to RawChannel, list of str
        Stamps of measurement [s] since the bag began, and values as recorded; remarks on what
        is missing.

    Raises
    ------
    RecordingError
        When the bag cannot be read.
    """
    (channels, unread), remarks = read_bag(path, lambda files: _read(files, wanted))
    remarks += [
        f"{topic}: {count} messages cannot be read and are not used"
        for topic, count in unread.items()
    ]
    return channels, remarks


def _read(
    files: list[Path], wanted: Collection[str] | None
) -> tuple[dict[str, RawChannel], dict[str, int]]:
    """The columns, and the number of unreadable messages by topic."""
    from rosbags.highlevel import AnyReaderError  # noqa: PLC0415  (optional)

    stamps: dict[str, list[float]] = defaultdict(list)
    values: dict[str, list[float]] = defaultdict(list)
    unread: dict[str, int] = defaultdict(int)
    with bag_reader(files) as bag:
        chosen = [
            connection
            for connection in bag.connections
            if wanted is None or any(w.startswith(f"{connection.topic}.") for w in wanted)
        ]
        for connection, received, data in bag.messages(connections=chosen) if chosen else ():
            try:
                message = bag.deserialize(data, connection.msgtype)
            except (AnyReaderError, KeyError):  # KeyError: a type without a definition
                unread[connection.topic] += 1
                continue
            time = 1e-9 * ((stamp_in(message) or received) - bag.start_time)
            for name, value in _numbers(connection.topic, message, []):
                if wanted is None or name in wanted:
                    stamps[name].append(time)
                    values[name].append(value)
    columns = {name: RawChannel(_array(stamps[name]), _array(values[name])) for name in stamps}
    return columns, unread


def _array(values: list[float]) -> Array:
    return np.asarray(values, dtype=np.float64)
