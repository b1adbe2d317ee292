"""Watches a goal of the action FollowJointTrajectory while the controller follows it.

Semantics as in the user documentation of ros2_controllers' joint_trajectory_controller: the path
tolerance holds until the end of the trajectory; then the joints must come within the goal tolerance
within the goal time. A violation stops the joints, which brake and hold.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pam_control.actions.goal_tolerances import GoalCode, GoalTolerances
from pam_control.control_step import JointTelemetry
from pam_control.references.reference_generator import ReferenceGenerator
from pam_control.references.spline import JointSpline
from pam_model.within_limits import beyond, within

_REPLACED_BY = {
    "trajectory": "another trajectory",
    "stream": "a streamed command",
    "hold": "a stop, or by a new start of the controller",
}


@dataclass(frozen=True, slots=True)
class GoalOutcome:
    """The end of a goal."""

    code: GoalCode  # the result
    text: str  # the reason, for people
    reached: bool = False  # whether the goal was reached; otherwise it is aborted


class TrajectoryGoal:
    """One goal, from the cycle in which its trajectory is taken.

    Parameters
    ----------
    splines : mapping of str to JointSpline
        What the joints follow, as it was handed to the references.
    tolerances : GoalTolerances
        The goal's tolerances.
    note : str
        A remark for the result of a goal that is reached.
    begin : float
        Present time [s].

    Attributes
    ----------
    outcome : GoalOutcome or None
        How the goal has ended; None while it continues.
    """

    def __init__(
        self,
        splines: Mapping[str, JointSpline],
        tolerances: GoalTolerances,
        note: str,
        begin: float,
    ) -> None:
        self.splines = splines
        self.begin = begin
        self.end = max(spline.end_time for spline in splines.values())
        self.outcome: GoalOutcome | None = None
        self._tolerances = tolerances
        self._note = note

    @property
    def names(self) -> list[str]:
        """The goal's joints."""
        return list(self.splines)

    def observe(
        self,
        now: float,
        telemetry: Mapping[str, JointTelemetry],
        references: ReferenceGenerator,
    ) -> None:
        """Judge the goal after a control cycle; a violation stops the joints.

        Parameters
        ----------
        now : float
            Present time [s].
        telemetry : mapping of str to JointTelemetry
            Of all joints of the rig, after the cycle, by name.
        references : ReferenceGenerator
            The references of the controller.
        """
        if self.outcome is not None:
            return
        for name, spline in self.splines.items():
            if not references.follows(name, spline):
                what = _REPLACED_BY[references.following(name)]
                self.outcome = GoalOutcome(GoalCode.INVALID_GOAL, f"{name}: replaced by {what}")
                return
        own = {name: joint for name, joint in telemetry.items() if name in self.splines}
        if now < self.end:
            self._judge_path(own)
        else:
            self._judge_end(now, own)
        if self.outcome is not None and not self.outcome.reached:
            references.stop(self.names, now)

    def _judge_path(self, joints: Mapping[str, JointTelemetry]) -> None:
        for name, joint in joints.items():
            tolerance = self._tolerances.path[name]
            speed = joint.reference.velocity - joint.motion.velocity
            text = _violation(name, joint.error, tolerance.position, speed, tolerance.velocity)
            if text:
                self.outcome = GoalOutcome(GoalCode.PATH_TOLERANCE_VIOLATED, f"{text} on the way")
                return

    def _judge_end(self, now: float, joints: Mapping[str, JointTelemetry]) -> None:
        text = ""
        for name, joint in joints.items():
            tolerance = self._tolerances.goal[name]
            error = self.splines[name].end_position - joint.motion.position
            speed = joint.reference.velocity - joint.motion.velocity
            text = text or _violation(name, error, tolerance.position, speed, tolerance.velocity)
        if not text:
            self.outcome = GoalOutcome(GoalCode.SUCCESSFUL, self._note, reached=True)
        elif now > self.end + self._tolerances.goal_time:
            late = f"{text}, {now - self.end:.2f} s after the end of the trajectory"
            self.outcome = GoalOutcome(GoalCode.GOAL_TOLERANCE_VIOLATED, late)


def _violation(name: str, error: float, most: float, speed: float, fastest: float) -> str:
    """Which tolerance a joint violates; empty if none."""
    if not within(error, -most, most):
        off, _, permitted = beyond(error, -most, most)
        return f"{name} is {off} rad off, tolerance {permitted} rad"
    if not within(speed, -fastest, fastest):
        off, _, permitted = beyond(speed, -fastest, fastest)
        return f"{name} is {off} rad/s off, tolerance {permitted} rad/s"
    return ""
