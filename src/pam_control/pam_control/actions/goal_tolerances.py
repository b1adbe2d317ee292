"""How far a joint may be from its trajectory on the way and at the end.

Names and meaning are those of ros2_controllers' joint_trajectory_controller. Source: its user
documentation and control_msgs/msg/JointTolerance. In a goal, 0 means the default of the parameter,
and -1 means no limit. In a parameter, 0 means no limit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, Protocol

from pam_control.declared import Declared, Value
from pam_control.references.trajectory import CommandError
from pam_ros.foreign_text import shown

ERASED = -1.0
STOPPED = 0.1
"""Default of the speed below which a joint counts as at rest [rad/s]; a 14 bit encoder whose last
bit toggles shows 0.03 rad/s."""


class GoalCode(IntEnum):
    """Codes of a goal's result, as in control_msgs/action/FollowJointTrajectory."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


class GoalError(CommandError):
    """A goal that cannot be carried out; nothing has changed.

    Attributes
    ----------
    code : GoalCode
        The reason for programs.
    """

    def __init__(self, code: GoalCode, text: str) -> None:
        super().__init__(text)
        self.code = code


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Largest deviation of a joint; infinite where there is no limit."""

    position: float = math.inf  # [rad]
    velocity: float = math.inf  # [rad/s]


class NamedTolerance(Protocol):
    """A control_msgs/msg/JointTolerance."""

    name: str
    position: float
    velocity: float
    acceleration: float


PARAMETERS: Final = (
    Declared(
        "action_monitor_rate", 20.0, "Hz", 1.0, 200.0,
        "rate at which the action ~/follow_joint_trajectory sends feedback and results", fixed=True,
    ),
    Declared(
        "constraints.goal_time", 0.0, "s", 0.0, 600.0,
        "how long after the end of its trajectory a goal may take to be reached; 0: no limit",
    ),
    Declared(
        "constraints.stopped_velocity_tolerance", STOPPED, "rad/s", 0.0, 100.0,
        "speed below which a joint has reached its goal; 0: no limit",
    ),
)  # fmt: skip
"""Parameters of the node that are defaults of tolerances."""


def joint_tolerances(joint: str) -> tuple[Declared, ...]:
    """The same for one joint, by its name."""
    return (
        Declared(
            f"constraints.{joint}.trajectory", 0.0, "rad", 0.0, 10.0,
            f"largest error of {joint} while an action goal is followed; 0: no limit",
        ),
        Declared(
            f"constraints.{joint}.goal", 0.0, "rad", 0.0, 10.0,
            f"largest error of {joint} at the end of an action goal; 0: no limit",
        ),
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class GoalTolerances:
    """All tolerances of one goal."""

    # path, goal: on the way and at the end, by joint
    path: Mapping[str, Tolerance]
    goal: Mapping[str, Tolerance]
    goal_time: float  # how long after the end of the trajectory the goal may take to be reached [s]


def goal_tolerances(
    names: Sequence[str],
    path: Iterable[NamedTolerance],
    goal: Iterable[NamedTolerance],
    goal_time: float,
    defaults: Mapping[str, Value],
) -> GoalTolerances:
    """The tolerances of a goal, with the defaults where it gives none.

    Parameters
    ----------
    names : sequence of str
        The goal's joints.
    path, goal : iterable of NamedTolerance
        The goal's fields path_tolerance and goal_tolerance.
    goal_time : float
        Its goal_time_tolerance [s].
    defaults : mapping
        The node's parameters, by name.

    Raises
    ------
    GoalError
        For a joint that the trajectory does not have or that is named twice, a negative tolerance
        other than -1, or one that is not a number or cannot be checked.
    """
    stopped = _limit(float(defaults["constraints.stopped_velocity_tolerance"]))
    on_the_way = {
        name: Tolerance(_limit(float(defaults[f"constraints.{name}.trajectory"]))) for name in names
    }
    at_the_end = {
        name: Tolerance(_limit(float(defaults[f"constraints.{name}.goal"])), stopped)
        for name in names
    }
    return GoalTolerances(
        _overridden(on_the_way, path, "path_tolerance"),
        _overridden(at_the_end, goal, "goal_tolerance"),
        _chosen(goal_time, _limit(float(defaults["constraints.goal_time"])), "goal_time_tolerance"),
    )


def _limit(parameter: float) -> float:
    return parameter or math.inf


def _chosen(given: float, default: float, what: str) -> float:
    """The tolerance that a number of a goal stands for."""
    if given == 0.0:
        return default
    if given == ERASED:
        return math.inf
    if not (math.isfinite(given) and given > 0.0):
        raise GoalError(
            GoalCode.INVALID_GOAL,
            f"{what} = {given:g}: expected a number above 0, 0 for the default or -1 for no limit",
        )
    return given


def _overridden(
    defaults: Mapping[str, Tolerance], given: Iterable[NamedTolerance], field: str
) -> dict[str, Tolerance]:
    found = dict(defaults)
    seen = set()
    for entry in given:
        what = f"{field} of {shown(entry.name)}"
        if entry.name not in defaults:
            known = ", ".join(defaults)
            raise GoalError(
                GoalCode.INVALID_JOINTS, f"{what}: no joint of the trajectory; it has {known}"
            )
        if entry.name in seen:
            raise GoalError(GoalCode.INVALID_JOINTS, f"{what}: given twice")
        seen.add(entry.name)
        if _chosen(entry.acceleration, math.inf, f"{what}: acceleration") < math.inf:
            raise GoalError(
                GoalCode.INVALID_GOAL,
                f"{what}: acceleration = {entry.acceleration:g} rad/s^2, expected 0 or -1: the "
                "acceleration of a joint is not measured",
            )
        default = defaults[entry.name]
        found[entry.name] = Tolerance(
            _chosen(entry.position, default.position, f"{what}: position"),
            _chosen(entry.velocity, default.velocity, f"{what}: velocity"),
        )
    return found
