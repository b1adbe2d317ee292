"""Signals of any DBC file as shifts, masks and scales, which a cycle of the driver can afford.

cantools reads the DBC file and provides all bit positions, scales, ranges and labels; its own
encoding and decoding of a message takes about ten times as long. The bit positions are those of
Vector's DBC format: a little-endian signal starts at its least significant bit, a big-endian one at
its most significant bit, with bits numbered from the least significant bit of each byte.
"""

from __future__ import annotations

import math
import struct
from typing import Final

from cantools.database.can import Message, Signal

_FLOATS: Final = {16: ">e", 32: ">f", 64: ">d"}
_FLOAT_LIMITS: Final = {16: 65504.0, 32: 3.4028234663852886e38, 64: 1.7976931348623157e308}
FLOAT_BITS: Final = frozenset(_FLOATS)
"""The lengths that a float can have."""
_FD_LENGTHS: Final[tuple[int, ...]] = (*range(9), 12, 16, 20, 24, 32, 48, 64)


class SignalLayout:
    """One signal of a message.

    Attributes
    ----------
    name : str
        As in the DBC file.
    big : bool
        Whether `shift` counts in the payload read as a big-endian number; else little-endian.
    shift, length : int
        Position of the least significant bit, and number of bits.
    labels : dict of int to str
        The value table (`VAL_`), by raw value.
    low, high : float
        The smallest and the largest physical value by the range of the file.
    raw_low, raw_high : float
        The same in counts.
    bits_low, bits_high : float
        The smallest and the largest value in counts that the bits can carry.
    """

    __slots__ = (
        "big",
        "bits_high",
        "bits_low",
        "float_format",
        "high",
        "labels",
        "length",
        "low",
        "mask",
        "name",
        "offset",
        "raw_high",
        "raw_low",
        "scale",
        "shift",
        "sign",
    )

    def __init__(self, message: Message, signal: Signal) -> None:
        self.name = signal.name
        self.length: int = signal.length
        self.mask: int = (1 << signal.length) - 1
        is_signed = signal.is_signed and not signal.conversion.is_float
        self.sign: int = 1 << (signal.length - 1) if is_signed else 0
        self.scale = float(signal.conversion.scale)
        self.offset = float(signal.conversion.offset)
        self.labels = {int(raw): str(name) for raw, name in (signal.choices or {}).items()}
        self.float_format = _FLOATS[signal.length] if signal.conversion.is_float else ""
        self.big = signal.byte_order == "big_endian"
        if self.big:
            first = 8 * (signal.start // 8) + 7 - signal.start % 8
            self.shift: int = 8 * frame_length(message) - first - signal.length
        else:
            self.shift = signal.start
        self.raw_low: float = -self.sign
        self.raw_high: float = self.sign - 1 if self.sign else self.mask
        if self.float_format:
            self.raw_high = _FLOAT_LIMITS[signal.length]
            self.raw_low = -self.raw_high
        ends = [
            (end - self.offset) / self.scale
            for end in (signal.minimum, signal.maximum)
            if end is not None
        ]
        self.bits_low, self.bits_high = self.raw_low, self.raw_high
        if len(ends) == 2 and ends[0] != ends[1]:  # [0|0] is no range
            ends = ends if self.float_format else [float(round(end)) for end in ends]
            self.raw_low = max(self.raw_low, min(ends))
            self.raw_high = min(self.raw_high, max(ends))
        largest = _FLOAT_LIMITS[64]
        self.low, self.high = sorted(
            min(max(raw * self.scale + self.offset, -largest), largest)
            for raw in (self.raw_low, self.raw_high)
        )

    def raw(self, little: int, big: int) -> int:
        """The bits of the signal as a number, which is signed if the signal is."""
        raw = ((big if self.big else little) >> self.shift) & self.mask
        return raw - self.mask - 1 if raw & self.sign else raw

    def number(self, raw: int) -> float:
        """The raw value as a number, in counts; NaN for a float that is not a finite number."""
        if not self.float_format:
            return raw
        value: float
        (value,) = struct.unpack(self.float_format, raw.to_bytes(self.length // 8, "big"))
        return value if math.isfinite(value) else math.nan

    def physical(self, raw: int) -> float:
        """The physical value of a raw value, in the unit of the DBC file."""
        return self.number(raw) * self.scale + self.offset

    @property
    def values(self) -> float:
        """How many values a whole number can have within its range."""
        return self.raw_high - self.raw_low + 1

    def after(self, count: int) -> int:
        """The next count of a counter, which begins again at the end of its range.

        The range of the DBC file may be smaller than that of the bits: 15 is no count of a counter
        of AUTOSAR's end-to-end profile 1, which has four bits.
        """
        return int(self.raw_low) if count >= self.raw_high else count + 1

    def in_range(self, number: float) -> bool:
        """Whether a value in counts is within the range that the DBC file states."""
        return self.raw_low <= number <= self.raw_high

    def bits_of_counts(self, counts: float) -> int:
        """A value in counts, limited to the range of the signal, as bits at their place."""
        counts = min(max(counts, self.raw_low), self.raw_high)
        if self.float_format:
            packed = struct.pack(self.float_format, counts)
            return int.from_bytes(packed, "big") << self.shift
        return (round(counts) & self.mask) << self.shift

    def bits_of_raw(self, raw: int) -> int:
        """A raw value as bits at their place."""
        return (raw & self.mask) << self.shift


def frame_length(message: Message) -> int:
    """The length of the payload on the bus: that of the DBC, or the next that CAN FD has."""
    if not message.is_fd:
        return int(message.length)
    return next(length for length in _FD_LENGTHS if length >= int(message.length))
