"""The torque per pressure of a joint, to which a log fixes its other numbers.

If the pulls of both muscles, inertia, friction, gravity, volumes and conductances all grow by one
factor, pressures and angles stay as they are. Without measured forces, a log therefore fixes the
ratios of these numbers to the torque per pressure much better than the numbers themselves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pam_gap.answer.improved_rig import with_number
from pam_gap.calibration.free_numbers import STATICS, FreeRigNumber
from pam_gap.prediction.fit import Array
from pam_model.errors import PamError
from pam_model.joints.joint_statics import JointStatics
from pam_model.rig import Rig

GROWING = (
    "inertia",
    "viscous_friction",
    "gravity_torque",
    "dead_volume",
    "sonic_conductance",
)
"""Numbers that grow with the pull of the muscles, by the last part of their key."""
PRESSURE = 1e5  # Pa
SMALL = 1e-3


def grows(number: FreeRigNumber) -> bool:
    """Whether a number grows with the pull of the muscles."""
    return number.key.rpartition(".")[2] in GROWING


def torque_per_pressure(rig: Rig, joint: str) -> float:
    """Torque of a pressure difference at position 0, over this difference [N m/Pa].

    Raises
    ------
    PamError
        If position 0 is outside the model of a muscle.
    """
    model = JointStatics.from_rig(rig, joint)
    difference = model.torque((PRESSURE, 0.0), 0.0) - model.torque((0.0, PRESSURE), 0.0)
    return difference / (2.0 * PRESSURE)


def scale_weights(rig: Rig, joint: str, numbers: Sequence[FreeRigNumber]) -> Array:
    """Derivative of the logarithm of the torque per pressure by that of each number, shape (n,).

    It is 0 for a number that does not change it, and where it cannot be computed.
    """
    weights = np.zeros(len(numbers))
    base = torque_per_pressure(rig, joint)
    for place, one in enumerate(numbers):
        if one.stage != STATICS or not one.free.is_logarithmic:
            continue
        changed = with_number(rig, joint, one.name, 1.0 + SMALL, is_factor=True)
        try:
            weights[place] = math.log(torque_per_pressure(changed, joint) / base) / SMALL
        except (PamError, ValueError):
            continue
    return weights
