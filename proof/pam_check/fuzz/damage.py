"""Ways in which a file is damaged: cut, flipped, overwritten, and with impossible numbers in it."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable
from typing import Final

Damage = Callable[[random.Random, bytearray], bytearray]
_NUMBERS: Final = (
    0,
    1,
    -1,
    127,
    255,
    2**15,
    2**16 - 1,
    2**31 - 1,
    -(2**31),
    2**40,
    2**62,
    -(2**63),
)
_TOKENS: Final = (
    b"nan", b"1e999", b"-1e308", b"9" * 400, b"[" * 3000, b'"', b"\0", b"\xff", "é".encode() * 99,
    b"2024-13-45", b"99:99:99", b",,,,,", b";", b"\t", b"\n", b"\r", b"#", b"{", b"*a", b"&a [*a]",
    b"+ 1", b"null", b"true", b"1_0", b"0x7f", b"-", b"1e-320", b"12345678901234567890",
)  # fmt: skip


def _cut(draw: random.Random, data: bytearray) -> bytearray:
    return data[: draw.randrange(len(data) + 1)]


def _flip(draw: random.Random, data: bytearray) -> bytearray:
    for _ in range(draw.choice((1, 1, 2, 8, 30))):
        data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
    return data


def _overwrite(draw: random.Random, data: bytearray) -> bytearray:
    start = draw.randrange(len(data))
    part = draw.randbytes(draw.choice((1, 4, 16, 200)))
    data[start : start + len(part)] = part[: len(data) - start]
    return data


def _claim(draw: random.Random, data: bytearray) -> bytearray:
    """Write an extreme number where a size may stand: near an end of the file, or anywhere."""
    size = draw.choice((1, 2, 4, 8))
    number = draw.choice(_NUMBERS) & (2 ** (8 * size) - 1)
    value = struct.pack("<Q", number)[:size]
    if draw.random() < 0.3:
        value = value[::-1]
    near = min(len(data), 600)
    start = draw.choice(
        (draw.randrange(near), len(data) - 1 - draw.randrange(near), draw.randrange(len(data)))
    )
    data[start : start + size] = value
    return data


def _insert(draw: random.Random, data: bytearray) -> bytearray:
    start = draw.randrange(len(data) + 1)
    data[start:start] = draw.choice(_TOKENS)
    return data


def _replace(draw: random.Random, data: bytearray) -> bytearray:
    start = draw.randrange(len(data))
    data[start : start + draw.randrange(1, 12)] = draw.choice(_TOKENS)
    return data


def _move(draw: random.Random, data: bytearray) -> bytearray:
    start, length = draw.randrange(len(data)), draw.randrange(1, 200)
    part = data[start : start + length]
    if draw.random() < 0.5:
        del data[start : start + length]
    place = draw.randrange(len(data) + 1)
    data[place:place] = part
    return data


WAYS: Final[tuple[Damage, ...]] = (
    _cut, _flip, _flip, _overwrite, _claim, _claim, _insert, _replace, _move,
)  # fmt: skip


def damaged(draw: random.Random, content: bytes) -> bytes:
    """The content with one to three of these; now and then noise instead.

    Parameters
    ----------
    draw : random.Random
        Decides what is done.
    content : bytes
        A sound file, or a part of it.
    """
    if draw.random() < 0.01:
        return draw.randbytes(draw.randrange(300))
    data = bytearray(content)
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        if not data:
            break
        data = draw.choice(WAYS)(draw, data)
    return bytes(data)
