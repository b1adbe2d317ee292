"""Identifiers of CAN frames as whole numbers: 11 bits, or 29 bits with a flag."""

from __future__ import annotations

from typing import Final

EXTENDED: Final = 0x8000_0000
"""Flag of an identifier with 29 bits, as in SocketCAN; without the flag it has 11 bits."""
FD: Final = 0x4000_0000
"""Flag of a CAN FD frame; without the flag the frame is a classic one."""


def number_of(frame_id: int) -> int:
    """The identifier as it is on the bus, without flags."""
    return frame_id & ~(EXTENDED | FD)


def shown(frame_id: int) -> str:
    """An identifier in the usual notation: three hexadecimal digits for 11 bits, eight for 29."""
    if frame_id & EXTENDED:
        return f"0x{number_of(frame_id):08X}"
    return f"0x{number_of(frame_id):03X}"
