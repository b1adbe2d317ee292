"""Runs a node from the command line: signals end it cleanly, a user's mistake is one message.

The only file beside the nodes that knows rclpy, so that every node starts and ends alike.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor

from pam_ros.errors import ParameterError
from pam_ros.node_help import MISTAKE, NodeHelp, tell_mistake

TURN = 0.1
"""How long a turn of the executor may wait before it looks at the shutdown flag [s]."""
SHUTDOWN_DELAY = 0.5
"""How long after a signal the shutdown flag may take to show [s]."""


def spin_node(
    make_node: Callable[[], Any],
    usage: NodeHelp,
    arguments: Sequence[str] | None = None,
    check: Callable[[Any], None] | None = None,
    *,
    mistake: type[Exception],
) -> int:
    """Make a node and serve it until SIGINT or SIGTERM.

    Parameters
    ----------
    make_node : callable
        Makes the node.
    usage : NodeHelp
        What `--help` prints.
    arguments : sequence of str, optional
        Command line, with --ros-args; the process's own by default.
    check : callable, optional
        Called with the node every turn; where a loop's exception is raised.
    mistake : exception type
        What `make_node` and `check` raise for a mistake of the user, beside ParameterError: its
        text is printed, and the node ends. Anything else is a fault of the program and raised.

    Returns
    -------
    int
        Exit code: 0 after a signal or the help text, 2 for a user's mistake.
    """
    ended = usage.answer(arguments)
    if ended is not None:
        return ended
    rclpy.init(args=None if arguments is None else list(arguments))
    node = None
    try:
        node = make_node()
        executor = EventsExecutor()
        executor.add_node(node)
        while rclpy.ok():
            executor.spin_once(timeout_sec=TURN)
            if check is not None:
                check(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except RuntimeError:
        # a signal in the midst of a callback comes out of the events executor as this
        # and may be ahead of the shutdown that the signal asks for
        deadline = time.monotonic() + SHUTDOWN_DELAY
        while rclpy.ok():
            if time.monotonic() > deadline:
                raise
            time.sleep(0.01)
    except (ParameterError, mistake) as error:
        tell_mistake(error)
        return MISTAKE
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
