"""A load that is put into the hand while the arm moves."""

from __future__ import annotations

import numpy as np

from pam_control.laws.position_stiffness import PositionStiffnessController
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.settings import ControlSettings

MASS, DISTANCE = 0.8, 0.21  # kg, m
SETTLED = 0.01  # rad


def test_a_payload_put_on_in_mid_motion_settles_in_a_second_and_later_steps_do_not_overshoot(
    closed_loop, rig, reaching
):
    points, duration = reaching
    controller = PositionStiffnessController(rig, ControlSettings())
    loop = closed_loop(controller)
    loop.run(2.0)
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    loop.run(0.5 * duration)
    joint = rig.joint("elbow")
    loop.plants[0].change(
        {
            "joint.gravity_torque": joint.gravity_torque + MASS * 9.80665 * DISTANCE,
            "joint.inertia": joint.inertia + MASS * DISTANCE**2,
        }
    )
    put_on = loop.run(0.5 * duration)
    shock = np.abs(put_on.error(0.0)).max()
    late = put_on.error(put_on.rows[0][0] + 1.0)
    assert np.abs(late).max() < SETTLED
    assert shock > np.abs(late).max()
    loop.run(1.0)
    for target in (0.5, -0.3, 0.2):
        start = controller.references.sample("elbow", loop.time).position
        step = [TrajectoryPoint(0.6, [target], [0.0], [0.0])]
        controller.references.follow(["elbow"], step, start=None, now=loop.time)
        position = loop.run(1.6).column(2)
        stroke = target - start
        assert ((position - target) * np.sign(stroke)).max() < 0.05 * abs(stroke)
    assert not controller.guard.softened
