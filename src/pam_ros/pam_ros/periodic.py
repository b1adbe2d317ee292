"""A thread that calls one function at absolute deadlines on the monotonic clock.

A call that ends a little after the next deadline delays the next call; a deadline that is more than
half a period ago is counted and skipped, so that missed calls are not made up in a burst. Delays do
not accumulate, since all deadlines lie on the grid of the first one. The thread waits with
`time.sleep`, which uses clock_nanosleep, and not with a busy loop, which would take the processor
from the threads that it waits for. On a busy host a loop keeps its deadlines if the system grants
it a real-time priority.
"""

from __future__ import annotations

import contextlib
import math
import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from pam_ros.memory_lock import lock_memory

LOWEST_PRIORITY = 1  # the lowest real-time priority
LATE = 0.5  # periods; a call that begins later is late, and not begun at all if it can be skipped


@dataclass(frozen=True, slots=True)
class LoopStatistics:
    """The timing of a loop since its start."""

    cycles: int  # number of calls
    late: int  # calls that began more than half a period after their deadline
    skipped: int  # deadlines that passed, by more than half a period, while a call was running
    worst_lateness: float  # largest delay from deadline to call [s]
    priority: int = 0  # real-time priority of the thread; 0: none


def take_priority(priority: int, thread: int = 0) -> int:
    """Give a thread a real-time priority (SCHED_FIFO), if that is permitted.

    Parameters
    ----------
    priority : int
        1 to 99; 0 does not change the thread.
    thread : int, optional
        Thread identifier of the system; 0: the calling thread.

    Returns
    -------
    int
        The priority that it has now; 0 if the system has no real-time priorities or does not permit
        them to this user.
    """
    if priority <= 0 or not hasattr(os, "sched_setscheduler"):
        return 0
    try:
        os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        return 0
    return priority


@contextmanager
def real_time(priority: int) -> Iterator[None]:
    """Give this thread a real-time priority for as long as the context lasts, if permitted."""
    taken = take_priority(priority)
    try:
        yield
    finally:
        if taken:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


class Loop(Protocol):
    """What a node knows of the loop that runs its cycles: `PeriodicLoop`, or its share of one."""

    @property
    def period(self) -> float:
        """Time between two cycles [s]."""

    @property
    def running(self) -> bool:
        """Whether cycles are run."""

    @property
    def busy(self) -> bool:
        """Whether a cycle is in progress."""

    @property
    def statistics(self) -> LoopStatistics:
        """The timing of the loop since its start."""

    def start(self) -> None:
        """Run cycles from now on."""

    def stop(self, timeout: float = 2.0) -> None:
        """Run no further cycle; the last one has ended when this returns."""

    def check(self) -> None:
        """Raise the exception that ended the loop, if there was one."""

    def shift(self, seconds: float) -> None:
        """Move all later cycles by this time [s]; for use in a cycle."""

    def share_priority(self) -> None:
        """Give the other threads of this process a real-time priority too, if the loop has one."""


MakeLoop = Callable[[Callable[[float], object], float, str, int], Loop]
"""Makes a loop of step, period [s], name and priority, as `PeriodicLoop` does."""


class PeriodicLoop:
    """Calls `step(now)` every `period` seconds in one thread.

    An exception in `step` ends the loop; the next call of `check` or `stop` raises it.

    Parameters
    ----------
    step : callable
        Takes the time of the call on `time.monotonic` [s].
    period : float
        Time between calls [s].
    name : str, optional
        Name of the thread.
    priority : int, optional
        Requested real-time priority, see `take_priority`.

    Attributes
    ----------
    period : float
        As given [s].
    busy : bool
        Whether a call is in progress.

    Raises
    ------
    ValueError
        For a period that is not above zero, or a priority outside 0 to 99.
    """

    def __init__(
        self,
        step: Callable[[float], object],
        period: float,
        name: str = "periodic",
        priority: int = 0,
    ) -> None:
        if not (isinstance(period, int | float) and 0.0 < period < float("inf")):
            raise ValueError(f"period = {period} s must be above 0")
        if not (isinstance(priority, int) and 0 <= priority <= 99):
            raise ValueError(f"priority = {priority}: must be from 0 to 99")
        self.period = period
        self._step = step
        self._name = name
        self._asked_priority = priority
        self._priority = 0
        self._thread: threading.Thread | None = None
        self._stopping = threading.Event()
        self._error: BaseException | None = None
        self._raised = False
        self._cycles = self._late = self._skipped = 0
        self._worst = 0.0
        self._shift = 0.0
        self.busy = False

    @property
    def running(self) -> bool:
        """Whether the thread is alive."""
        return self._thread is not None and self._thread.is_alive()

    @property
    def statistics(self) -> LoopStatistics:
        """The timing of the loop since its start."""
        return LoopStatistics(self._cycles, self._late, self._skipped, self._worst, self._priority)

    def start(self) -> None:
        """Start the thread; the first call is made at once.

        Raises
        ------
        RuntimeError
            If the thread is already running.
        """
        if self.running:
            raise RuntimeError(f"{self._name} is already running")
        self._stopping.clear()
        self._error, self._raised = None, False
        self._cycles = self._late = self._skipped = 0
        self._worst = 0.0
        self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
        self._thread.start()

    def share_priority(self) -> None:
        """Give the other threads of this process a real-time priority below that of the loop.

        The loop depends on them for messages and for the interpreter lock, so its own priority is
        of no use if the host does not let them run. For the same reason the memory of the process
        is kept in RAM. Nothing happens if the loop asked for no priority.
        """
        if self._asked_priority <= 0 or not hasattr(os, "sched_setscheduler"):
            return
        lock_memory()
        for task in Path("/proc/self/task").iterdir():
            # the thread may have ended
            with contextlib.suppress(OSError):
                if os.sched_getscheduler(int(task.name)) == os.SCHED_OTHER:
                    take_priority(LOWEST_PRIORITY, int(task.name))

    def shift(self, seconds: float) -> None:
        """Move all later deadlines by this time [s]; for use in `step`."""
        self._shift += seconds

    def check(self) -> None:
        """Raise the exception that ended the loop, if there was one."""
        if self._error is not None:
            self._raised = True
            raise self._error

    def stop(self, timeout: float = 2.0) -> None:
        """End the loop and wait for its thread; safe to call twice, and from the loop itself.

        Parameters
        ----------
        timeout : float, optional
            How long a call in progress may still take [s].

        Raises
        ------
        TimeoutError
            If `step` does not return in time.
        BaseException
            The exception that ended the loop, unless `check` has already raised it.
        """
        self._stopping.set()
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(timeout)
            if thread.is_alive():
                raise TimeoutError(f"{self._name} did not end within {timeout:g} s")
        if not self._raised:
            self.check()

    def _run(self) -> None:
        period = self.period
        self._priority = take_priority(self._asked_priority)
        deadline = time.monotonic()
        try:
            while not self._stopping.is_set():
                now = time.monotonic()
                lateness = now - deadline
                self._cycles += 1
                self._worst = max(self._worst, lateness)
                if lateness > LATE * period:
                    self._late += 1
                self.busy = True
                self._step(now)
                self.busy = False
                deadline += period + self._shift
                self._shift = 0.0
                now = time.monotonic()
                missed = max(0, math.ceil((now - deadline) / period - LATE))
                self._skipped += missed
                deadline += missed * period
                # a long period must not delay stop()
                if deadline - now > 0.1:
                    self._stopping.wait(deadline - now)
                else:
                    time.sleep(max(0.0, deadline - now))
        except BaseException as error:
            self._error = error
