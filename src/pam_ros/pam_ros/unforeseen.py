"""What a node does about an unexpected exception: one clear line, and an exit code.

An exception ends the node, wherever it was raised. The executor and `PeriodicLoop` raise what
happened in them again; what rclpy would swallow, or what happened in a thread, is handed over to
the main loop (`pam_ros.steady_timers.turns`), which raises it in its next turn.
"""

from __future__ import annotations

import functools
import traceback
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from pam_ros.foreign_text import shown

BROKEN: Final = 70
"""Exit code after an unexpected exception (`EX_SOFTWARE` of sysexits.h)."""
_handed_over: deque[Exception] = deque(maxlen=100)


def described(error: BaseException) -> str:
    """An exception as one short line: its kind, its text, and where it was raised."""
    frames = traceback.extract_tb(error.__traceback__)
    where = f" in {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    text = f": {shown(str(error))}" if str(error) else ""
    return f"internal error{where}: {type(error).__name__}{text}"


def tell_unforeseen(logger: Any, error: BaseException, done: str = "the node ends") -> int:
    """Log an exception as one line, with its traceback at debug level; returns `BROKEN`.

    Parameters
    ----------
    logger : rclpy logger
        That of the node.
    done : str, optional
        What the node does about it.
    """
    logger.error(f"{done}: {described(error)}; please report it (details at log level debug)")
    logger.debug("".join(traceback.format_exception(error)))
    return BROKEN


@contextmanager
def ending_broken(node: Any, *foreseen: type[Exception]) -> Iterator[None]:
    """A block whose unexpected exception is reported, and ends the process with `BROKEN`.

    Parameters
    ----------
    node : rclpy.node.Node
        In whose log it is reported.
    *foreseen : exception types
        These are raised as they are: the caller reports them to the user.
    """
    try:
        yield
    except foreseen:
        raise
    except Exception as error:
        raise SystemExit(tell_unforeseen(node.get_logger(), error)) from None


def hand_over(error: Exception) -> None:
    """Let the main loop raise an exception; for threads and callbacks whose caller swallows it."""
    _handed_over.append(error)


def raise_handed_over() -> None:
    """Raise the first exception that was handed over, if there is one, and forget the others."""
    if _handed_over:
        error = _handed_over.popleft()
        _handed_over.clear()
        raise error


def handing_over[**P, R](callback: Callable[P, R], instead: Callable[..., R]) -> Callable[P, R]:
    """A callback whose exceptions are handed over to the main loop, and not raised.

    Parameters
    ----------
    callback : callable
        The callback.
    instead : callable
        Gives what is returned after an exception, from the same arguments.
    """

    @functools.wraps(callback)
    def guarded(*arguments: P.args, **named: P.kwargs) -> R:
        try:
            return callback(*arguments, **named)
        except Exception as error:
            hand_over(error)
            return instead(*arguments, **named)

    return guarded


def guard_callbacks(node: Any) -> None:
    """Let the exceptions of all callbacks of a node be handed over; rclpy would print them.

    Parameters
    ----------
    node : rclpy.node.Node
        The node, with its topics, services and timers.
    """
    for entity in (*node.subscriptions, *node.timers):
        entity.callback = handing_over(entity.callback, _nothing)
    for service in node.services:
        service.callback = handing_over(service.callback, _empty_response)


def _nothing(*_: Any) -> None: ...


def _empty_response(_: Any, response: Any) -> Any:
    return response
