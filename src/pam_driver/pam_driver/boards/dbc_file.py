"""Reads a DBC file with cantools; every reason why it cannot be used is one line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import cantools
from cantools.database import Database
from cantools.database.errors import Error

from pam_driver.boards.frame_errors import DbcError

# ISO 15765-2 carries up to 4095 bytes in several frames; cantools needs for ever for a typing
# mistake of some more digits.
_LONGEST: Final = 4096
_LENGTH: Final = re.compile(r"\bBO_\s+\d+\s+(\w+)\s*:\s*(\d+)")
_BITS: Final = re.compile(r"\bSG_\s+(\w+)[^:]*:\s*(\d+)\s*\|\s*(\d+)")


def load_dbc(path: Path, max_bytes: int, *, strict: bool = True) -> Database:
    """The messages of a DBC file.

    Parameters
    ----------
    path : Path
        The file.
    max_bytes : int
        Largest size that is read.
    strict : bool, optional
        Refuse a file in which any message is longer than its frame or has signals that overlap;
        otherwise only `Message.refresh(strict=True)` finds that, message by message.

    Raises
    ------
    DbcError
        If the file cannot be read, is too large or is no DBC file.
    """
    try:
        if path.stat().st_size > max_bytes:
            raise DbcError(f"{path}: larger than {max_bytes} bytes, too large for a board's DBC")
        text = path.read_text(encoding="cp1252")
        for name, length in _LENGTH.findall(text):
            if _exceeds(length, _LONGEST):
                raise DbcError(f"{path}: message {name} has {length} bytes, which no frame has")
        for name, *numbers in _BITS.findall(text):
            for bits in numbers:
                if _exceeds(bits, 8 * _LONGEST):
                    raise DbcError(f"{path}: signal {name} has {bits} bits or begins there")
        database = cantools.database.load_string(text, database_format="dbc", strict=strict)
    except OSError as error:
        raise DbcError(f"{path}: cannot be read: {error.strerror}") from error
    except (Error, ValueError, KeyError) as error:
        reason = " ".join(str(error).split())
        raise DbcError(f"{path}: not a valid DBC file: {reason}") from error
    if not isinstance(database, Database):
        raise DbcError(f"{path}: not a CAN database")
    return database


def _exceeds(digits: str, limit: int) -> bool:
    """Whether a number is above a limit; it may have more digits than Python converts."""
    return len(digits.lstrip("0")) > len(str(limit)) or int(digits) > limit
