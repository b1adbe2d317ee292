"""How much a log may hold: what a file claims is checked before any memory is allocated for it.

A damaged or hostile header claims arrays of petabytes, and a packed file of a megabyte unpacks to
gigabytes. An honest recording is far below these limits: `MOST_ROWS` rows of 26 channels.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

MOST_BYTES: Final = 1 << 31
"""Bytes of numbers in all arrays of a log, and of unpacked text."""
MOST_CELLS: Final = MOST_BYTES // 8
"""Cells of a table, each of which becomes a number of 8 bytes."""


class Allowance:
    """What is left of the bytes that a log may need; one for each file."""

    def __init__(self, most: int = MOST_BYTES) -> None:
        self._left = self._most = most

    def take(self, shape: Iterable[int], item: int, what: str) -> None:
        """Count an array before it is read.

        Parameters
        ----------
        shape : iterable of int
            Its claimed shape.
        item : int
            Bytes of an element.
        what : str
            The array, for the message; a foreign name is shown beforehand.

        Raises
        ------
        ValueError
            When the arrays of the file need more than is allowed.
        """
        needed = math.prod(int(size) for size in shape) * max(int(item), 1)
        if needed < 0 or needed > self._left:
            raise ValueError(
                f"{what} claims {needed / 2**30:.3g} GiB; expected at most "
                f"{self._most / 2**30:.3g} GiB in all: cut the log"
            )
        self._left -= needed
