"""Trajectories: splines as joint_trajectory_controller makes them, and what is rejected."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pam_control.references.reference_generator import ReferenceGenerator
from pam_control.references.spline import JointSpline, Waypoint
from pam_control.references.trajectory import CommandError, TrajectoryPoint, check_trajectory

LIMITS = {"elbow": (-1.0, 1.0), "wrist": (-0.5, 0.5)}
number = st.floats(-1.0, 1.0)


def generator() -> ReferenceGenerator:
    made = ReferenceGenerator(LIMITS)
    made.hold({"elbow": 0.1, "wrist": 0.2})
    return made


@given(st.tuples(number, number, number), st.tuples(number, number, number), st.floats(0.05, 2.0))
def test_quintic_meets_both_ends_in_all_derivatives(start, end, T):
    (x0, v0, a0), (x1, v1, a1) = start, end
    spline = JointSpline([Waypoint(3.0, x0, v0, a0), Waypoint(3.0 + T, x1, v1, a1)])
    start, end = spline.sample(3.0), spline.sample(3.0 + T * (1 - 1e-9))
    assert (start.position, start.velocity, start.acceleration) == pytest.approx((x0, v0, a0))
    assert end.position == pytest.approx(x1, abs=1e-6)
    assert end.velocity == pytest.approx(v1, abs=1e-5)
    assert end.acceleration == pytest.approx(a1, abs=1e-3)


@given(
    st.tuples(number, number),
    st.tuples(number, number),
    st.floats(0.1, 2.0),
    st.floats(0.1, 0.9),
)
def test_velocity_and_acceleration_are_the_derivatives(start, end, T, part):
    (x0, v0), (x1, v1) = start, end
    spline = JointSpline([Waypoint(0.0, x0, v0), Waypoint(T, x1, v1)])
    t, h = part * T, 1e-5
    low, middle, high = spline.sample(t - h), spline.sample(t), spline.sample(t + h)
    assert middle.velocity == pytest.approx(
        (high.position - low.position) / (2 * h), abs=1e-4 / T**2
    )
    assert middle.acceleration == pytest.approx(
        (high.velocity - low.velocity) / (2 * h), abs=1e-3 / T**3
    )


def test_after_its_last_waypoint_a_spline_rests():
    spline = JointSpline([Waypoint(0.0, 0.0), Waypoint(2.0, 1.0), Waypoint(3.0, 0.0)])
    after = spline.sample(9.0)
    assert (after.position, after.velocity, after.acceleration) == (0.0, 0.0, 0.0)


def test_a_later_first_point_is_reached_from_the_present_reference():
    made = generator()
    made.follow(["elbow"], [TrajectoryPoint(2.0, [0.5])], start=None, now=10.0)
    assert made.sample("elbow", 10.0).position == pytest.approx(0.1)
    assert made.sample("elbow", 11.0).position == pytest.approx(0.3)
    assert made.sample("elbow", 12.0).position == pytest.approx(0.5)


def test_replacing_a_moving_trajectory_keeps_position_velocity_and_acceleration():
    made = generator()
    made.follow(["elbow"], [TrajectoryPoint(1.0, [0.9], [0.0], [0.0])], start=None, now=0.0)
    before = made.sample("elbow", 0.4)
    made.follow(["elbow"], [TrajectoryPoint(1.0, [-0.9], [0.0], [0.0])], start=None, now=0.4)
    after = made.sample("elbow", 0.4)
    assert after.position == pytest.approx(before.position)
    assert after.velocity == pytest.approx(before.velocity)
    assert after.acceleration == pytest.approx(before.acceleration)


def test_joints_left_out_go_on_as_they_were():
    made = generator()
    made.follow(["wrist"], [TrajectoryPoint(1.0, [-0.4])], start=None, now=0.0)
    made.follow(["elbow"], [TrajectoryPoint(1.0, [0.4])], start=None, now=0.5)
    assert made.sample("wrist", 1.0).position == pytest.approx(-0.4)
    assert made.following("wrist") == made.following("elbow") == "trajectory"


def test_a_trajectory_started_in_the_past_is_joined_at_its_present_point():
    made = generator()
    points = [TrajectoryPoint(0.0, [0.0]), TrajectoryPoint(2.0, [0.8])]
    made.follow(["elbow"], points, start=9.0, now=10.0)
    assert made.sample("elbow", 10.0).position == pytest.approx(0.4)
    with pytest.raises(CommandError, match="ended 8 s ago"):
        made.follow(["elbow"], points, start=0.0, now=10.0)


def test_a_trajectory_that_would_begin_when_nobody_expects_it_is_rejected():
    """The stamp of a computer whose clock is an hour ahead."""
    made = generator()
    points = [TrajectoryPoint(1.0, [0.5])]
    with pytest.raises(CommandError, match=r"3\.6e\+03 s in the future, expected 60 s at most"):
        made.follow(["elbow"], points, start=3600.0, now=0.0)
    assert made.following("elbow") == "hold"
    made.follow(["elbow"], points, start=59.0, now=0.0)
    assert made.following("elbow") == "trajectory"


def test_a_streamed_speed_that_the_joint_cannot_have_is_rejected():
    """57 deg/s, sent as if they were rad/s, drove the joint to the end of its range."""
    limit = {"elbow": 6.0}
    made = ReferenceGenerator({"elbow": (-1.0, 1.0)}, max_velocities=limit)
    with pytest.raises(CommandError, match="elbow at -57 rad/s is above its max_velocity, 6 rad/s"):
        made.stream(["elbow"], [0.2], [-57.0], now=0.0)
    assert made.following("elbow") == "hold"
    made.stream(["elbow"], [0.2], [6.0], now=0.0)
    assert made.following("elbow") == "stream"


def test_no_points_stop_the_motion_where_the_reference_is():
    made = generator()
    made.follow(["elbow"], [TrajectoryPoint(1.0, [0.5])], start=None, now=0.0)
    made.follow(["elbow"], [], start=None, now=0.5)
    assert made.sample("elbow", 5.0).position == pytest.approx(0.3)
    assert made.following("elbow") == "hold"


BAD = [
    (["knee"], [TrajectoryPoint(1.0, [0.0])], "unknown joint 'knee'"),
    (["elbow", "elbow"], [TrajectoryPoint(1.0, [0.0, 0.0])], "twice"),
    (["elbow"], [TrajectoryPoint(1.0, [0.0, 0.1])], "2 positions for 1 joints"),
    (["elbow"], [TrajectoryPoint(1.0, [])], "0 positions for 1 joints"),
    (["elbow"], [TrajectoryPoint(1.0, [0.0], [0.0, 0.0])], "2 velocities for 1 joints"),
    (["elbow"], [TrajectoryPoint(1.0, [math.nan])], "positions of elbow is nan"),
    (["elbow"], [TrajectoryPoint(1.0, [0.0], [math.inf])], "velocities of elbow is inf"),
    (["elbow"], [TrajectoryPoint(1.0, [0.0], [], [0.0])], "accelerations without velocities"),
    (["elbow"], [TrajectoryPoint(1.0, [0.0]), TrajectoryPoint(1.0, [0.1])], "not later"),
    (["elbow"], [TrajectoryPoint(-1.0, [0.0])], "time_from_start = -1"),
    (["elbow"], [TrajectoryPoint(1.0, [1.5])], "outside its position_limits"),
    (["wrist"], [TrajectoryPoint(1.0, [0.1], [0.3])], "still moves at 0.3 rad/s"),
    ([], [TrajectoryPoint(1.0, [])], "names no joint"),
]


@pytest.mark.parametrize(("names", "points", "said"), BAD)
def test_a_bad_trajectory_is_rejected_by_name_and_what_runs_goes_on(names, points, said):
    made = generator()
    made.follow(["elbow"], [TrajectoryPoint(1.0, [0.5])], start=None, now=0.0)
    with pytest.raises(CommandError, match=said):
        made.follow(names, points, start=None, now=0.2)
    assert made.sample("elbow", 1.0).position == pytest.approx(0.5)


def test_a_moving_end_is_accepted_where_allowed():
    points = [TrajectoryPoint(1.0, [0.1], [0.3])]
    check_trajectory(["wrist"], points, LIMITS, allow_nonzero_end_velocity=True)


def test_a_spline_that_overshoots_the_limits_is_cut():
    made = generator()
    points = [TrajectoryPoint(0.5, [0.95], [3.0]), TrajectoryPoint(1.0, [0.95], [0.0])]
    made.follow(["elbow"], points, start=None, now=0.0)
    highest = max(made.sample("elbow", 0.5 + 0.01 * step).position for step in range(50))
    assert highest == 1.0


def test_a_stream_is_followed_without_lag_when_it_brings_velocities_and_then_ages_out():
    made = generator()
    for step in range(200):
        now = 0.01 * step
        made.stream(["wrist"], [0.2 - 0.2 * now], [-0.2], now=now)
        made.advance(now)
    assert made.sample("wrist", 1.99).position == pytest.approx(0.2 - 0.2 * 1.99, abs=1e-3)
    assert made.advance(2.1) == []
    assert made.advance(2.5) == ["wrist"]
    assert made.following("wrist") == "hold"
    held = made.sample("wrist", 2.5)
    assert held.velocity == 0.0
    assert held.position == pytest.approx(made.sample("wrist", 9.0).position)


@pytest.mark.parametrize(
    ("names", "positions", "velocities"),
    [
        (["knee"], [0.0], []),
        (["elbow"], [0.0, 0.0], []),
        (["elbow"], [math.nan], []),
        (["elbow"], [1.2], []),
        (["elbow"], [0.2], [math.nan]),
        (["elbow", "wrist"], [0.2, 0.9], []),
        ([], [], []),
    ],
)
def test_a_bad_stream_message_is_rejected_whole(names, positions, velocities):
    made = generator()
    with pytest.raises(CommandError, match="rejected"):
        made.stream(names, positions, velocities, now=0.0)
    assert made.following("elbow") == made.following("wrist") == "hold"
