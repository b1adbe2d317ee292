"""Reads a serialized trajectory_msgs/JointTrajectory without ROS.

rclpy creates a message's Python objects in one call, during which no other Python thread can run.
For 30,000 points this takes longer than the boards wait for commands. The control thread runs in
the same process, so a trajectory is received as bytes and read here, point by point; between two
points the control thread can run.

Source: OMG DDS-XTypes 1.3, section 7.4.3 (plain CDR, version 1), which ROS 2 uses on the wire.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from pam_control.references.trajectory import CommandError, TrajectoryPoint
from pam_ros.errors import MalformedMessageError

HEADER = 4  # bytes, the encapsulation header; alignment counts from its end
LARGEST_STOP = 65_536  # bytes of a message without points
LITTLE_ENDIAN = 1  # second byte of the header


@dataclass(frozen=True, slots=True)
class TrajectoryMessage:
    """The content of a message."""

    # seconds, nanoseconds: the stamp
    seconds: int
    nanoseconds: int
    names: tuple[str, ...]  # names of the joints
    points: Sequence[TrajectoryPoint]  # as in the message


class _Reader:
    """Plain CDR, read from the start."""

    def __init__(self, data: bytes) -> None:
        if len(data) < HEADER or data[0] != 0 or data[1] not in (0, LITTLE_ENDIAN):
            raise ValueError("unknown encoding")
        self._data = data
        self._order = "<" if data[1] == LITTLE_ENDIAN else ">"
        self._place = HEADER

    def numbers(self, code: str, size: int, count: int = 1) -> tuple[float, ...]:
        """`count` numbers of a struct code and a size in bytes."""
        if count == 0:
            return ()
        self._place += -(self._place - HEADER) % size
        found = struct.unpack_from(f"{self._order}{count}{code}", self._data, self._place)
        self._place += size * count
        return found

    def integer(self, code: str) -> int:
        """One integer of four bytes."""
        return int(self.numbers(code, 4)[0])

    def count(self, smallest: int) -> int:
        """The length of a sequence whose elements have at least `smallest` bytes."""
        found = self.integer("I")
        if found * smallest > len(self._data) - self._place:
            raise ValueError("a sequence is longer than the message")
        return found

    def text(self) -> str:
        """A string, which ends with a zero byte."""
        size = self.count(1)
        found = self._data[self._place : self._place + max(size - 1, 0)]
        self._place += size
        return found.decode()

    def doubles(self) -> tuple[float, ...]:
        """A sequence of double."""
        return self.numbers("d", 8, self.count(8))


def is_stop(data: bytes) -> bool:
    """Whether a message has no points, so that it stops joints; it is read in no time."""
    return len(data) <= LARGEST_STOP and not _points_of(data)


def _points_of(data: bytes) -> bool:
    try:
        return bool(read_trajectory(data, 0).points)
    except CommandError:
        return True


def read_trajectory(data: bytes, most_points: int) -> TrajectoryMessage:
    """Read a message.

    Parameters
    ----------
    data : bytes
        The serialized message.
    most_points : int
        Largest number of points.

    Raises
    ------
    CommandError
        For a message with more points, which are not read.
    MalformedMessageError
        For bytes that are no trajectory.
    """
    try:
        reader = _Reader(data)
        seconds, nanoseconds = reader.integer("i"), reader.integer("I")
        reader.text()
        names = tuple(reader.text() for _ in range(reader.count(4)))
        count = reader.count(24)
        if count > most_points:
            raise CommandError(
                f"trajectory rejected: it has {count} points, expected {most_points} at most "
                "(trajectory.max_points); send it in parts, or with fewer points"
            )
        points = [_point(reader) for _ in range(count)]
    except CommandError:
        raise
    except (struct.error, ValueError) as error:
        text = str(error) if type(error) is ValueError else type(error).__name__
        raise MalformedMessageError(text) from None
    return TrajectoryMessage(seconds, nanoseconds, names, points)


def _point(reader: _Reader) -> TrajectoryPoint:
    positions, velocities, accelerations = reader.doubles(), reader.doubles(), reader.doubles()
    reader.doubles()  # effort, which the controller does not use
    seconds, nanoseconds = reader.integer("i"), reader.integer("I")
    return TrajectoryPoint(seconds + 1e-9 * nanoseconds, positions, velocities, accelerations)
