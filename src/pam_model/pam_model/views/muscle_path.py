"""Length of a muscle's path at the angles of the joints that it turns."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from pam_model.robot.robot import Robot, RobotJoint, RobotMuscle


def path_length(muscle: RobotMuscle, positions: Any) -> Any:
    """Length of the path [m].

    Parameters
    ----------
    positions : sequence or mapping of float or array
        By joint of the robot [rad].
    """
    length = muscle.neutral_length
    for arm in muscle.arms:
        length -= arm.length * positions[arm.joint]
    return length


def path_speed(muscle: RobotMuscle, velocities: Sequence[float]) -> float:
    """Rate of the path's length [m/s] at the velocities of the robot's joints [rad/s]."""
    return -sum(arm.length * velocities[arm.joint] for arm in muscle.arms)


def farthest_position(robot: Robot, joint: RobotJoint) -> float:
    """Position [rad] at which the first muscle of a joint is as long as its threads, at most.

    A muscle is never longer than its thread.
    """
    return max(
        (muscle.geometry.thread_length - muscle.neutral_length) / abs(arm.length)
        for arm in joint.arms
        for muscle in (robot.muscles[arm.muscle],)
    )


def strokes_over_travel(robot: Robot, muscle: RobotMuscle, places: int) -> list[float]:
    """How much longer than neutral the path is, over the range of its joints [m].

    Parameters
    ----------
    robot : Robot
        Gives the position limits.
    places : int
        Positions of each joint, evenly spaced from limit to limit.

    Returns
    -------
    list of float
        One for each combination of positions; a single 0 for a bench muscle.
    """
    ranges = [
        [
            -arm.length * float(q)
            for q in np.linspace(*robot.joints[arm.joint].position_limits, places)
        ]
        for arm in muscle.arms
    ]
    return [float(sum(parts)) for parts in product(*ranges)]


def lengths_over_travel(robot: Robot, muscle: RobotMuscle, places: int) -> list[float]:
    """The lengths of the path at the same positions [m]."""
    return [muscle.neutral_length + stroke for stroke in strokes_over_travel(robot, muscle, places)]
