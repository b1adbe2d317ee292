"""Identifiers of CAN frames as whole numbers: 11 bits, or 29 bits with a flag."""

from __future__ import annotations

from typing import Final

EXTENDED: Final = 0x8000_0000
"""Flag of an identifier with 29 bits, as in SocketCAN; without the flag it has 11 bits."""


def shown(frame_id: int) -> str:
    """An identifier in the usual notation: three hexadecimal digits for 11 bits, eight for 29."""
    if frame_id & EXTENDED:
        return f"0x{frame_id & ~EXTENDED:08X}"
    return f"0x{frame_id:03X}"
