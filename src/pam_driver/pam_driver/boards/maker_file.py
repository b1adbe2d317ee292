"""Reads the text of a maker's file (EDS, DBC), whatever its encoding; what is wrong with a line.

Makers save with the encoding of their own computers: UTF-8 with or without a byte order mark,
Windows-1252 or GBK, and some files mix them. Nothing that the driver needs but a unit such as "°"
is outside ASCII, so every text can be read.
"""

from __future__ import annotations

import codecs
from pathlib import Path
from typing import Final

from pam_model.errors import PamError

_MARKS: Final = {codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
_ENCODINGS: Final = ("utf-8", "cp1252", "gbk")


def read_maker_file(path: Path, max_bytes: int, what: str, error: type[PamError]) -> str:
    """The text of a file.

    Parameters
    ----------
    max_bytes : int
        Largest size that is read.
    what : str
        What the file should be, for the message about its size, as "an EDS file".
    error : type of PamError
        What is raised.

    Raises
    ------
    PamError
        If it cannot be read, or is too large; the message begins with the path.
    """
    try:
        with path.open("rb") as file:
            data = file.read(max_bytes + 1)
    except OSError as reason:
        raise error(f"{path}: cannot be read: {reason.strerror or reason}") from None
    if len(data) > max_bytes:
        raise error(f"{path}: larger than {max_bytes} bytes, too large for {what}")
    return decoded(data)


def decoded(data: bytes) -> str:
    """The text of a maker's file; a file of mixed encodings is decoded line by line."""
    for mark, name in _MARKS.items():
        if data.startswith(mark):
            return _unified(data.decode(name, errors="replace"))
    data = data.removeprefix(codecs.BOM_UTF8)
    try:
        return _unified(data.decode("utf-8"))
    except UnicodeDecodeError:
        return _unified("".join(map(_line, data.splitlines(keepends=True))))


def _line(data: bytes) -> str:
    for encoding in _ENCODINGS:
        try:
            return data.decode(encoding)
        except UnicodeDecodeError:
            continue
    return data.decode("cp1252", errors="replace")


def _unified(text: str) -> str:
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    return text.replace("\0", "").replace("\x1a", "")  # \x1a: the end of a file of DOS
