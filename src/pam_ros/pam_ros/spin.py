"""Runs a node from the command line: signals end it cleanly, a user's mistake is one message.

All nodes use this function, so that they start and end in the same way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import partial
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor

from pam_ros.end_signals import EndSignals
from pam_ros.errors import ParameterError
from pam_ros.node_end import end_node
from pam_ros.node_help import MISTAKE, NodeHelp, tell_mistake
from pam_ros.start import start_ros
from pam_ros.steady_timers import turns
from pam_ros.unforeseen import tell_unforeseen


def spin_node(
    make_node: Callable[[], Any],
    usage: NodeHelp,
    arguments: Sequence[str] | None = None,
    check: Callable[[Any], None] | None = None,
    *,
    mistake: type[Exception],
    only_at_start: bool = False,
    may_be_left: bool = False,
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
        program: it ends the node, too, and is reported in one line (`pam_ros.unforeseen`), or is
        raised if there is no node yet.
    only_at_start : bool, optional
        Whether it is a user's mistake only while the node is made: what a cycle raises later is a
        fault of the program.
    may_be_left : bool, optional
        Whether a signal ends what a steady timer of the node does, which may take long.

    Returns
    -------
    int
        Exit code: 0 after a signal or the help text, 2 for a user's mistake, 70 after an exception
        that nobody foresaw.
    """
    ended = usage.answer(arguments)
    if ended is not None:
        return ended
    code = 0
    with EndSignals() as signals:
        node = executor = None
        try:
            start_ros(arguments)
            with signals.interruptible():
                node = make_node()
            executor = EventsExecutor()
            executor.add_node(node)
            timers = getattr(node, "steady_timers", None)
            within = partial(signals.interruptible, at_once=True) if may_be_left else nullcontext
            for _ in turns(executor, timers, lambda: not signals.asked and rclpy.ok(), within):
                if check is not None:
                    check(node)
        except (KeyboardInterrupt, ExternalShutdownException):
            pass
        except (ParameterError, mistake) as error:
            if only_at_start and node is not None:
                code = tell_unforeseen(node.get_logger(), error)
            else:
                tell_mistake(error)
                code = MISTAKE
        except Exception as error:
            if node is None:
                raise
            code = tell_unforeseen(node.get_logger(), error)
        finally:
            try:
                end_node(node, executor)
            except Exception as error:
                if node is None:
                    raise
                code = code or tell_unforeseen(node.get_logger(), error)
            rclpy.try_shutdown()
    return code
