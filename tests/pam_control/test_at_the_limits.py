"""Commands at the limits: a start where the joint is and rounding are taken, the rest is refused.

The same cases pass through everything that takes a position: topic, action and stream all end in
`ReferenceGenerator`.
"""

from __future__ import annotations

import math
import threading

import numpy as np
import pytest

from pam_control.command_intake import CommandIntake
from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.references.reference_generator import ReferenceGenerator
from pam_control.references.sine_burst import sine_burst
from pam_control.references.trajectory import CommandError, check_trajectory
from pam_control.references.trajectory import TrajectoryPoint as Point
from pam_control.settings import ControlSettings

LIMITS = {"elbow": (-1.0, 1.0)}
FASTEST = {"elbow": 6.0}
ROUNDED = [
    math.nextafter(1.0, 2.0), -math.nextafter(1.0, 2.0), 1.0000001, float(np.float32(0.1) * 10)
]  # fmt: skip


def generator() -> ReferenceGenerator:
    made = ReferenceGenerator(LIMITS, max_velocities=FASTEST)
    made.hold({"elbow": -1.0})
    return made


@pytest.mark.parametrize("goal", ROUNDED)
def test_rounding_at_the_limits_is_taken_and_kept_within(goal: float) -> None:
    references = generator()
    references.follow(["elbow"], [Point(5.0, [goal], [0.0])], start=None, now=0.0)
    assert -1.0 <= references.sample("elbow", 6.0).position <= 1.0
    references.stream(["elbow"], [goal], [6.0000001], now=0.0)
    for tick in range(100):
        references.advance(0.002 * tick)
        assert -1.0 <= references.sample("elbow", 0.002 * tick).position <= 1.0


@pytest.mark.parametrize("start", [-1.003, -1.05])
def test_a_trajectory_may_start_where_the_joint_is(start: float) -> None:
    references = generator()
    points = [Point(0.0, [start], [0.0]), Point(2.0, [-0.5], [0.0])]
    for measured in (None, {"elbow": start}, {"elbow": math.nan}):
        assert references.plan(["elbow"], points, start=None, now=0.0, measured=measured)
    references.follow(["elbow"], points, start=None, now=0.0)
    assert references.sample("elbow", 0.0).position == -1.0
    assert references.sample("elbow", 3.0).position == pytest.approx(-0.5)


def test_every_point_of_a_dense_plan_on_its_way_back_is_accepted() -> None:
    """Planners give a point for each tenth of a second, so that several are beyond the limit."""
    references = generator()
    back = [(-1.003, 0.0), (-1.002, 0.02), (-1.0005, 0.01), (-0.98, 0.2), (-0.5, 0.0)]
    points = [Point(0.1 * k, [q], [v]) for k, (q, v) in enumerate(back)]
    assert references.plan(["elbow"], points, start=None, now=0.0, measured={"elbow": -1.003})
    references.follow(["elbow"], points, start=None, now=0.0)
    way = [references.sample("elbow", 0.01 * tick).position for tick in range(300)]
    assert min(way) >= -1.0
    assert way[-1] == pytest.approx(-0.5)


REFUSED = {
    "the joint is elsewhere": ([(0.0, -1.003), (2.0, 0.0)], {"elbow": 0.3}, "-1.003"),
    "beyond the driver's margin": ([(0.0, -1.051), (2.0, 0.0)], {"elbow": -1.051}, "-1.051"),
    "on the way out": ([(0.0, -1.003), (1.0, -1.004), (2.0, 0.0)], None, "point 1"),
    "never comes back": ([(0.0, -1.003), (1.0, -1.002)], None, "point 1"),
    "not the first point": ([(0.0, -1.003), (1.0, -1.003), (2.0, 0.0)], None, "point 1"),
    "the goal": ([(0.0, -1.0), (2.0, 1.003)], {"elbow": 1.003}, "1.003"),
    "the only point is the goal": ([(2.0, -1.003)], {"elbow": -1.003}, "-1.003"),
    "a hair more than rounding": ([(0.0, 0.0), (2.0, 1.000002)], None, "1.000002"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_the_rest_of_a_trajectory_stays_checked(case: str) -> None:
    rows, measured, told = REFUSED[case]
    points = [Point(time, [position]) for time, position in rows]
    with pytest.raises(CommandError, match="outside its position_limits") as caught:
        check_trajectory(["elbow"], points, LIMITS, measured=measured)
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("position", "measured", "taken"),
    [
        (-1.003, -1.003, True), (-1.003, -0.99, True), (-1.051, -1.051, False),
        (-1.003, 0.3, False), (-1.003, math.nan, False), (1.003, -1.003, False),
    ],
)  # fmt: skip
def test_a_stream_may_hold_a_joint_where_it_hangs(
    position: float, measured: float, taken: bool
) -> None:
    references = generator()
    told = {"elbow": measured}
    if taken:
        references.stream(["elbow"], [position], now=0.0, measured=told)
        references.advance(0.1)
        assert references.sample("elbow", 0.1).position == pytest.approx(-1.0)
    else:
        with pytest.raises(CommandError, match="outside its position_limits"):
            references.stream(["elbow"], [position], now=0.0, measured=told)


def test_a_velocity_at_its_limit_and_an_end_at_the_stop() -> None:
    """A last velocity that counts as rest needs no room beyond the end of the range."""
    references = generator()
    points = [Point(0.0, [-1.0], [0.0]), Point(1.0, [0.0], [6.0000001]), Point(9.0, [1.0], [4e-7])]
    references.follow(["elbow"], points, start=None, now=0.0)
    with pytest.raises(CommandError, match=r"at 6\.00001 rad/s is above its max_velocity, 6 rad/s"):
        references.follow(["elbow"], [Point(1.0, [0.0], [6.00001])], start=None, now=0.0)


@pytest.fixture(scope="module")
def at_the_stop(rig) -> CommandIntake:
    """The controller of a joint that is measured 3 mrad beyond its stop."""
    controller = Controller(rig, ControlSettings(safe_delay=0.0))
    place = rig.joints[0].position_limits[0] - 0.003
    controller.step(0.0, Measurement([place], [2e5, 2e5], 0.0, 0.0))
    return CommandIntake(controller, threading.Lock(), lambda: 0.0, lambda: "", lambda _: None)


def test_through_the_intake(at_the_stop, rig) -> None:
    """Topic and action call `follow`; messages of a stream call `stream`."""
    low, _ = rig.joints[0].position_limits
    points = [Point(0.0, [low - 0.003], [0.0]), Point(3.0, [low + 0.5], [0.0])]
    at_the_stop.follow([rig.joints[0].name], points, None)
    with pytest.raises(CommandError, match="outside its position_limits"):
        at_the_stop.follow([rig.joints[0].name], points[:1], None)
    at_the_stop.stream([rig.joints[0].name], [low - 0.003], [])
    assert at_the_stop.rejected == 0
    at_the_stop.stream([rig.joints[0].name], [low - 0.1], [])
    assert at_the_stop.rejected == 1


def test_a_small_test_motion_that_just_fits_is_taken() -> None:
    references = generator()
    references.hold({"elbow": 0.9})
    references.follow(["elbow"], sine_burst(0.9, 0.1, 1.5), start=None, now=0.0)
