"""The numbers of a robot's joints for compiled functions: the constants of the plant.

A row of `layout.C_*` and `M_*` for each joint. The braid of a muscle is in closed form if its model
is one of the cylinders that the plant has a formula for, and neither its threads nor its cable
stretch. Then the muscle stage of the plant gives what the force model gives; for other muscles, the
model itself has to be asked.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from pam_model.plant.constants import derive_constants
from pam_model.plant.layout import C_MUSCLES, M_CABLE, M_TABLE, M_THREAD, N_MUSCLE_CONSTANTS
from pam_model.plant.parameters import PlantParameters
from pam_model.robot import Robot


def joint_numbers(robot: Robot) -> npt.NDArray[np.float64]:
    """The constants of every joint, shape (n_joints, n_constants)."""
    rig = robot.rig
    return np.array(
        [
            derive_constants(PlantParameters.from_rig(rig, joint.place).values)
            for joint in robot.joints
        ]
    )


def is_closed_form(c: Any) -> bool:
    """Whether the braids of all muscles of a joint are in closed form."""
    muscles = range(C_MUSCLES, len(c), N_MUSCLE_CONSTANTS)
    return all(c[m + place] == 0.0 for m in muscles for place in (M_TABLE, M_THREAD, M_CABLE))
