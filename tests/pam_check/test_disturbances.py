"""How far a joint yields: the figures are those of what pushes it."""

import math
from pathlib import Path

import numpy as np
import pytest

from pam_check.control.closed_loop import PERIOD, TOLD, true_rig
from pam_check.control.disturbances import (
    SWING,
    SWINGS_FOR,
    _errors,
    amplitude,
    muscles_alone,
    pushed,
)
from pam_check.control.rough_control import RoughControl
from pam_model.rig import load_rig

ELBOW = Path(__file__).parents[2] / "config" / "elbow.yaml"
pytest.importorskip("numba", reason="the truth plant is some 300 times slower without numba")


@pytest.mark.parametrize("torque", [-0.7, 0.0, 1.0])
@pytest.mark.parametrize("angle", [-0.5, 0.0, 0.4])
def test_a_push_adds_the_torque_of_a_force_on_the_limb(torque, angle):
    joint, _ = true_rig(load_rig(ELBOW))
    after = pushed(joint, torque)

    def weight(which):
        return -which.gravity_torque * math.sin(angle - which.gravity_angle)

    expected = torque * math.cos(angle - joint.gravity_angle)
    assert weight(after) - weight(joint) == pytest.approx(expected, abs=1e-12)


def test_the_amplitude_is_that_of_one_frequency_beside_an_offset():
    times = PERIOD * np.arange(4000)
    signal = 0.3 + 2e-3 * np.sin(np.pi * times + 0.7) + 5e-3 * np.sin(12.0 * np.pi * times)
    assert amplitude(signal, 0.5) == pytest.approx(2e-3, rel=1e-3)


def test_feedback_halves_the_compliance_and_a_torque_that_swings_does_not_soften_it():
    """The gains would be lowered, were the slow swings taken for those of the loop."""
    rough = RoughControl(load_rig(ELBOW), TOLD, 1)
    omega = 2.0 * math.pi * 0.5
    errors = _errors(
        rough, rough.controller, SWINGS_FOR, 1, lambda time: SWING * math.sin(omega * time)
    )
    compliance = amplitude(errors[errors.size // 2 :], 0.5) / SWING
    assert compliance < 0.35 * muscles_alone(rough.controller).compliance[0]
    assert "outside torque" in rough.controller.guard.swings
    assert rough.controller.guard.lowered == 0
