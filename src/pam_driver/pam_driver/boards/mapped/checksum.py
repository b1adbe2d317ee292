"""Checksums of device protocols, by name.

A checksum covers all bytes of the payload except its own, in order, after optional constant bytes
(`prefix`: a data identifier as in AUTOSAR end-to-end protection, or the bytes of the frame's
identifier). Sources: SAE J1850; AUTOSAR CRC library R22-11 (CRC-8 0x2F, CRC-16); the catalogue of
parametrised CRC algorithms by G. Cook, from which the check values in the tests come.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import reduce
from operator import xor
from typing import Final, NamedTuple

Compute = Callable[[bytes], int]


class Algorithm(NamedTuple):
    """A checksum: its length in bytes, and the function of the covered bytes."""

    length: int
    compute: Compute


def crc(width: int, polynomial: int, initial: int, final_xor: int) -> Compute:
    """A cyclic redundancy check that takes the most significant bit first.

    Parameters
    ----------
    width : int
        8 or 16 bits.
    polynomial, initial, final_xor : int
        As in the catalogues, without the highest power.
    """
    top, mask = 1 << (width - 1), (1 << width) - 1
    table = []
    for byte in range(256):
        value = byte << (width - 8)
        for _ in range(8):
            value = ((value << 1) ^ polynomial if value & top else value << 1) & mask
        table.append(value)
    shift = width - 8

    def compute_byte(data: bytes) -> int:
        value = initial
        for byte in data:
            value = table[value ^ byte]
        return value ^ final_xor

    def compute(data: bytes) -> int:
        value = initial
        for byte in data:
            value = (value << 8 & mask) ^ table[(value >> shift) ^ byte]
        return value ^ final_xor

    return compute_byte if width == 8 else compute


ALGORITHMS: Final[Mapping[str, Algorithm]] = {
    "crc8": Algorithm(1, crc(8, 0x07, 0x00, 0x00)),
    "crc8_sae_j1850": Algorithm(1, crc(8, 0x1D, 0xFF, 0xFF)),
    "crc8_sae_j1850_zero": Algorithm(1, crc(8, 0x1D, 0x00, 0x00)),
    "crc8_autosar": Algorithm(1, crc(8, 0x2F, 0xFF, 0xFF)),
    "crc16_ccitt": Algorithm(2, crc(16, 0x1021, 0xFFFF, 0x0000)),
    "crc16_xmodem": Algorithm(2, crc(16, 0x1021, 0x0000, 0x0000)),
    "xor8": Algorithm(1, lambda data: reduce(xor, data, 0)),
    "sum8": Algorithm(1, lambda data: sum(data) & 0xFF),
    "sum8_negative": Algorithm(1, lambda data: -sum(data) & 0xFF),
}
"""The checksums by the name that the rig file uses."""
