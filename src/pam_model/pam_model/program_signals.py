"""What Ctrl-C (SIGINT) and SIGTERM do to a program of the suite, from its first import to its end.

- While it imports, nothing has begun that needs an end: the process ends at once
  (`end_at_signals`). An exception would be shown with a traceback there, and code of an imported
  library might catch it.
- While a command runs, both signals interrupt it, so that it ends the programs that it has started
  (`interruptible`); during an import as soon as this has ended. A signal that follows within
  `ONE_REQUEST` belongs to the same request: the terminal and the program that has started this one
  may both send it.
- A node notes signals and ends at a moment of its own choice (`pam_ros.end_signals`).

Only the standard library is imported here, and nothing that takes time.
"""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

ONE_REQUEST: Final = 1.0
"""Signals within this time are one request to end [s]."""
LATER: Final = 0.02  # s, after which a signal that met an import is tried again
SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)
STOPPED: Final = "stopped"
"""What a program that was stopped says on standard error."""

_postponing: list[None] = []  # one for each `postponed` that has begun and not ended


class Terminated(KeyboardInterrupt):
    """SIGTERM has interrupted a command."""


def exit_code(number: int) -> int:
    """The exit code after a signal, as in a shell."""
    return 128 + number


def end_at_signals() -> None:
    """From now on SIGINT and SIGTERM end the process at once; for a program that only imports.

    A signal that the parent process has switched off (`nohup`, a background job) stays so.
    """
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _leave)


def _leave(number: int, frame: FrameType | None) -> None:
    os.write(2, f"{STOPPED}\n".encode())
    os._exit(exit_code(number))


def _imports(frame: FrameType | None) -> bool:
    """Whether an import is in progress in a stack of frames."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


@contextmanager
def postponed() -> Iterator[None]:
    """Inside `interruptible`: a signal interrupts after this, so that no work is half done."""
    _postponing.append(None)
    try:
        yield
    finally:
        _postponing.pop()


@contextmanager
def interruptible() -> Iterator[None]:
    """SIGINT and SIGTERM raise KeyboardInterrupt, the latter as `Terminated`, until the end.

    Handlers that the caller has set are left alone, and so is a thread that cannot set any.
    """
    from threading import Timer, main_thread  # noqa: PLC0415  (what is above must be fast)

    first = -math.inf
    process = os.getpid()

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal first
        if os.getpid() != process:  # a worker that was forked has nothing to say
            signal.signal(number, signal.SIG_DFL)
            os.kill(os.getpid(), number)
        # the code of an import may swallow an exception, or make another one of it
        if _postponing or _imports(frame):
            again = Timer(LATER, signal.pthread_kill, (main_thread().ident, number))
            again.daemon = True
            again.start()
            return
        now = time.monotonic()
        if now - first < ONE_REQUEST:
            return
        first = now
        raise Terminated if number == signal.SIGTERM else KeyboardInterrupt

    ours = (_leave, signal.SIG_DFL, signal.default_int_handler)
    before = {
        number: handler for number in SIGNALS if (handler := signal.getsignal(number)) in ours
    }
    try:
        for number in before:
            signal.signal(number, interrupt)
    except ValueError:  # not in the main thread
        before = {}
    try:
        yield
    finally:
        for number, handler in before.items():
            if (
                signal.getsignal(number) is interrupt
            ):  # else the command notes signals until its end
                signal.signal(number, handler)
