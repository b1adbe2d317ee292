"""How far pressures that are followed change until the middle between two samples."""

from __future__ import annotations

import numpy as np

from pam_gap.prediction.channel_order import BOTH_PRESSURES, POSITION
from pam_gap.prediction.fit import Array
from pam_model.errors import PamError
from pam_model.plant.muscle_arms import SIDES
from pam_model.rig import Rig
from pam_model.robot.compose import compose
from pam_model.views.gas_volume import gas_volume
from pam_model.views.muscle_path import path_length

KNOTS = 33
"""Angles at which the volume of a muscle is taken; it is smooth between them."""


def half_flow(rig: Rig, joint: int, restart: Array) -> Array:
    """How much the flow of the valves changes pressures within half a sample [Pa], shape (N, 2).

    Half of the change from one sample to the next, without what the motion of a shut muscle makes
    of it. The volumes are those of the rig file.
    """
    pressures, angle = restart[:, BOTH_PRESSURES], np.nan_to_num(restart[:, POSITION])
    robot = compose(rig)
    knots = np.linspace(angle.min(), angle.max(), KNOTS)
    shut = np.zeros((len(angle) - 1, len(SIDES)))
    for side, name in enumerate(rig.joints[joint].muscles):
        muscle = next(m for m in robot.muscles if m.name == name)
        try:
            at = [np.where(np.arange(len(rig.joints)) == joint, q, 0.0) for q in knots]
            lengths = [path_length(muscle, one) for one in at]
            volume = np.interp(angle, knots, [gas_volume(muscle, length) for length in lengths])
        except PamError:  # an angle that the model of the muscle does not reach
            continue
        absolute = np.maximum(pressures[:-1, side], 0.0) + rig.gas.ambient_pressure
        growth = (volume[:-1] / volume[1:]) ** rig.gas.polytropic_exponent
        shut[:, side] = absolute * (growth - 1.0)
    result = np.zeros_like(pressures)
    result[:-1] = 0.5 * (np.diff(pressures, axis=0) - shut)
    return result
