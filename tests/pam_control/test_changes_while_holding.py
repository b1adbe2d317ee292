"""A parameter that changes while the joint holds a load must not move the joint."""

import numpy as np
import pytest

from pam_control.controller import MODEL_BASED, Controller
from pam_control.feedback.gain_schedule import GainSchedule
from pam_control.feedback.pid import PidGains
from pam_control.laws.pressure_difference_pid import PressureDifferencePid
from pam_control.laws.pressure_ratio_pid import PressureRatioPid
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.settings import ControlSettings

HELD = 0.8  # rad, where gravity asks for most of the torque
ALLOWED = 0.03  # rad
GAINS = {"elbow": GainSchedule.constant(PidGains(3.0, 40.0, 0.3, 0.01))}
CHANGES = [
    ("model", {"feedforward": False}),
    ("model", {"gains": GAINS}),
    ("model", {"extra_delay": 0.03}),
    ("model", {"measurement_delay": 0.004}),
    ("model", {"command_delay": 0.008}),
    ("model", {"derivative_filter": 0.03}),
    ("model", {"lead_ratio": 0.9}),
    ("model", {"pressure_gain": 15.0}),
    ("model", {"spool_limit": 0.5}),
    ("model", {"pressure_rate": 1e5}),
    ("model", {"stiffness_rate": 1.0}),
    ("no feedforward", {"feedforward": True}),
    ("no feedforward", {"integral_limit": 8.0}),
    ("ratio", {"law": PressureRatioPid(mean_pressure=2.0e5)}),
    ("difference", {"law": PressureDifferencePid(given={"elbow": (4e4, 1e5, 0.0, 0.0, 0.0)})}),
    ("difference", {"feedforward": False, "integral_limit": 30.0}),
    ("ratio", {"extra_delay": 0.03}),
]


LAWS = {"ratio": PressureRatioPid(), "difference": PressureDifferencePid()}


def held(closed_loop, rig, law):
    """The law at rest at HELD, and its loop."""
    # one stiffness, so that each change asks for few designs
    settings = ControlSettings(feedforward=law in ("model", "difference"), stiffness_grid=(14.0,))
    controller = Controller(rig, settings, law=LAWS.get(law, MODEL_BASED))
    loop = closed_loop(controller)
    loop.run(1.0)
    points = [TrajectoryPoint(1.0, [HELD], [0.0], [0.0])]
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    loop.run(3.0)
    return controller, loop


@pytest.mark.sampled("one change of each law", alike=lambda law, changed: law)
@pytest.mark.parametrize(("law", "changed"), CHANGES, ids=str)
def test_a_change_while_holding_does_not_move_the_joint(closed_loop, rig, law, changed):
    controller, loop = held(closed_loop, rig, law)
    before = loop.run(0.2).column(2).mean()
    designed = {"pressure_gain": None, "gains": {}}
    changed, law = dict(changed), changed.get("law")
    changed.pop("law", None)
    controller.change(controller.settings.replace(**{**designed, **changed}), law)
    moved = loop.run(1.5).column(2)
    assert np.abs(moved - before).max() < ALLOWED


def test_a_smaller_limit_of_the_integral_lets_the_joint_sink_slowly(closed_loop, rig):
    controller, loop = held(closed_loop, rig, "no feedforward")
    controller.change(controller.settings.replace(integral_limit=0.5))
    record = loop.run(2.0)
    speed = np.diff(record.column(2)[::10]) / np.diff(record.column(0)[::10])
    assert np.abs(speed).max() < 1.0
    assert abs(controller.channels[0].integral) < 3.0
