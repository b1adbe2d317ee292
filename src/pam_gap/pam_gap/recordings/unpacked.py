"""Opens a file of text that may be packed, and limits what it unpacks to.

The kind of packing is told by the first bytes, not by the name, since logs are renamed.
"""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO, Final

from pam_gap.recordings.size_limits import MOST_BYTES, MOST_CELLS


def _zstandard(file: BinaryIO) -> Any:
    from backports import zstd  # noqa: PLC0415  (optional)

    return zstd.ZstdFile(file)


PACKINGS: Final[Mapping[str, tuple[bytes, Callable[[BinaryIO], Any]]]] = {
    ".gz": (b"\x1f\x8b", lambda file: gzip.GzipFile(fileobj=file)),
    ".bz2": (b"BZh", bz2.BZ2File),
    ".xz": (b"\xfd7zXZ\x00", lzma.LZMAFile),
    ".zst": (b"\x28\xb5\x2f\xfd", _zstandard),
}
"""Ending of a packed file, its first bytes, and what unpacks it."""
_SEPARATORS: Final = b"\n,;\t"


class _Limited(io.RawIOBase):
    """The unpacked bytes, which end in an error where they or their cells are too many."""

    def __init__(self, inner: Any, file: BinaryIO) -> None:
        self._inner, self._file = inner, file
        self._bytes = 0
        self._cells = 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        part = self._inner.read(len(buffer))
        buffer[: len(part)] = part
        self._bytes += len(part)
        self._cells += sum(part.count(mark) for mark in _SEPARATORS)
        if self._bytes > MOST_BYTES or self._cells > MOST_CELLS:
            raise ValueError(
                f"it holds more than {MOST_BYTES / 2**30:.3g} GiB of text or "
                f"{MOST_CELLS:.3g} cells: cut the log"
            )
        return len(part)

    def close(self) -> None:
        self._inner.close()
        self._file.close()
        super().close()


def open_unpacked(path: Path) -> io.BufferedReader:
    """The bytes of a file, unpacked while they are read.

    Parameters
    ----------
    path : Path
        The file, plain or packed.

    Raises
    ------
    OSError
        When it cannot be opened. Reading raises ValueError where the limits of `size_limits` are
        exceeded, and what the unpacking raises for damage; for a caller within `reading`.
    """
    file = path.open("rb")
    start = file.read(8)
    file.seek(0)
    for magic, unpack in PACKINGS.values():
        if start.startswith(magic):
            return io.BufferedReader(_Limited(unpack(file), file), 1 << 20)
    return io.BufferedReader(_Limited(file, file), 1 << 20)
