"""Runs a node from the command line: signals end it cleanly, a user's mistake is one message.

The only file beside the nodes that knows rclpy, so that every node starts and ends alike.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation

from pam_ros.errors import ParameterError

TURN = 0.1
"""How long a turn of the executor may wait before it looks at the shutdown flag [s]."""
SHUTDOWN_DELAY = 0.5
"""How long after a signal the shutdown flag may take to show [s]."""


def spin_node(
    make_node: Callable[[], Any],
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
        Exit code: 0 after a signal, 2 for a user's mistake.
    """
    try:
        rclpy.init(args=None if arguments is None else list(arguments))
    except rclpy_implementation.UnknownROSArgsError as error:
        print(f"unknown --ros-args: {error}", file=sys.stderr)
        return 2
    except rclpy_implementation.RCLError as error:
        # a parameter file that is not there, or is none
        print(" ".join(str(error).split(", at /")[0].split()), file=sys.stderr)
        return 2
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
        print(error, file=sys.stderr)
        return 2
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
