"""The boundary around every reader of a foreign file: whatever is wrong with it is one line.

The libraries that read files report damage with exceptions of their own: BadZipFile, zlib.error,
LZMAError, a TypeError or a RecursionError of a parser, a MemoryError where a header claims a huge
array. Listing them is never complete, so nothing is listed here.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from pam_model.errors import PamError
from pam_ros.foreign_text import SENTENCE, plain

LARGEST_TEXT: Final = 1 << 28
"""Bytes of a file that is read as one text or document, such as JSON."""


@contextmanager
def reading(path: Path | str, expected: str, raised: type[PamError] = PamError) -> Iterator[None]:
    """Run a reader; an exception that is no PamError becomes one that names the file.

    Parameters
    ----------
    path : Path or str
        The file, for the message.
    expected : str
        What the file should be, after "not": "a readable table".

    Raises
    ------
    PamError
        Of the type `raised`; a PamError of the reader is passed on.
    """
    try:
        yield
    except (PamError, ModuleNotFoundError):  # a missing package is not the file's fault
        raise
    except Exception as error:
        raise raised(f"{path}: not {expected} ({reason(error)})") from error


def reason(error: Exception) -> str:
    """What an exception of a reader says, in one line."""
    if isinstance(error, RecursionError):
        return "nested too deeply"
    if isinstance(error, MemoryError):
        return "it claims to hold more than fits into the memory"
    if isinstance(error, KeyError):
        return f"no {plain(str(error), SENTENCE)}"
    if isinstance(error, OSError) and error.strerror:
        return plain(error.strerror)
    return plain(str(error), SENTENCE) or type(error).__name__


def read_limited(path: Path, largest: int = LARGEST_TEXT) -> bytes:
    """The content of a file that is not too large.

    Raises
    ------
    ValueError, OSError
        For a larger file, or one that cannot be read; for a caller within `reading`.
    """
    with path.open("rb") as file:
        content = file.read(largest + 1)
    if len(content) > largest:
        raise ValueError(f"larger than {largest} bytes")
    return content


def read_text(path: Path, largest: int = LARGEST_TEXT) -> str:
    """The text of a file in UTF-8 with or without byte order mark; errors as `read_limited`."""
    return read_limited(path, largest).decode("utf-8-sig")
