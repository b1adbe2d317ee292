"""A CANopen device as the rig file and its EDS file describe it, after all checks.

`reader` makes these tables, `boot` configures the device by them, and `board` uses them in every
cycle. A PDO is named from the device's point of view, as in CiA 301: it receives RPDOs and
transmits TPDOs.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from pam_driver.boards.canopen.dictionary import ObjectName, ObjectType
from pam_driver.boards.protocol import Channel, Promises

NMT: Final = 0x000
SYNC: Final = 0x080
START, STOP, PRE_OPERATIONAL = 1, 2, 128
"""Commands of NMT."""
BOOT_UP, STOPPED, OPERATIONAL, READY = 0, 4, 5, 127
"""States in heartbeats; READY is pre-operational."""
STATES: Final[Mapping[int, str]] = {
    BOOT_UP: "booting",
    STOPPED: "stopped",
    OPERATIONAL: "operational",
    READY: "pre-operational",
}


class CanopenField(NamedTuple):
    """Where an object is in a PDO: `shift` bits from the first, and how it is encoded."""

    name: ObjectName
    shift: int
    kind: ObjectType

    def raw(self, word: int) -> float:
        """The raw value in a payload that was read as a little-endian number."""
        bits = word >> self.shift & ((1 << self.kind.bits) - 1)
        if self.kind.is_float:
            size = self.kind.bits // 8
            code = "<f" if size == 4 else "<d"
            return float(struct.unpack(code, bits.to_bytes(size, "little"))[0])
        if self.kind.signed and bits >> (self.kind.bits - 1):
            bits -= 1 << self.kind.bits
        return bits

    def bits_of(self, raw: float) -> int:
        """The bits of a raw value, at their place in the payload."""
        if self.kind.is_float:
            code = "<f" if self.kind.bits == 32 else "<d"
            bits = int.from_bytes(struct.pack(code, raw), "little")
        else:
            bits = round(raw) & ((1 << self.kind.bits) - 1)
        return bits << self.shift


@dataclass(frozen=True, slots=True)
class CanopenInput:
    """A measurement: SI = gain * raw + bias."""

    what: str  # PRESSURE_INPUT [Pa gauge], ANGLE_INPUT [rad] or SUPPLY_INPUT [Pa absolute]
    channel: Channel  # as muscles and joints name it; "" for the supply pressure
    field: CanopenField  # where it is in its PDO
    # gain, bias: conversion from raw values to SI
    gain: float
    bias: float
    # low, high: the raw values that the device can show
    low: float
    high: float
    invalid: Mapping[int, str]  # raw values that mean no measurement, with their names
    wraps: bool = False  # an angle that is brought to -pi to pi


class CanopenOutput(NamedTuple):
    """A set point: raw = gain * fraction + bias, with the fraction of full scale."""

    place: int
    field: CanopenField
    gain: float
    bias: float
    low: float
    high: float
    vented: float

    def raw(self, fraction: float) -> float:
        """The raw value of a set point, within the range of the object."""
        return min(max(self.gain * fraction + self.bias, self.low), self.high)


@dataclass(frozen=True, slots=True)
class Rpdo:
    """A PDO that the device receives: set points."""

    number: int
    frame_id: int
    length: int
    outputs: tuple[CanopenOutput, ...]


@dataclass(frozen=True, slots=True)
class Tpdo:
    """A PDO that the device transmits: measurements."""

    number: int
    frame_id: int
    length: int
    inputs: tuple[CanopenInput, ...]


class Write(NamedTuple):
    """A step of the boot: write an object; `why` explains it in messages.

    A device that refuses a write that `may_fail` can be used nevertheless.
    """

    name: ObjectName
    data: bytes
    why: str
    may_fail: bool = False


class Check(NamedTuple):
    """A step of the boot: read an object, which must have a value under a mask."""

    name: ObjectName
    expected: int
    why: str
    mask: int = 0xFFFF_FFFF


Step = Write | Check


@dataclass(frozen=True, slots=True)
class CanopenDevice:
    """Everything that the driver knows of a device."""

    # node, host_node: node number of the device, and the one with which the driver sends heartbeats
    node: int
    host_node: int
    commands: tuple[Rpdo, ...]  # the PDOs with set points
    answers: tuple[Tpdo, ...]  # the PDOs with measurements
    steps: tuple[Step, ...]  # what the boot does between "pre-operational" and "start"
    period: float  # time between two TPDOs [s]; with `sync`, the driver's cycle decides
    heartbeat_period: float  # time between two heartbeats of the device [s]
    # time between two heartbeats of the driver [s]; None if the device does not need them
    host_period: float | None
    sync: bool  # whether TPDOs follow the driver's SYNC
    stops: bool  # whether a vent stops the device (NMT), in addition to its set points
    sdo_timeout: float  # how long an answer to an SDO request is waited for [s]
    # by place of a set point in the rig, the raw value that the device applies on errors, if the
    # driver configures it (CiA 401, 0x6443 and 0x6444)
    error_values: Mapping[int, float]
    # whether the manual says that all outputs go off outside the state operational
    off_on_error: bool
    promises: Promises  # what the device does for safety by itself
