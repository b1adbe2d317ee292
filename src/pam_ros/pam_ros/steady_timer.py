"""Timers by the monotonic clock.

A timer of rclpy runs by the node's clock, which is the wall clock: when someone sets that back by
an hour, the timer is silent for an hour.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType


def steady_timer(node: Any, period: float, callback: Callable[[], object]) -> Any:
    """A timer of a node that no change of the wall clock delays.

    Parameters
    ----------
    node : rclpy.node.Node
        Makes the timer.
    period : float
        Time between two calls [s].
    callback : callable
        Called without arguments.
    """
    return node.create_timer(period, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))
