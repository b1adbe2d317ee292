"""Corrections for defects of rclpy's lifecycle nodes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation as _rcl

from pam_ros.foreign_text import shown


def refuse_impossible_transitions(node: Any) -> None:
    """Make a lifecycle node refuse a requested transition that its state does not allow.

    Without this correction such a request ends a node of rclpy with an exception.

    Parameters
    ----------
    node : rclpy.lifecycle.LifecycleNode
        A node that has been initialised.
    """
    service = node._service_change_state
    change_state = service.callback

    def answer(request: Any, response: Any) -> Any:
        try:
            return change_state(request, response)
        except _rcl.RCLError:
            asked = (
                shown(request.transition.label)
                if request.transition.label
                else (f"{request.transition.id:d}")
            )
            node.get_logger().warning(
                f"transition {asked} refused: not possible in this state",
                throttle_duration_sec=1.0,
            )
            response.success = False
            return response

    service.callback = answer


def notice_errors_of_transitions(node: Any, notice: Callable[[Exception], object]) -> None:
    """Report what the callback of a transition raised; rclpy makes it an "error" and logs nothing.

    Parameters
    ----------
    node : rclpy.lifecycle.LifecycleNode
        A node that has been initialised.
    notice : callable
        Called with the exception, before the node's `on_error`.
    """

    def noticing(callback: Callable[[Any], Any]) -> Callable[[Any], Any]:
        def call(state: Any) -> Any:
            try:
                return callback(state)
            except Exception as error:
                notice(error)
                raise

        return call

    for state, callback in node._callbacks.items():
        node._callbacks[state] = noticing(callback)
