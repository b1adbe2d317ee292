"""Checks that bytes have the layout of a ROS message, before anything is made of them.

The middleware's own reader writes a line to the terminal for some malformed messages, takes a byte
of any value for a boolean, and accepts encapsulations of other layouts. This check goes through the
bytes by the fields of the message's type and makes no objects: a count is compared with the bytes
that are left before anything is read, so that a huge one costs neither memory nor time.

Source of the layout: OMG, Common Data Representation (CDR) as in DDS-XTypes 1.3, section 7.4.1
(plain CDR, version 1), with the alignment counted from the end of the encapsulation's four bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Final

from rosidl_parser.definition import (
    AbstractGenericString,
    AbstractSequence,
    AbstractString,
    Array,
    BasicType,
    NamespacedType,
)

from pam_ros.errors import MalformedMessageError
from pam_ros.message_types import message_type

ENCAPSULATION: Final = 4
"""Bytes before the message: two for the kind of layout, two for options."""
_COUNTS: Final = {b"\x00\x00": struct.Struct(">I"), b"\x00\x01": struct.Struct("<I")}
_SIZES: Final = {
    "boolean": 1, "octet": 1, "char": 1, "uint8": 1, "int8": 1, "int16": 2, "uint16": 2,
    "int32": 4, "uint32": 4, "int64": 8, "uint64": 8, "float": 4, "double": 8,
}  # fmt: skip

# Goes through one value: the bytes, where it begins, and how counts are read; returns its end.
_Walk = Callable[[bytes, int, struct.Struct], int]


def check_layout(data: bytes, kind: Any) -> None:
    """Check the bytes of a message.

    Parameters
    ----------
    data : bytes
        The message as it was received; bytes after its end are padding.

    Raises
    ------
    MalformedMessageError
        For bytes that are no message of this type.
    """
    counts = _COUNTS.get(bytes(data[:2]))
    if len(data) < ENCAPSULATION or counts is None:
        raise MalformedMessageError("no encapsulation of plain CDR at its beginning")
    try:
        end = _message(kind)(data, ENCAPSULATION, counts)
    except struct.error:
        raise _short() from None
    if end > len(data):
        raise _short()


def _short() -> MalformedMessageError:
    return MalformedMessageError("it ends too early")


@cache
def _message(kind: Any) -> _Walk:
    """Through all fields of a message."""
    return _all_of([_value(field) for field in kind.SLOT_TYPES])


def _all_of(walks: Sequence[_Walk]) -> _Walk:
    if len(walks) == 1:
        return walks[0]

    def walk(data: bytes, at: int, counts: struct.Struct) -> int:
        for field in walks:
            at = field(data, at, counts)
        return at

    return walk


def _value(field: Any) -> _Walk:
    if isinstance(field, BasicType):
        return _numbers(field.typename, 1)
    if isinstance(field, AbstractString):
        return _text
    if isinstance(field, AbstractGenericString):
        return _wide_text
    if isinstance(field, NamespacedType):
        return _message(message_type("/".join(field.namespaced_name())))
    if isinstance(field, Array):
        return _repeated(field.value_type, field.size)
    if isinstance(field, AbstractSequence):
        return _sequence(field.value_type, getattr(field, "maximum_size", None))
    raise TypeError(f"no layout is known for {type(field).__name__}")


def _numbers(name: str, number: int) -> _Walk:
    """Through numbers of one type."""
    size = _SIZES[name]
    if name == "boolean":

        def walk_booleans(data: bytes, at: int, counts: struct.Struct) -> int:
            if data[at : at + number].strip(b"\x00\x01"):
                raise MalformedMessageError("a boolean that is neither 0 nor 1")
            return at + number

        return walk_booleans

    def walk(data: bytes, at: int, counts: struct.Struct) -> int:
        return at + -(at - ENCAPSULATION) % size + size * number

    return walk


def _repeated(value: Any, number: int) -> _Walk:
    if isinstance(value, BasicType):
        return _numbers(value.typename, number)
    return _all_of([_value(value)] * number)


def _sequence(value: Any, most: int | None) -> _Walk:
    basic = value.typename if isinstance(value, BasicType) else ""
    least = _SIZES[basic] if basic else 1
    one = None if basic else _value(value)

    def walk(data: bytes, at: int, counts: struct.Struct) -> int:
        number, at = _count(data, at, counts)
        if number * least > len(data) - at or (most is not None and number > most):
            raise MalformedMessageError("a count that is larger than what follows it")
        if one is None:
            return _numbers(basic, number)(data, at, counts) if number else at
        for _ in range(number):
            at = one(data, at, counts)
            if at > len(data):
                raise _short()
        return at

    return walk


def _text(data: bytes, at: int, counts: struct.Struct) -> int:
    size, at = _count(data, at, counts)
    if size > len(data) - at:
        raise MalformedMessageError("a text that is longer than what follows its length")
    return at + size


def _wide_text(data: bytes, at: int, counts: struct.Struct) -> int:
    size, at = _count(data, at, counts)
    return at + 2 * size


def _count(data: bytes, at: int, counts: struct.Struct) -> tuple[int, int]:
    """A count, and where it ends."""
    at += -at % 4
    return int(counts.unpack_from(data, at)[0]), at + 4
