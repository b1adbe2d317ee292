"""What rclpy's lifecycle nodes lack."""

from __future__ import annotations

from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation as _rcl


def refuse_impossible_transitions(node: Any) -> None:
    """Let a lifecycle node answer no to a transition that its state does not have.

    The node of rclpy would end by such a request.

    Parameters
    ----------
    node : rclpy.lifecycle.LifecycleNode
        After its own initialisation.
    """
    service = node._service_change_state
    change_state = service.callback

    def answer(request: Any, response: Any) -> Any:
        try:
            return change_state(request, response)
        except _rcl.RCLError:
            asked = request.transition.label or request.transition.id
            node.get_logger().warning(f"transition {asked} refused: not possible now")
            response.success = False
            return response

    service.callback = answer
