"""The linearised loop of a joint of one to four muscles: its inverse, its delays, its poles."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pam_control.feedback.closed_loop import state_space
from pam_control.feedback.linear_joint import LoopStructure, LoopTiming, frequency_response
from pam_model.joints.joint_muscle import JointMuscle
from pam_model.joints.joint_statics import JointStatics
from pam_model.robot import compose
from pam_model.views.linearised_joint import operating_point

pytest.importorskip("control")

SHARES = [(1.0,), (1.0, -1.0), (1.0, 0.8, -0.9), (1.0, 0.8, -0.9, -0.6)]
"""Arms over the radius of the elbow's pulley."""
PLACE = 0.1  # rad


@pytest.fixture(params=SHARES, ids=len)
def joint(request: Any, rig: Any) -> tuple[Any, JointStatics, list[float]]:
    """A joint, its statics, and pressures between the limits that its own inverse gives."""
    robot = compose(rig)
    muscle, radius = robot.muscles[0], rig.joints[0].pulley_radius
    one = JointMuscle(muscle.force_model, muscle.neutral_length, 1e4, 6e5)
    model = JointStatics([one] * len(request.param), [share * radius for share in request.param])
    drawn = [2.5e5 + 2e4 * k for k in range(len(request.param))]
    found = model.pressures_for(model.torque(drawn, PLACE), model.stiffness(drawn, PLACE), PLACE)
    return robot.joints[0], model, list(found.pressures)


def test_small_changes_are_those_of_the_inverse(joint: Any) -> None:
    limb, model, pressures = joint
    point = operating_point(limb, model, PLACE, pressures)
    torque, stiffness = model.torque(pressures, PLACE), model.stiffness(pressures, PLACE)
    h = 1e-3
    more = model.pressures_for(torque + h, stiffness, PLACE).pressures
    less = model.pressures_for(torque - h, stiffness, PLACE).pressures
    slopes = (np.array(more) - np.array(less)) / (2.0 * h)
    assert point.per_torque == pytest.approx(slopes, rel=1e-3, abs=1.0)
    held = np.array(pressures) + 1e-4 * np.array(point.per_position)
    assert model.torque(held, PLACE + 1e-4) == pytest.approx(torque, abs=1e-5)


@pytest.mark.parametrize("regulated", [False, True])
def test_the_poles_are_those_of_the_exact_response(joint: Any, regulated: bool) -> None:
    limb, model, pressures = joint
    point = operating_point(limb, model, PLACE, pressures)
    timing = LoopTiming(0.002, 0.004, 0.005, 0.4, 0.01, regulated)
    omega = np.geomspace(0.1, 100.0, 20)
    for feedback in ((), point.per_position):
        loop = LoopStructure(40.0, point.per_torque, feedback, measured_velocity=True)
        exact = frequency_response(point, loop, timing, omega)
        pade = state_space(point, loop, timing)(1j * omega)
        assert np.max(np.abs(pade / exact - 1.0)) < 1e-3
