"""Runs a node from the command line: signals end it cleanly, a user's mistake is one message.

All nodes use this function, so that they start and end in the same way.

The handlers of rclpy are not used: they close the context at once, also while a node is being made
or a callback runs, and the libraries below may then abort the process. Here a signal is noted, and
the node ends between two turns of the executor.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions

from pam_ros.errors import ParameterError
from pam_ros.node_help import MISTAKE, NodeHelp, tell_mistake

TURN = 0.1
"""How long the executor may wait before it looks for a signal again [s]."""


@contextmanager
def _noted_signals() -> Iterator[list[int]]:
    """The SIGINT and SIGTERM that have arrived; the second one interrupts whatever runs."""
    arrived: list[int] = []

    def note(number: int, frame: object) -> None:
        arrived.append(number)
        if len(arrived) > 1:
            raise KeyboardInterrupt

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield arrived
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def spin_node(
    make_node: Callable[[], Any],
    usage: NodeHelp,
    arguments: Sequence[str] | None = None,
    check: Callable[[Any], None] | None = None,
    *,
    mistake: type[Exception],
) -> int:
    """Make a node and run it until SIGINT or SIGTERM.

    Parameters
    ----------
    make_node : callable
        Makes the node.
    usage : NodeHelp
        The text that `--help` prints.
    arguments : sequence of str, optional
        Command line, with --ros-args; by default that of the process.
    check : callable, optional
        Called with the node in every turn; it raises the exception of the node's loop, if any.
    mistake : exception type
        The exception that `make_node` and `check` raise for a user's mistake. For this one and for
        ParameterError the text is printed, and the node ends. Any other exception is a fault of the
        program and is raised.

    Returns
    -------
    int
        Exit code: 0 after a signal or the help text, 2 for a user's mistake.
    """
    ended = usage.answer(arguments)
    if ended is not None:
        return ended
    with _noted_signals() as arrived:
        options = SignalHandlerOptions.NO
        rclpy.init(
            args=None if arguments is None else list(arguments), signal_handler_options=options
        )
        node = None
        try:
            node = make_node()
            executor = EventsExecutor()
            executor.add_node(node)
            while not arrived and rclpy.ok():
                executor.spin_once(timeout_sec=TURN)
                if check is not None:
                    check(node)
        except (KeyboardInterrupt, ExternalShutdownException):
            pass
        except (ParameterError, mistake) as error:
            tell_mistake(error)
            return MISTAKE
        finally:
            if node is not None:
                node.destroy_node()
            rclpy.try_shutdown()
    return 0
