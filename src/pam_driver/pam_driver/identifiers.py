"""Identifiers of CAN frames as whole numbers: 11 bits, or 29 bits and a mark."""

from __future__ import annotations

from typing import Final

EXTENDED: Final = 0x8000_0000
"""This bit in an identifier says that it has 29 bits, as in SocketCAN; without it, 11 bits."""


def shown(frame_id: int) -> str:
    """An identifier as people write it: three digits for 11 bits, eight for 29."""
    if frame_id & EXTENDED:
        return f"0x{frame_id & ~EXTENDED:08X}"
    return f"0x{frame_id:03X}"
