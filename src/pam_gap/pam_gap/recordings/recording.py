"""A recording: its channels as they were logged, and on one uniform time grid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pam_model.errors import PamError

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

COMMANDS = "valve_commands."
PRESSURES = "pressure_states."
JOINTS = "joint_states."
MUSCLES = "muscle_states."
SUPPLY = "supply_pressure"

TURNED_OVER = "turned_over"
"""Mounting: the joint is upside down, so that `gravity_angle` is turned by pi."""
LOCKED = "locked"
"""Mounting: the joint is locked at the position at which the recording begins."""
SHUT = "shut"
"""Mounting: both valves are shut all the time."""

GAP_PERIODS = 5.0  # a gap longer than this many periods of the channel is not bridged
_EPOCH = 1e8  # a time stamp above this is an absolute one


LONGEST_NAME = 128
"""Characters of the name of a channel; longer ones are noise."""


def is_name(name: str) -> bool:
    """Whether a foreign text can be the name of a channel, which messages repeat as it is."""
    return len(name) <= LONGEST_NAME and name.isprintable()


def runs(mask: Mask) -> list[tuple[int, int]]:
    """First sample of each run of true values, and the one after its last."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


class RecordingError(PamError):
    """A recording that cannot be used; the message names file, channel and expectation."""


@dataclass(frozen=True, slots=True)
class RawChannel:
    """One channel as logged: time stamps [s] and values [SI] of equal length."""

    time: Array
    value: Array


@dataclass(slots=True)
class RawRecording:
    """The content of a file before any repair."""

    source: Path  # the file
    channels: dict[str, RawChannel]  # channels by contract name
    remarks: list[str] = field(default_factory=list)  # remarks of the reader
    # Whether all channels share their time stamps, as in a table. In a bag, each message has its
    # own stamp.
    one_clock: bool = False


@dataclass(frozen=True, slots=True)
class Recording:
    """Channels on one uniform time grid.

    Attributes
    ----------
    source : Path
        The file or folder read.
    sample_time : float
        Step of the grid [s].
    time : ndarray, shape (N,)
        Grid points, from 0 [s].
    values : mapping of str to ndarray, shape (N,)
        Values by contract name, SI; finite everywhere (interpolated where not valid).
    valid : mapping of str to ndarray of bool, shape (N,)
        Whether a value is supported by a true sample.
    repairs : tuple of str
        What was done to the data, in words.
    mounting : str
        `TURNED_OVER`, `LOCKED`, `SHUT`, or empty for the mounting in the rig file.
    samples : mapping of str to ndarray, shape (any,)
        Measurements as logged, whose noise is not reduced by interpolation; only for channels that
        were interpolated.
    one_clock : bool
        Whether all channels share their time stamps.
    silent : frozenset of str
        Measured channels that never change, so that they are not compared with a prediction.
    saturated : mapping of str to float
        Share of the time in which a sensor stood at an end of its range; its samples there are not
        valid.
    is_found_still : bool
        Whether the joint is taken for locked because its position never changes; nobody said so.
    elapsed : tuple of float
        Shares of the whole recording at which the first and the last sample of this part lie.
    frozen : tuple of str
        Which sensors were frozen and when, in full sentences; their samples there are not valid.
    """

    source: Path
    sample_time: float
    time: Array
    values: Mapping[str, Array]
    valid: Mapping[str, Mask]
    repairs: tuple[str, ...]
    mounting: str = ""
    samples: Mapping[str, Array] = field(default_factory=dict)
    one_clock: bool = True
    silent: frozenset[str] = frozenset()
    saturated: Mapping[str, float] = field(default_factory=dict)
    is_found_still: bool = False
    elapsed: tuple[float, float] = (0.0, 1.0)
    frozen: tuple[str, ...] = ()

    def has(self, channel: str) -> bool:
        """Whether the channel was recorded."""
        return channel in self.values

    @property
    def duration(self) -> float:
        """Length of the grid [s]."""
        return float(self.time.size * self.sample_time)


def from_columns(
    source: Path,
    time: Array,
    columns: Mapping[str, Array],
    remarks: list[str] | None = None,
    *,
    one_clock: bool = True,
) -> RawRecording:
    """A raw recording made of columns with one `time` column [s].

    Without `one_clock`, a column has NaN at the times of other signals. Its samples are the rest.
    """
    if float(np.nanmax(np.abs(time), initial=0.0)) > _EPOCH:
        time = time - np.nanmin(time)  # keeps microseconds in a double
    return RawRecording(
        source,
        {name: _samples(time, values, one_clock) for name, values in columns.items()},
        list(remarks or []),
        one_clock,
    )


def _samples(time: Array, values: Array, one_clock: bool) -> RawChannel:
    own = np.ones(values.size, dtype=np.bool_) if one_clock else np.isfinite(values)
    return RawChannel(time[own], values[own])
