"""A device as the rig file and its DBC file describe it, after all checks.

The tables say for each frame which bits mean what; `reader` makes them, `board` uses them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from pam_driver.boards.mapped.checksum import Algorithm
from pam_driver.boards.mapped.signal_layout import SignalLayout
from pam_driver.boards.protocol import Channel, Promises


class FrameChecksum(NamedTuple):
    """The checksum of a message: its field, its algorithm, and constant bytes before the payload.

    `start` and `end` are the bytes of the payload that hold the checksum itself.
    """

    layout: SignalLayout
    algorithm: Algorithm
    prefix: bytes
    start: int
    end: int

    def value(self, payload: bytes) -> int:
        """The checksum of a payload."""
        covered = self.prefix + payload[: self.start] + payload[self.end :]
        return self.algorithm.compute(covered)


class Selected(NamedTuple):
    """A signal of a message; in a multiplexed message it is there for one value of the selector."""

    layout: SignalLayout
    selector: SignalLayout | None = None
    selected: int = 0

    def present(self, little: int, big: int) -> bool:
        """Whether a payload contains the signal."""
        return self.selector is None or self.selector.raw(little, big) == self.selected


@dataclass(frozen=True, slots=True)
class MappedInput:
    """A measurement: SI = gain * counts + bias."""

    what: str  # PRESSURE_INPUT [Pa gauge], ANGLE_INPUT [rad] or SUPPLY_INPUT [Pa absolute]
    channel: Channel  # as muscles and joints name it; "" for the supply pressure
    signal: Selected  # where it is in the message
    # gain, bias: conversion from counts to SI
    gain: float
    bias: float
    invalid: Mapping[int, str]  # raw values that mean no measurement, with their names
    wraps: bool = False  # an angle that is brought to -pi to pi


class MappedOutput(NamedTuple):
    """A set point: counts = gain * fraction + bias, with the fraction of full scale."""

    place: int
    layout: SignalLayout
    gain: float
    bias: float
    vented: float


@dataclass(frozen=True, slots=True)
class AnswerFrame:
    """A message from the device."""

    name: str
    frame_id: int
    length: int
    inputs: tuple[MappedInput, ...] = ()
    counter: SignalLayout | None = None
    checksum: FrameChecksum | None = None
    period: float | None = None
    state: Selected | None = None
    faults: Mapping[str, Selected] = field(default_factory=dict)
    echo: Selected | None = None
    uptime: Selected | None = None


@dataclass(frozen=True, slots=True)
class CommandFrame:
    """A message to the device, for one value of its selector if it is multiplexed."""

    name: str
    frame_id: int
    length: int
    # the constant bits, in the payload read as a little-endian and as a big-endian number
    base: tuple[int, int]
    # enabled, disabled: the bits of the enable signals, added to `base`
    enabled: tuple[int, int]
    disabled: tuple[int, int]
    outputs: tuple[MappedOutput, ...]  # the set points in it
    counter: SignalLayout | None
    checksum: FrameChecksum | None
    period: float  # time between two frames [s]; 0 for every cycle of the driver


class RequestFrame(NamedTuple):
    """A frame that is sent on demand: a command frame that vents, with other constant bits."""

    frame: CommandFrame
    base: tuple[int, int]


@dataclass(frozen=True, slots=True)
class MappedDevice:
    """Everything that the driver knows of a device."""

    answers: tuple[AnswerFrame, ...]  # messages from the device
    commands: tuple[CommandFrame, ...]  # messages that are sent in every cycle or periodically
    # vent, clear_faults: messages that are sent in addition to vent, and to clear faults
    vent: tuple[RequestFrame, ...]
    clear_faults: tuple[RequestFrame, ...]
    # active, fault: raw values of the state in which the valves follow, and of those that are
    # faults
    active: frozenset[int]
    fault: frozenset[int]
    promises: Promises  # what the device does for safety by itself
