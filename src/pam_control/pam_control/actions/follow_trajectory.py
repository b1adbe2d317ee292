"""The action `~/follow_joint_trajectory`, as MoveIt and other clients of ros2_control use it.

The action's type is in the package control_msgs. Where that is not installed, the controller works
without the action, and says so.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from pam_control.actions.goal_tolerances import GoalCode, GoalError, goal_tolerances
from pam_control.actions.trajectory_goal import GoalOutcome, TrajectoryGoal
from pam_control.command_intake import CommandIntake
from pam_control.control_step import JointTelemetry
from pam_control.controller import Controller
from pam_control.references.trajectory import CommandError, JointNameError, PastTrajectoryError
from pam_control.references.trajectory import TrajectoryPoint as Point
from pam_ros.foreign_text import all_shown
from pam_ros.long_actions import GoalEnd, LongActions
from pam_ros.parameter_row import Value
from pam_ros.slow_work import SlowWork
from pam_ros.steady_timers import SteadyTimers

try:
    from control_msgs.action import FollowJointTrajectory
except ImportError:
    FollowJointTrajectory = None

NAME = "~/follow_joint_trajectory"
_JOINT_STATE_FIELDS = ("positions", "velocities", "accelerations")


class FollowTrajectory:
    """The action server of one controller; at most one goal is active.

    Parameters
    ----------
    node : rclpy.node.Node
        The controller's node.
    controller : Controller
        Follows the trajectories.
    intake : CommandIntake
        Hands them over.
    lock : Lock
        Held whenever the controller is used.
    values : callable
        Gives the node's parameters by name.
    clock : callable
        The controller's time [s].
    seconds : callable
        A stamp on the controller's time axis [s]; None for "now".
    reason_against : callable
        Why nothing is followed at present; empty if it is. Called with the lock held.
    planning : SlowWork
        Plans the trajectories.
    """

    def __init__(
        self,
        node: Any,
        timers: SteadyTimers,
        controller: Controller,
        intake: CommandIntake,
        lock: threading.Lock,
        *,
        values: Callable[[], Mapping[str, Value]],
        clock: Callable[[], float],
        seconds: Callable[[Any], float | None],
        reason_against: Callable[[], str],
        planning: SlowWork,
    ) -> None:
        self._node = node
        self._controller = controller
        self._intake = intake
        self._lock = lock
        self._values = values
        self._clock = clock
        self._seconds = seconds
        self._reason_against = reason_against
        self._planning = planning
        self._handle: Any = None
        self._goal: TrajectoryGoal | None = None
        self._server: LongActions | None = None
        if FollowJointTrajectory is None:
            node.get_logger().info(
                f"the action {NAME} is not offered, because the package control_msgs is not "
                "installed (ros-jazzy-control-msgs); ~/joint_trajectory takes the same trajectories"
            )
            return
        self._server = LongActions(node, FollowJointTrajectory, NAME, self._begin, self._cancel)
        period = 1.0 / float(values()["action_monitor_rate"])
        self._timer = timers.add(period, self._monitor)
        self._timer.cancel()

    @property
    def active(self) -> bool:
        """Whether a goal is being followed."""
        return self._goal is not None

    def observe(self, now: float) -> None:
        """Judge the active goal after a control cycle at `now` [s]; the lock must be held."""
        if self._goal is not None:
            self._goal.observe(now, self._telemetry(), self._controller.references)

    def _telemetry(self) -> dict[str, JointTelemetry]:
        names = self._controller.rig.joint_names
        return dict(zip(names, self._controller.telemetry, strict=True))

    def drop(self, reason: str) -> None:
        """End the active goal: the driver has stopped the motion; the lock must be held."""
        if self._goal is not None and self._goal.outcome is None:
            self._goal.outcome = GoalOutcome(GoalCode.INVALID_GOAL, reason)

    # --- requests -------------------------------------------------------------------------------

    def _begin(self, handle: Any) -> None:
        """Plan a new goal."""
        if self._planning.full:
            text = "too many trajectories are being planned"
            self._end(handle, GoalEnd.ABORTED, GoalCode.INVALID_GOAL, text)
            return
        ticket = self._intake.ticket
        self._planning.submit(
            lambda: self._planned(handle.request, ticket), partial(self._began, handle)
        )

    def _planned(self, request: Any, ticket: int) -> TrajectoryGoal | GoalError:
        try:
            return self._follow(request, ticket)
        except GoalError as error:
            return error

    def _refuse(self, handle: Any, error: GoalError) -> None:
        """End a goal that cannot be followed."""
        self._node.get_logger().warning(f"{NAME}: {error}", throttle_duration_sec=1.0)
        how = GoalEnd.CANCELED if handle.is_cancel_requested else GoalEnd.ABORTED
        self._end(handle, how, error.code, str(error))

    def _began(self, handle: Any, goal: TrajectoryGoal | GoalError) -> None:
        """Follow a planned goal instead of the present one, if it can be followed."""
        if isinstance(goal, GoalError):
            self._refuse(handle, goal)
            return
        if handle.is_cancel_requested:
            with self._lock:
                self._controller.references.stop(goal.names, self._clock())
            self._end(handle, GoalEnd.CANCELED, GoalCode.SUCCESSFUL, "canceled; braking")
            return
        before, old = self._handle, self._goal
        with self._lock:
            self._handle, self._goal = handle, goal
            if old is not None and old.outcome is None:
                left = [name for name in old.names if name not in goal.splines]
                if left:
                    self._controller.references.stop(left, self._clock())
        if before is not None:
            self._end(before, GoalEnd.ABORTED, GoalCode.INVALID_GOAL, "replaced by a newer goal")
        self._timer.reset()

    def _follow(self, request: Any, ticket: int) -> TrajectoryGoal:
        """Hand the trajectory of a request over.

        Raises
        ------
        GoalError
            If it is not followed; then nothing has changed.
        """
        trajectory = request.trajectory
        names = list(trajectory.joint_names)
        _refuse_several_degrees(request)
        most = int(self._values()["trajectory.max_points"])
        if not trajectory.points:
            raise GoalError(GoalCode.INVALID_GOAL, "the trajectory has no points")
        if len(trajectory.points) > most:
            raise GoalError(
                GoalCode.INVALID_GOAL,
                f"the trajectory has {len(trajectory.points)} points, expected {most} at most "
                "(trajectory.max_points)",
            )
        known = self._controller.rig.joint_names
        if not names or len(set(names)) != len(names) or not set(names) <= set(known):
            raise GoalError(
                GoalCode.INVALID_JOINTS,
                f"joint_names = {all_shown(names)}, expected some or all of {known}, each once",
            )
        patience = request.goal_time_tolerance
        tolerances = goal_tolerances(
            names,
            request.path_tolerance,
            request.goal_tolerance,
            patience.sec + 1e-9 * patience.nanosec,
            self._values(),
        )
        points = [
            Point(
                point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec,
                *(tuple(getattr(point, field)) for field in _JOINT_STATE_FIELDS),
            )
            for point in trajectory.points
        ]
        try:
            splines, note = self._intake.follow(
                names, points, self._seconds(trajectory.header.stamp), ticket
            )
        except PastTrajectoryError as error:
            raise GoalError(GoalCode.OLD_HEADER_TIMESTAMP, str(error)) from None
        except JointNameError as error:
            raise GoalError(GoalCode.INVALID_JOINTS, str(error)) from None
        except CommandError as error:
            raise GoalError(GoalCode.INVALID_GOAL, str(error)) from None
        return TrajectoryGoal(splines, tolerances, note, self._clock())

    def _cancel(self, handle: Any) -> None:
        """Brake within the limits and hold; the monitor ends the goal."""
        with self._lock:
            if handle is not self._handle:  # it is still being planned
                known = self._controller.rig.joint_names
                names = handle.request.trajectory.joint_names
                self._intake.supersede([name for name in names if name in known])
            elif self._goal is not None and self._goal.outcome is None:
                self._goal.outcome = GoalOutcome(GoalCode.SUCCESSFUL, "canceled; braking")
                self._controller.references.stop(self._goal.names, self._clock())

    # --- while a goal is active -----------------------------------------------------------------

    def _monitor(self) -> None:
        """End the goal if it is over, else send feedback."""
        handle, goal = self._handle, self._goal
        if handle is None or goal is None:
            self._timer.cancel()
            return
        with self._lock:
            reason = self._reason_against()
            outcome = goal.outcome
            if outcome is None and reason:
                outcome = GoalOutcome(GoalCode.INVALID_GOAL, reason)
            if outcome is not None:
                self._handle = self._goal = None
            feedback = None if outcome is not None else self._feedback(goal)
        if outcome is None:
            handle.publish_feedback(feedback)
            return
        how = GoalEnd.SUCCEEDED if outcome.reached else GoalEnd.ABORTED
        if handle.is_cancel_requested:
            how = GoalEnd.CANCELED
        elif not outcome.reached:
            self._node.get_logger().warning(f"{NAME} aborted: {outcome.text}")
        self._end(handle, how, outcome.code, outcome.text)

    def _end(self, handle: Any, how: GoalEnd, code: GoalCode, text: str) -> None:
        result = FollowJointTrajectory.Result(error_code=int(code), error_string=text)
        if self._server is not None:
            self._server.end(handle, how, result)

    def _feedback(self, goal: TrajectoryGoal) -> Any:
        message = FollowJointTrajectory.Feedback(joint_names=goal.names)
        message.header.stamp = self._node.get_clock().now().to_msg()
        telemetry = self._telemetry()
        own = [telemetry[name] for name in goal.names]
        references = [joint.reference for joint in own]
        message.desired.positions = [each.position for each in references]
        message.desired.velocities = [each.velocity for each in references]
        message.desired.accelerations = [each.acceleration for each in references]
        message.actual.positions = [joint.motion.position for joint in own]
        message.actual.velocities = [joint.motion.velocity for joint in own]
        message.error.positions = [joint.error for joint in own]
        message.error.velocities = [
            each.velocity - joint.motion.velocity
            for each, joint in zip(references, own, strict=True)
        ]
        gone = self._clock() - goal.begin
        for part in (message.desired, message.actual, message.error):
            part.time_from_start.sec = int(gone)
            part.time_from_start.nanosec = int((gone % 1.0) * 1e9)
        return message


def _refuse_several_degrees(request: Any) -> None:
    """Refuse the fields for joints of several degrees of freedom, which no rig has."""
    for field in ("component_path_tolerance", "component_goal_tolerance"):
        if getattr(request, field):
            raise GoalError(
                GoalCode.INVALID_GOAL, f"{field}: joints have one degree of freedom; leave it empty"
            )
    if request.multi_dof_trajectory.points:
        raise GoalError(
            GoalCode.INVALID_GOAL,
            "multi_dof_trajectory: joints have one degree of freedom; leave it empty",
        )
