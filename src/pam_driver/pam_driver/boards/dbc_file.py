"""Reads a DBC file with cantools; every reason why it cannot be used is one line."""

from __future__ import annotations

from pathlib import Path

import cantools
from cantools.database import Database
from cantools.database.errors import Error

from pam_driver.boards.frame_errors import DbcError


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
        database = cantools.database.load_string(
            path.read_text(encoding="cp1252"), database_format="dbc", strict=strict
        )
    except OSError as error:
        raise DbcError(f"{path}: cannot be read: {error.strerror}") from error
    except (Error, ValueError, KeyError) as error:
        reason = " ".join(str(error).split())
        raise DbcError(f"{path}: not a valid DBC file: {reason}") from error
    if not isinstance(database, Database):
        raise DbcError(f"{path}: not a CAN database")
    return database
