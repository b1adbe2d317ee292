"""Whether every muscle of a joint can pull wherever its joints turn."""

from __future__ import annotations

from typing import Final

import numpy as np

from pam_model.errors import RigError
from pam_model.robot.robot import Robot, RobotMuscle
from pam_model.views.muscle_path import lengths_over_travel

_LEAST_PULL: Final = 1e-3  # N; less is the rounding of a force that is zero
_PLACES: Final = 21  # of each joint
_LENGTHS: Final = 201  # at which a longer muscle is tried


def slack_muscles(robot: Robot) -> list[str]:
    """One line for each muscle that cannot pull at some angle of its joints, with the remedy.

    There no pressure gives the torque and stiffness that a controller asks for.

    Parameters
    ----------
    robot : Robot
        The robot; muscles on a bench turn no joint and are not judged.

    Raises
    ------
    PamError
        If a force model is not defined at these lengths.
    """
    return [
        line for muscle in robot.muscles if muscle.arms if (line := _slack(robot, muscle)) != ""
    ]


def refuse_slack_muscles(robot: Robot) -> None:
    """Refuse a robot with muscles that cannot pull.

    Raises
    ------
    RigError
        With one line for each of the `slack_muscles`.
    """
    lines = slack_muscles(robot)
    if lines:
        raise RigError("\n".join(lines))


def _slack(robot: Robot, muscle: RobotMuscle) -> str:
    pressure = min(muscle.max_pressure, robot.supply_gauge_pressure)
    lengths = lengths_over_travel(robot, muscle, _PLACES)
    slack = [length for length in lengths if not _pulls(muscle, pressure, length)]
    if not slack:
        return ""
    everywhere = len(slack) == len(lengths)
    share = "at every angle" if everywhere else "at some angles"
    joints = ", ".join(robot.joints[arm.joint].name for arm in muscle.arms)
    line = (
        f"{muscle.name}.neutral_length = {muscle.neutral_length:.4g} m: {share} of {joints} the "
        f"muscle pulls 0 N, although it has {pressure:g} Pa gauge (max_pressure, or the supply): "
        f"it is {min(slack):.4g} to {max(slack):.4g} m long there"
    )
    top = muscle.force_model.length_bounds[1]
    tried = np.linspace(min(slack), top, _LENGTHS)[1:-1]
    longer = next((float(one) for one in tried if _pulls(muscle, pressure, float(one))), None)
    if longer is None:
        return f"{line}, and would pull at no length; raise max_pressure and supply_pressure"
    needed = muscle.neutral_length + longer - min(slack)
    instead = "" if everywhere else ", a smaller pulley_radius, or narrower position_limits"
    return (
        f"{line}, and pulls from about {longer:.4g} m; use a neutral_length of {needed:.4g} m or "
        f"more{instead}"
    )


def _pulls(muscle: RobotMuscle, pressure: float, length: float) -> bool:
    return float(muscle.force_model.force(max(pressure, 0.0), length)) > _LEAST_PULL
