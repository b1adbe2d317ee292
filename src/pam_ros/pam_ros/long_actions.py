"""A server for actions whose goals last: motions that other threads carry out and watch.

The execute callback of rclpy's server would have to wait until the motion ends. As a coroutine it
keeps the events executor busy all the time (half of a core, measured with rclpy 7.1.6), and a
blocking callback stops every other callback. Here a goal stays executing until `end` is called.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import Any

from rclpy.action import ActionServer, CancelResponse

from pam_ros.unforeseen import handing_over


class GoalEnd(Enum):
    """How a goal ends."""

    SUCCEEDED = "succeeded"
    ABORTED = "aborted"
    CANCELED = "canceled"


class LongActions(ActionServer):  # type: ignore[misc]
    """Every goal is accepted and stays executing until it is ended.

    A goal that cannot be carried out is ended at once as aborted, because its result can give the
    reason; the rejection of a ROS 2 action cannot.

    Parameters
    ----------
    begin : callable
        Called with the handle of each new goal, after it was accepted.
    cancel : callable
        Called with the handle of a goal that is to be canceled; the goal must be ended soon.
    """

    def __init__(
        self,
        node: Any,
        action_type: Any,
        name: str,
        begin: Callable[[Any], None],
        cancel: Callable[[Any], None],
    ) -> None:
        def accepted(handle: Any) -> None:
            handle.execute()
            begin(handle)

        def canceled(handle: Any) -> Any:
            cancel(handle)
            return CancelResponse.ACCEPT

        super().__init__(
            node,
            action_type,
            name,
            lambda _: action_type.Result(),
            # the executor keeps the errors of its tasks
            handle_accepted_callback=handing_over(accepted, lambda _: None),
            cancel_callback=handing_over(canceled, lambda _: CancelResponse.ACCEPT),
        )

    def notify_execute(self, goal_handle: Any, execute_callback: Callable[[Any], Any]) -> None:
        """Leave the goal executing; `execute` of a goal handle calls this method."""

    def end(self, handle: Any, how: GoalEnd, result: Any) -> None:
        """End a goal and send its result.

        Parameters
        ----------
        handle : rclpy.action.server.ServerGoalHandle
            The goal, which must not have ended.
        how : GoalEnd
            CANCELED is possible only after a request to cancel it.
        result : object
            Result of the action.
        """

        def finish(_: Any) -> Any:
            match how:
                case GoalEnd.SUCCEEDED:
                    handle.succeed()
                case GoalEnd.ABORTED:
                    handle.abort()
                case GoalEnd.CANCELED:
                    handle.canceled()
            return result

        super().notify_execute(handle, finish)
