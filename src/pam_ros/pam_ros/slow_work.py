"""A thread for what takes longer than a cycle of a loop, so that a stop never waits for it.

A callback of an executor that designs, plans, reads or writes keeps every other callback waiting,
`~/stop` among them. The work is done here in the order in which it was asked for; its result is
handed over in the main loop of the node, where callbacks may be called.
"""

from __future__ import annotations

import queue
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, Final

from pam_ros.steady_timers import SteadyTimers

LOOK_EVERY: Final = 0.02
"""How often the main loop looks for results while something is being done [s]."""
MOST: Final = 10
"""Pieces of work that may wait; a node that is flooded must not keep them all."""

_Job = tuple[Future[Any], Callable[[], Any]]


class SlowWork:
    """One thread; it ends with the process.

    Parameters
    ----------
    timers : SteadyTimers
        Timers of the node, which hand the results over.
    """

    def __init__(self, name: str, timers: SteadyTimers) -> None:
        self._jobs: queue.SimpleQueue[_Job] = queue.SimpleQueue()
        self._waiting: deque[tuple[Future[Any], Callable[[Any], None]]] = deque()
        self._timer = timers.add(LOOK_EVERY, self._look)
        self._timer.cancel()
        threading.Thread(target=self._serve, name=name, daemon=True).start()

    @property
    def full(self) -> bool:
        """Whether no more work is taken at present."""
        return len(self._waiting) >= MOST

    @property
    def busy(self) -> bool:
        """Whether something is being done, or its result was not handed over yet."""
        return bool(self._waiting)

    def submit[T](self, work: Callable[[], T], then: Callable[[T], None]) -> None:
        """Do something in the thread; called in the main loop.

        Parameters
        ----------
        work : callable
            Done in the thread. An exception of it is raised in the main loop.
        then : callable
            Takes the result, in the main loop.
        """
        future: Future[T] = Future()
        self._waiting.append((future, then))
        self._jobs.put((future, work))
        if len(self._waiting) == 1:
            self._timer.reset()

    def _look(self) -> None:
        while self._waiting and self._waiting[0][0].done():
            future, then = self._waiting.popleft()
            then(future.result())
        if not self._waiting:
            self._timer.cancel()

    def _serve(self) -> None:
        while True:
            future, work = self._jobs.get()
            try:
                future.set_result(work())
            except BaseException as error:
                future.set_exception(error)
