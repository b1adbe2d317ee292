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
from collections.abc import Callable, Mapping
from typing import Any, BinaryIO, Final

from pam_model.errors import PamError

NICE: Final = 5
"""By how much the other process leaves the processor to the nodes."""
LONGEST: Final = 120.0
"""A call that takes longer is given up, unless it states another time [s]."""
_PROGRAM: Final = "from pam_control.feedback.separate_process import serve; serve()"


class SeparateProcess:
    """A process that waits for calls, until it is closed or this process ends.

    It starts at once, because starting a process also holds the lock, and costs about 10 MB until
    the first call.
    """

    def __init__(self) -> None:
        self._process = _start()
        self._closed = False

    def close(self) -> None:
        """End the process; a call in another thread ends with a PamError."""
        self._closed = True
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError, ValueError):
                assert pipe is not None
                pipe.close()

    def call[**P, T](self, function: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> T:
        """The result of a function of a module, which is computed in the other process.

        Raises
        ------
        PamError
            The one that the function raises, or one that says that the process has ended.
        """
        answer: T = self._call(LONGEST, function, arguments, named)
        return answer

    def call_within[T](self, longest: float, function: Callable[..., T], *arguments: Any) -> T:
        """As `call`, given up after a time [s]."""
        answer: T = self._call(longest, function, arguments, {})
        return answer

    def _call(
        self,
        longest: float,
        function: Callable[..., Any],
        arguments: tuple[Any, ...],
        named: Mapping[str, Any],
    ) -> Any:
        if self._closed:
            raise PamError(f"{function.__name__.strip('_')}: the node ends")
        if self._process.poll() is not None:
            self._process = _start()
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        given_up = threading.Event()

        def give_up() -> None:
            given_up.set()
            process.kill()

        too_long = threading.Timer(longest, give_up)
        too_long.daemon = True
        too_long.start()
        try:
            pickle.dump((function, arguments, named), process.stdin)
            process.stdin.flush()
            result, error = pickle.load(process.stdout)
        except (EOFError, OSError, ValueError, pickle.UnpicklingError):
            code, what = process.wait(), function.__name__.strip("_")
            if given_up.is_set():
                raise PamError(f"{what} took more than {longest:g} s and was given up") from None
            raise PamError(
                f"the process that computes {what} has ended with code {code}; its last lines in "
                "the log of this node say why"
            ) from None
        finally:
            too_long.cancel()
        if error is not None:
            raise error
        return result


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
