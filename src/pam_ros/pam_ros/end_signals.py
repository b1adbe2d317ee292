"""SIGINT and SIGTERM are noted, so that a node ends at a moment of its own choice.

The handlers of rclpy close the context at once, also while a node is being made or a callback runs,
and the libraries below may then abort the process. An exception out of a handler does the same when
it meets a callback that was called from C++.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Self

ONE_REQUEST = 1.0
"""Signals within this time are one request to end [s].

Ctrl-C in the terminal of a launch file reaches a node twice: from the terminal, which signals all
programs that it runs, and from launch, which hands it on.
"""


class EndSignals:
    """The SIGINT and SIGTERM of this process, from `with` to its end.

    Where none has come, the handlers from before are back afterwards. Otherwise the process is
    ending, and the second signal of the same request may still come while its objects are freed:
    then signals are ignored until the process has gone. (Noting them is not enough, because Python
    takes its own handlers away before it frees the last objects.)

    Parameters
    ----------
    clock : callable, optional
        Monotonic time [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._first: float | None = None
        self._urgent = False
        self._interruptible = self._at_once = False

    @property
    def asked(self) -> bool:
        """Whether the process has been asked to end."""
        return self._first is not None

    @property
    def urgent(self) -> bool:
        """Whether it has been asked again, after more than `ONE_REQUEST`."""
        return self._urgent

    @contextmanager
    def interruptible(self, *, at_once: bool = False) -> Iterator[None]:
        """Let an urgent request raise KeyboardInterrupt; for code that C++ does not call.

        With `at_once` the first request does, for work that may be left half done.
        """
        self._interruptible, self._at_once = True, at_once
        try:
            yield
        finally:
            self._interruptible = False

    def _note(self, number: int, frame: object) -> None:
        now = self._clock()
        first = self._first is None
        if self._first is None:
            self._first = now
        elif now - self._first > ONE_REQUEST:
            self._urgent = True
        if self._interruptible and (self._urgent or (first and self._at_once)):
            raise KeyboardInterrupt

    def __enter__(self) -> Self:
        self._before = {
            number: signal.signal(number, self._note) for number in (signal.SIGINT, signal.SIGTERM)
        }
        return self

    def __exit__(self, *error: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, signal.SIG_IGN if self.asked else handler)
