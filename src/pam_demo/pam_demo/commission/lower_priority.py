"""Computes in a thread of lower priority, so that whatever moves the robot comes first.

On Linux each thread has a niceness of its own. The thread that plays the next motion keeps its own:
a process may lower its priority, but not raise it again.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from concurrent.futures import Future
from threading import Thread
from typing import Final, Protocol

NICENESS: Final = 10


class Compute(Protocol):
    """Calls a function that computes for seconds."""

    def __call__[T](self, work: Callable[[], T]) -> T:
        """What the function returns."""


def at_lower_priority[T](work: Callable[[], T]) -> T:
    """What a function returns or raises; it is called in a thread with `NICENESS` more.

    Ctrl-C ends the waiting, and the thread with the process.
    """
    future: Future[T] = Future()

    def run() -> None:
        with contextlib.suppress(AttributeError, OSError):  # if whoever waits has a real-time one
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.nice(NICENESS)
        try:
            future.set_result(work())
        except BaseException as error:  # the thread that waits raises it
            future.set_exception(error)

    Thread(target=run, name="computing", daemon=True).start()
    return future.result()


def at_same_priority[T](work: Callable[[], T]) -> T:
    """What a function returns, where nothing else depends on this process."""
    return work()
