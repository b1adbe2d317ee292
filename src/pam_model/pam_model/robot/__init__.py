"""The robot that holds: a rig with its effects applied, composed in one place.

`compose(rig)` makes a `Robot` from a `Rig`; whoever needs numbers of the robot asks the views in
`pam_model.views`.
"""

from pam_model.rig.arms import Arm
from pam_model.robot.compose import compose, effective_force_model
from pam_model.robot.robot import (
    Robot,
    RobotJoint,
    RobotMuscle,
    RobotValve,
    Supply,
    Tube,
)

__all__ = [
    "Arm",
    "Robot",
    "RobotJoint",
    "RobotMuscle",
    "RobotValve",
    "Supply",
    "Tube",
    "compose",
    "effective_force_model",
]
