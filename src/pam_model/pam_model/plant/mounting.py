"""The plant's parameters while a robot is mounted in another way than its rig file says."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from pam_model.plant.parameters import INDEX

Array = npt.NDArray[np.float64]

LOCKED_INERTIA: Final = 1e9  # kg m^2, of a joint that is locked
LOCKED_DECAY: Final = 100.0  # 1/s, decay of the speed that a correction of the position causes


def turned_over(values: Array) -> Array:
    """Parameter vectors (..., n_parameters) of a robot that is mounted upside down."""
    mounted: Array = np.array(values)
    mounted[..., INDEX["joint.gravity_angle"]] += np.pi
    return mounted


def locked(values: Array) -> Array:
    """Parameter vectors (..., n_parameters) of a joint that is held."""
    mounted: Array = np.array(values)
    mounted[..., INDEX["joint.inertia"]] = LOCKED_INERTIA
    mounted[..., INDEX["joint.viscous_friction"]] = LOCKED_DECAY * LOCKED_INERTIA
    return mounted
