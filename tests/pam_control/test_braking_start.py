"""A slow trajectory that is sent while the joint still moves brings it to its goal, not beyond."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pam_control.references.braking_start import braked, way_from
from pam_control.references.motion_limiter import MotionLimits
from pam_control.references.spline import JointReference, JointSpline, Waypoint, Waypoints

LIMITS = MotionLimits(velocity=3.6, acceleration=120.0, jerk=4000.0)
states = st.tuples(st.floats(-0.5, 0.5), st.floats(-2.0, 2.0), st.floats(-20.0, 20.0))


def resting(time: float, position: float) -> Waypoints:
    return Waypoints.of([Waypoint(time, position, 0.0, 0.0)])


def test_a_goal_that_is_far_in_time_is_no_detour() -> None:
    """The direct quintic ran 5 rad past the goal, at 1.1 rad/s and more."""
    braking = JointReference(-0.499, -0.02, 2.0)
    spline = JointSpline(way_from(resting(20.0, 0.5), 0.0, braking, LIMITS))
    assert spline.highest == pytest.approx(0.5, abs=0.011)
    assert spline.lowest > -0.52
    assert spline.sample(20.0).position == pytest.approx(0.5)
    fastest = max(abs(spline.sample(0.1 * k).velocity) for k in range(200))
    assert fastest < 0.3


@given(states, st.floats(-0.5, 0.5), st.floats(0.3, 60.0))
def test_the_way_stays_between_start_stop_and_goal(state, goal, time) -> None:
    reference = JointReference(*state)
    spline = JointSpline(way_from(resting(time, goal), 0.0, reference, LIMITS))
    stop = braked(reference, LIMITS)
    if 2.0 * stop.time < time:
        near = [reference.position, stop.position, goal]
        # the brake itself may turn once before it rests
        margin = 0.03 + abs(stop.position - reference.position)
        assert min(near) - margin < spline.lowest
        assert spline.highest < max(near) + margin
    start = spline.sample(0.0)
    assert start.position == pytest.approx(reference.position)
    assert start.velocity == pytest.approx(reference.velocity)
    assert start.acceleration == pytest.approx(reference.acceleration)


@given(states)
def test_braking_keeps_the_limits(state) -> None:
    reference = JointReference(*state)
    stop = braked(reference, LIMITS)
    spline = JointSpline(
        Waypoints.of([Waypoint(0.0, *state), Waypoint(stop.time, stop.position, 0.0, 0.0)])
    )
    for k in range(50):
        sampled = spline.sample(stop.time * k / 50.0)
        assert abs(sampled.acceleration) <= max(LIMITS.acceleration, abs(reference.acceleration))
    assert abs(stop.position - reference.position) < 1.0


def test_a_resting_reference_and_a_joint_without_limits_go_straight() -> None:
    goal = resting(20.0, 0.5)
    assert way_from(goal, 0.0, JointReference(0.0, 0.0, 0.0), LIMITS).times.size == 2
    assert way_from(goal, 0.0, JointReference(0.0, 1.0, 2.0), None).times.size == 2
