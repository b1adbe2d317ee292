"""Limits how often a log says the same kind of thing, whatever the values in the text are."""

from __future__ import annotations

import math
from typing import Final

REPEATED_AFTER: Final = 1.0
"""The same kind is said again after this time [s]."""
_MOST_KINDS: Final = 256


class RepeatedNews:
    """When each kind of news was said last.

    Parameters
    ----------
    period : float, optional
        The same kind is said again after this time [s].
    """

    def __init__(self, period: float = REPEATED_AFTER) -> None:
        self._period = period
        self._said: dict[tuple[object, ...], float] = {}

    def is_due(self, now: float, *kind: object) -> bool:
        """Whether news of this kind may be said now; if so, it counts as said.

        Parameters
        ----------
        now : float
            Monotonic time [s].
        *kind : object
            What it is about, such as a topic and what is wrong. Values of messages do not belong
            here: each of them would be news.
        """
        if now - self._said.get(kind, -math.inf) <= self._period:
            return False
        if len(self._said) >= _MOST_KINDS:
            self._said.clear()
        self._said[kind] = now
        return True


def place_of(error: BaseException) -> tuple[str, int]:
    """The place in the code that raised an error: the kind of an error, without its values."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return ("", 0) if trace is None else (trace.tb_frame.f_code.co_filename, trace.tb_lineno)
