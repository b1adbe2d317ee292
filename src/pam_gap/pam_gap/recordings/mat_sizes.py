"""Checks the sizes that a MAT file of version 5 claims, before scipy allocates its arrays.

An array is described by its dimensions and, apart from them, by the bytes of its elements. Each
element needs at least one byte, so that dimensions whose product exceeds the bytes are damage; of
cells and structures, scipy would allocate them first. Source: MAT-File Format, MathWorks.
"""

from __future__ import annotations

import math
import struct
import zlib
from pathlib import Path
from typing import Final

from pam_gap.recordings.size_limits import MOST_BYTES

_HEADER: Final = 128
_MATRIX, _COMPRESSED = 14, 15
_KINDS: Final = frozenset({1, 2, 3, 4, 5, 6, 7, 9, 12, 13, _MATRIX, 16, 17, 18})
"""Kinds of data; scipy ends the process where it looks one up that does not exist."""
_CELL, _STRUCT, _OBJECT, _SPARSE = 1, 2, 3, 5
_CLASSES: Final = range(1, 18)
_MOST_NESTED: Final = 32


def refuse_impossible_sizes(path: Path) -> None:
    """Refuse a file with an array of more elements than bytes, or that unpacks to too much.

    Parameters
    ----------
    path : Path
        A MAT file; one of version 4, which has no nested arrays, is left to scipy.

    Raises
    ------
    ValueError
        When a size is impossible; struct.error or zlib.error when the file is damaged otherwise.
    """
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise ValueError(f"larger than {MOST_BYTES} bytes: cut the log")
    content = path.read_bytes()
    mark = content[126:128]
    if mark not in (b"IM", b"MI") or 0 in content[:4]:
        _refuse_version_4(content)
        return
    order = "<" if mark == b"IM" else ">"
    left = MOST_BYTES
    place = _HEADER
    while place + 8 <= len(content):
        kind, count = struct.unpack_from(f"{order}II", content, place)
        data = memoryview(content)[place + 8 : place + 8 + count]
        if kind == _COMPRESSED:
            unpack = zlib.decompressobj()
            unpacked = unpack.decompress(data, left)
            if unpack.unconsumed_tail:
                raise ValueError(f"it unpacks to more than {MOST_BYTES} bytes: cut the log")
            left -= len(unpacked)
            _walk(memoryview(unpacked), order, 0)
        elif kind == _MATRIX:
            _check_array(data, order, 0)
        place += 8 + count


def _refuse_version_4(content: bytes) -> None:
    """Five numbers of 4 bytes describe a matrix: type, rows, columns, complex, length of name."""
    if len(content) < 20:
        raise ValueError("no MAT file")
    for order in "<>":
        rows, columns = struct.unpack_from(f"{order}ii", content, 4)
        if 0 <= rows * columns <= len(content):
            return
    raise ValueError("it claims more elements than it has bytes")


def _walk(data: memoryview, order: str, depth: int) -> None:
    """Check every array in the elements that follow one another."""
    if depth > _MOST_NESTED:
        raise ValueError("nested too deeply")
    place = 0
    while place + 8 <= len(data):
        kind, begin, end, place = _element(data, order, place)
        if kind == _MATRIX:
            _check_array(data[begin:end], order, depth + 1)


def _element(data: memoryview, order: str, place: int) -> tuple[int, int, int, int]:
    """Kind, begin and end of the data of an element, and where the next one begins."""
    kind, count = struct.unpack_from(f"{order}II", data, place)
    begin, following = place + 8, place + 8 + count + -count % 8
    if kind >> 16:  # a small element: its length and kind share four bytes, its data follow
        kind, count = kind & 0xFFFF, kind >> 16
        begin, following = place + 4, place + 8
        if count > 4:
            raise ValueError("a small element claims more than four bytes")
    if kind not in _KINDS or begin + count > len(data):
        raise ValueError("an element of no known kind, or longer than its array")
    return kind, begin, begin + count, following


def _check_array(data: memoryview, order: str, depth: int) -> None:
    """Check the dimensions of an array against its bytes, and the arrays in it."""
    if not data:
        return  # an empty cell
    _, begin, _, place = _element(data, order, 0)  # flags
    kind = struct.unpack_from(f"{order}I", data, begin)[0] & 0xFF
    if kind not in _CLASSES:
        raise ValueError("an array of no known class")
    _, begin, end, place = _element(data, order, place)
    sizes = struct.unpack_from(f"{order}{(end - begin) // 4}i", data, begin)
    if kind != _SPARSE and not 0 <= math.prod(sizes) <= len(data):
        raise ValueError("an array claims more elements than it has bytes")
    _walk(data[place:], order, depth)
