"""Without permission of full speed, references keep the joints' reduced velocity."""

import dataclasses

import numpy as np

from pam_control.controller import Controller
from pam_control.references.motion_limiter import REFERENCE_SHARE
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.settings import ControlSettings
from pam_model.rig import People

FAST = [TrajectoryPoint(0.4, [0.6], [0.0], [0.0])]


def made(closed_loop, rig):
    """A controller that has heard from no driver whether full speed is permitted."""
    asking = dataclasses.replace(rig, people=People(full_speed_topic=True))
    controller = Controller(asking, ControlSettings())
    loop = closed_loop(controller)
    loop.run(1.5)
    return controller, loop


def send(controller, loop):
    return controller.references.follow(["elbow"], FAST, start=None, now=loop.time)


def test_a_trajectory_is_played_at_the_reduced_speed_until_full_speed_is_permitted(
    closed_loop, rig
):
    controller, loop = made(closed_loop, rig)
    assert "slowed down" in send(controller, loop)
    record = loop.run(4.0)
    speed = np.abs(np.diff(record.column(1))) / 0.002
    assert 0.25 < speed.max() < 1.02 * REFERENCE_SHARE * 0.5
    measured = np.abs(np.convolve(np.diff(record.column(2)) / 0.002, np.ones(10) / 10, "valid"))
    assert measured.max() < 0.5  # what the driver compares
    assert abs(record.column(2)[-1] - 0.6) < 0.01


def test_each_change_brakes_and_holds_and_no_reference_becomes_faster_by_itself(closed_loop, rig):
    controller, loop = made(closed_loop, rig)
    controller.limits.reduce_speed(False, loop.time)
    loop.run(0.1)
    assert controller.reason_against_references() == ""
    send(controller, loop)
    loop.run(0.2)
    assert controller.references.speed("elbow") > 1.0
    controller.limits.reduce_speed(True, loop.time)
    assert "another speed" in controller.reason_against_references()
    record = loop.run(0.5)
    assert np.abs(np.diff(record.column(1), 2)).max() / 0.002**2 < 1.02 * 200.0
    assert controller.references.speed("elbow") < 1e-6
    assert controller.reason_against_references() == ""
    assert controller.references.sample("elbow", loop.time).position < 0.55, "it went on"
    assert "slowed down" in send(controller, loop)
    loop.run(0.3)
    controller.limits.reduce_speed(False, loop.time)
    speed = np.abs(np.diff(loop.run(0.6).column(1))) / 0.002
    assert speed.max() < 0.31
    assert speed[-1] < 1e-3
