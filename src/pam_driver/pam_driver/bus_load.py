"""The load of a CAN bus: the time that its frames take in a second.

Classic frames are counted with the largest number of stuff bits. Source: R. Davis, A. Burns,
R. Bril, J. Lukkien, "Controller Area Network (CAN) schedulability analysis: refuted, revisited and
revised", Real-Time Systems 35 (2007), equations 1 and 2, with three bits of interframe space. CAN
FD frames follow ISO 11898-1:2015 with fixed stuff bits in the checksum.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from pam_driver.boards.protocol import Traffic
from pam_driver.can_bus.identifiers import EXTENDED, FD
from pam_model.rig import Bus

HIGHEST_LOAD: Final = 0.9
"""Above this share of time, a lost arbitration or an error frame delays commands noticeably."""


def classic_bits(frame_id: int, length: int) -> int:
    """Bits of a classic frame on the bus, with the largest number of stuff bits.

    Parameters
    ----------
    frame_id : int
        With the flag `EXTENDED` for 29 bits.
    length : int
        Bytes of payload.
    """
    stuffed = 54 if frame_id & EXTENDED else 34
    return stuffed + 8 * length + 13 + (stuffed + 8 * length - 1) // 4


def frame_time(frame_id: int, length: int, bus: Bus) -> float:
    """The longest time that one frame takes on a bus [s]."""
    if not frame_id & FD:
        return classic_bits(frame_id, length) / bus.bitrate
    head = 36 if frame_id & EXTENDED else 17
    slow = head + (head - 1) // 4 + 12
    checksum = 21 if length > 16 else 17
    fast = 6 + 8 * length
    fast += fast // 4 + 4 + checksum + (checksum + 3) // 4 + 1
    return slow / bus.bitrate + fast / bus.data_bitrate


def bus_load(traffic: Iterable[Traffic], bus: Bus) -> float:
    """The share of time during which the bus carries frames [-]; above 1 they do not fit."""
    return sum(frame_time(one.frame_id, one.length, bus) * one.rate for one in traffic)
