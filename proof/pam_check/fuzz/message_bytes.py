"""Draws messages of any type, and bytes that are nearly such a message.

The fields of a message are found from its type, so that a new topic needs nothing here.
"""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Callable, Mapping
from typing import Any, Final

from rosidl_parser.definition import AbstractSequence, Array, BasicType, NamespacedType

from pam_ros.message_types import message_type

_TEXTS: Final = ("", "elbow", "elbow_flexor", "state", "é" * 300, "x" * 4000, "\x1b[2J", "a\nb")
_NUMBERS: Final = (math.nan, math.inf, -math.inf, 0.0, 1e308, -1e308, 1.0, -1.0)
_LARGE: Final = 100_000  # bytes
_HUGE: Final = (2**31 - 1, 2**31, 2**32 - 1, 100_000, 65_536)


def drawn(kind: Any, draw: random.Random) -> Any:
    """A message of this type with any values that it can have.

    Parameters
    ----------
    kind : type
        Type of the message.
    draw : random.Random
        Source of the values.
    """
    message = kind()
    for name, field in zip(kind.get_fields_and_field_types(), kind.SLOT_TYPES, strict=True):
        setattr(message, name, _value(field, draw))
    return message


def _value(field: Any, draw: random.Random) -> Any:
    if isinstance(field, NamespacedType):
        return drawn(message_type("/".join(field.namespaced_name())), draw)
    if isinstance(field, Array):
        return [_value(field.value_type, draw) for _ in range(field.size)]
    if isinstance(field, AbstractSequence):
        return [_value(field.value_type, draw) for _ in range(draw.randrange(4))]
    if not isinstance(field, BasicType):
        return draw.choice(_TEXTS)
    return _basic(field.typename, draw)


def _basic(name: str, draw: random.Random) -> Any:
    match name:
        case "double":
            return draw.choice(_NUMBERS)
        case "float":
            return draw.choice((math.nan, math.inf, -1e30, 0.0))
        case "boolean":
            return draw.random() < 0.5
        case "octet":
            return draw.randbytes(1)
    bits = int("".join(letter for letter in name if letter.isdigit()) or 8)
    lowest = -(2 ** (bits - 1)) if name.startswith("int") else 0
    return lowest + draw.randrange(2**bits)


def _with_count(data: bytes, draw: random.Random) -> bytes:
    """A huge number where a count may be."""
    at = 4 + 4 * draw.randrange(max(1, len(data) // 4 - 1))
    return data[:at] + struct.pack("<I", draw.choice(_HUGE)) + data[at + 4 :]


def _with_flipped_bits(data: bytes, draw: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(draw.randrange(1, 6)):
        changed[draw.randrange(len(changed))] ^= 1 << draw.randrange(8)
    return bytes(changed)


MUTATIONS: Final[Mapping[str, Callable[[bytes, random.Random], bytes]]] = {
    "nothing": lambda data, draw: b"",
    "less than a header": lambda data, draw: data[: draw.randrange(1, 4)],
    "header only": lambda data, draw: data[:4],
    "truncated": lambda data, draw: data[: draw.randrange(4, len(data))],
    "huge count": _with_count,
    "other encapsulation": lambda data, draw: draw.randbytes(2) + data[2:],
    "other byte order": lambda data, draw: b"\x00\x00" + data[2:],
    "flipped bits": _with_flipped_bits,
    "noise": lambda data, draw: data[:4] + draw.randbytes(draw.randrange(200)),
    "padded": lambda data, draw: data + bytes(draw.randrange(64)),
    "large": lambda data, draw: data + draw.randbytes(_LARGE),
}
"""What is done to the bytes of a message, which has at least five."""


def spoilt(data: bytes, draw: random.Random) -> bytes:
    """The bytes of a message with one of MUTATIONS."""
    return MUTATIONS[draw.choice(tuple(MUTATIONS))](data, draw)
