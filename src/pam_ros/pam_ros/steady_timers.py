"""Timers and turns of a node that no change of the wall clock can delay.

A timer of rclpy runs by the node's clock, which is the wall clock: when someone sets that back by
an hour, the timer does not fire for an hour. In the wheels of rclpy the executor's own waiting uses
the wall clock, too (a condition variable of an old C++ library), also for timers of a steady clock.
Therefore the main loop calls what is due itself, and another thread wakes the executor.
"""

from __future__ import annotations

import gc
import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any, Final

from pam_ros.unforeseen import guard_callbacks, raise_handed_over

TURN: Final = 0.1
"""How long the executor may wait before its loop looks at other things again [s]."""
_SHORTEST: Final = 1e-4  # s; a time-out of zero means something else to some executors


class SteadyTimer:
    """One timer; made by `SteadyTimers.add`.

    Attributes
    ----------
    due : float
        When it is called next, monotonic [s]; infinite while it is cancelled.
    """

    def __init__(self, period: float, callback: Callable[[], object], now: float) -> None:
        self.period, self.callback = period, callback
        self.due = now + period

    def cancel(self) -> None:
        """Do not call it until `reset`."""
        self.due = math.inf

    def reset(self) -> None:
        """Call it again, one period from now on."""
        self.due = time.monotonic() + self.period


class SteadyTimers:
    """The timers of a node, which its main loop calls.

    Parameters
    ----------
    *others : SteadyTimers
        Timers of other nodes in the same main loop, which are called as well.
    """

    def __init__(self, *others: SteadyTimers) -> None:
        self._timers: list[SteadyTimer] = []
        self._others = others

    def add(self, period: float, callback: Callable[[], object]) -> SteadyTimer:
        """A timer with a period [s]; its callback is called without arguments."""
        timer = SteadyTimer(period, callback, time.monotonic())
        self._timers.append(timer)
        return timer

    def until_next(self) -> float:
        """Time until the next callback is due [s], at most `TURN`."""
        now = time.monotonic()
        own = min((timer.due - now for timer in self._timers), default=TURN)
        return min([own, *(other.until_next() for other in self._others)])

    def call_due(self) -> None:
        """Call what is due; periods that were missed are left out."""
        for timer in self._timers:
            now = time.monotonic()
            if now >= timer.due:
                following = timer.due + timer.period
                timer.due = following if following > now else now + timer.period
                timer.callback()
        for other in self._others:
            other.call_due()


def turns(
    executor: Any,
    timers: SteadyTimers | None,
    going_on: Callable[[], bool],
    within: Callable[[], AbstractContextManager[object]] = nullcontext,
) -> Iterator[None]:
    """Run an executor and timers, turn by turn.

    Parameters
    ----------
    executor : rclpy.executors.Executor
        With its nodes.
    timers : SteadyTimers or None
        Those of its node.
    going_on : callable
        Whether there is another turn.
    within : callable, optional
        Makes the context in which timers are called.

    Raises
    ------
    Exception
        What a callback raised, also one whose caller swallows it, see `pam_ros.unforeseen`.
    """
    gc.enable()  # it is off while a program starts (`pam_model.command_line.NodeCommand`)
    for node in executor.get_nodes():
        guard_callbacks(node)
    with _kept_awake(executor):
        while going_on():
            wait = TURN if timers is None else timers.until_next()
            executor.spin_once(timeout_sec=min(max(wait, _SHORTEST), TURN))
            if timers is not None:
                with within():
                    timers.call_due()
            raise_handed_over()
            yield


@contextmanager
def _kept_awake(executor: Any) -> Iterator[None]:
    """Wake the executor again and again from another thread, which sleeps by the steady clock."""
    lock, over = threading.Lock(), False

    def wake() -> None:
        while True:
            time.sleep(TURN)
            with lock:
                if over:
                    return
                executor.wake()

    threading.Thread(target=wake, name="waker", daemon=True).start()
    try:
        yield
    finally:
        with lock:
            over = True
