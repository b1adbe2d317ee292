"""Small swings of a joint at rest are told, with their cause, and nothing else is."""

import numpy as np
import pytest

from pam_control.controller import Controller
from pam_control.feedback.rest_watch import RestWatch
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.settings import ControlSettings

PERIOD = 0.002
STEP = 3.8e-4  # rad, of the encoder
PUSHES = np.cumsum(np.random.default_rng(2).uniform(0.3, 2.0, 40))  # s


def told(position, seconds=6.0, rests=lambda time: True):
    """When the watch tells something of a position over time, and what."""
    random, watch = np.random.default_rng(1), RestWatch()
    for k in range(round(seconds / PERIOD)):
        time = k * PERIOD
        seen = STEP * round((position(time) + 1e-4 * random.standard_normal()) / STEP)
        what = watch.update(time, seen, rests(time))
        if what:
            return time, what
    return None


@pytest.mark.parametrize("hertz", [1.0, 2.0, 5.0, 9.0, 15.0])
@pytest.mark.parametrize("swing", [4e-3, 15e-3])
def test_swings_are_told_within_three_seconds_with_period_and_size(hertz, swing):
    found = told(lambda t: 0.3 + 0.5 * swing * np.sin(2.0 * np.pi * hertz * t))
    assert found is not None
    time, what = found
    assert time < 3.0
    size, shown = float(what.split("by ")[1].split()[0]), float(what.split("at ")[2].split()[0])
    assert size == pytest.approx(1e3 * swing, abs=0.9)
    assert shown == pytest.approx(hertz, rel=0.2)
    assert "a delay" in what


def test_a_slow_one_of_a_third_of_a_hertz_is_told_after_two_periods():
    found = told(lambda t: 5e-3 * np.sin(2.0 * np.pi * 0.33 * t), seconds=10.0)
    assert found is not None
    assert found[0] < 8.0


def test_a_joint_that_sticks_and_jumps_has_another_cause():
    found = told(lambda t: 4e-3 * np.tanh(8.0 * np.sin(2.0 * np.pi * 0.8 * t)))
    assert found is not None
    assert "dry friction" in found[1]


@pytest.mark.parametrize(
    "position",
    [
        lambda t: 0.3,
        lambda t: 1e-3 * np.sin(2.0 * np.pi * 6.0 * t),
        lambda t: 0.05 * np.exp(-t) * t,
        lambda t: 0.03 * np.exp(-4.0 * t) * np.cos(2.0 * np.pi * 3.0 * t),
        lambda t: 6e-3 * float(np.exp(-(((t - PUSHES) / 0.1) ** 2)).sum()),
    ],
    ids=["rest", "small swings", "creep", "settling", "pushes"],
)
def test_nothing_else_is_told(position):
    assert told(position, seconds=20.0) is None


def test_swings_during_a_motion_belong_to_another_watch():
    assert told(lambda t: 0.01 * np.sin(30.0 * t), rests=lambda time: False) is None


def test_a_loop_with_a_long_delay_is_told_before_it_moves(closed_loop, rig):
    """30 ms that nobody knows of, in the commands; the joint is pushed a little while it rests."""
    controller = Controller(rig, ControlSettings())
    loop = closed_loop(controller, command_delay=0.033)
    loop.run(0.5)
    points = [TrajectoryPoint(0.5, [0.1], [0.0], [0.0])]
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    loop.run(0.5)
    loop.run(3.0)
    assert "swings at rest" in controller.guard.swings or controller.guard.softened
    controller.guard.clear()
    assert controller.guard.swings == ""


def test_a_loop_without_one_is_not(closed_loop, rig, reaching):
    controller = Controller(rig, ControlSettings())
    loop = closed_loop(controller)
    loop.run(0.5)
    points, duration = reaching
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    loop.run(duration + 2.0)
    assert controller.guard.swings == ""
