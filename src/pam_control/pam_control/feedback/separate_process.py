"""Runs functions in a Python process of their own, so that the loops of this one keep their time.

Threads of one Python process share the lock of the interpreter. The import of a large library holds
it for tens of milliseconds at a time, and so does a long computation. A control loop in another
thread then misses its cycles, and the driver vents because commands stay away.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any, BinaryIO, Final

from pam_model.errors import PamError

NICE: Final = 5
"""By how much the other process leaves the processor to the nodes."""
LONGEST: Final = 120.0
"""A call that takes longer is given up [s]."""
_PROGRAM: Final = "from pam_control.feedback.separate_process import serve; serve()"


class SeparateProcess:
    """A process that waits for calls, until it is closed or this process ends.

    It starts at once, because starting a process also holds the lock, and costs about 10 MB until
    the first call.
    """

    def __init__(self) -> None:
        self._process = _start()

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()

    def call[**P, T](self, function: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> T:
        """The result of a function of a module, which is computed in the other process.

        Raises
        ------
        PamError
            The one that the function raises, or one that says that the process has ended.
        """
        if self._process.poll() is not None:
            self._process = _start()
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        too_long = threading.Timer(LONGEST, process.kill)
        too_long.daemon = True
        too_long.start()
        try:
            pickle.dump((function, arguments, named), process.stdin)
            process.stdin.flush()
            result, error = pickle.load(process.stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            code = process.wait()
            raise PamError(
                f"the process that computes {function.__name__.strip('_')} has ended with code "
                f"{code}; its last lines in the log of this node say why"
            ) from None
        finally:
            too_long.cancel()
        if error is not None:
            raise error
        answer: T = result
        return answer


def _start() -> subprocess.Popen[bytes]:
    paths = os.pathsep.join(path for path in sys.path if path)
    return subprocess.Popen(
        [sys.executable, "-c", _PROGRAM],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": paths},
        start_new_session=True,  # Ctrl-C in a terminal is for the node
    )


def serve() -> None:
    """Answer the calls on standard input until it ends."""
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))  # not the node's priority
    os.nice(NICE)
    with os.fdopen(os.dup(1), "wb") as answers:
        os.dup2(2, 1)  # what a library prints is no answer
        with contextlib.suppress(EOFError, BrokenPipeError):
            while True:
                _answer(sys.stdin.buffer, answers)


def _answer(calls: BinaryIO, answers: BinaryIO) -> None:
    function, arguments, named = pickle.load(calls)
    answer: tuple[Any, PamError | None]
    try:
        answer = function(*arguments, **named), None
    except PamError as error:
        answer = None, error
    pickle.dump(answer, answers)
    answers.flush()
