"""Trajectories of positions only: what their velocities, their start and their end become."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pam_control.controller import Controller
from pam_control.references.motion_limiter import MotionLimits
from pam_control.references.reference_generator import ReferenceGenerator
from pam_control.references.sampled_path import thinned
from pam_control.references.spline import JointSpline, Waypoints
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.references.waypoint_velocities import SAMPLES, velocities_at
from pam_control.settings import ControlSettings

BOUNDS = {"elbow": (-1.0, 1.0)}
LIMITS = MotionLimits(3.6, 200.0, 2.4, 50.0, 1160.0, 1940.0)
STEP = 0.02  # s
position = st.floats(-1.0, 1.0)
NONE = np.nan


def shape(times, positions, given_velocities=None, **options):
    """The waypoints, with velocities."""
    times, positions = np.array(times, dtype=float), np.array(positions, dtype=float)
    missing = np.full_like(times, NONE)
    given_velocities = missing if given_velocities is None else np.array(given_velocities)
    found = velocities_at(times, positions, given_velocities, **options)
    return Waypoints(times, positions, found, missing)


def segments(points, count=21):
    """Of each segment the positions and velocities at some places, and the ends."""
    spline = JointSpline(points)
    for index, (start, end) in enumerate(zip(points.times, points.times[1:], strict=False)):
        times = np.linspace(start, end, count)[:-1]
        states = [spline.sample(float(time)) for time in times]
        ends = points.positions[index : index + 2]
        yield np.array([s.position for s in states]), np.array([s.velocity for s in states]), ends


def generator(limits=LIMITS):
    made = ReferenceGenerator(BOUNDS, {"elbow": limits} if limits else {})
    made.hold({"elbow": 0.0})
    return made


def follow(made, times, positions, now=0.0):
    points = [TrajectoryPoint(float(t), [float(q)]) for t, q in zip(times, positions, strict=True)]
    return made.follow(["elbow"], points, start=None, now=now)


def smooth(x):
    """From 0 to 1 with minimum jerk."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x * x)


@given(st.lists(st.tuples(st.floats(1.01 * SAMPLES, 2.0), position), min_size=2, max_size=9))
def test_between_waypoints_the_path_leaves_their_range_nowhere(steps):
    gaps, positions = zip(*steps, strict=True)
    points = shape(np.cumsum(gaps), positions)
    for path, _, ends in segments(points):
        assert path.min() >= ends.min() - 1e-9
        assert path.max() <= ends.max() + 1e-9


@given(
    st.lists(
        st.tuples(st.floats(0.015, 0.5), st.one_of(st.just(0.0), st.floats(1e-3, 0.3))),
        min_size=2,
        max_size=12,
    )
)
def test_samples_that_rise_or_hold_make_a_path_that_rises_or_holds(steps):
    gaps, rises = zip(*steps, strict=True)
    for path, speeds, ends in segments(shape(np.cumsum(gaps), np.cumsum(rises))):
        assert speeds.min() >= -1e-9
        if ends[0] == ends[1]:
            assert np.ptp(path) == 0.0


@given(st.lists(st.tuples(st.floats(0.015, 2.0), position), min_size=2, max_size=9))
def test_the_path_passes_through_all_waypoints_without_a_jump_of_the_velocity(steps):
    gaps, positions = zip(*steps, strict=True)
    points = shape(np.cumsum(gaps), positions)
    spline = JointSpline(points)
    for time, here, speed in zip(points.times, points.positions, points.velocities, strict=True):
        assert spline.sample(float(time)).position == pytest.approx(here, abs=1e-9)
        before = spline.sample(float(time) - 1e-9)
        if points.times[0] < time < points.times[-1]:
            assert before.velocity == pytest.approx(speed, abs=1e-4)


def test_velocities_that_are_given_are_kept_and_the_others_fit_to_them():
    times = np.arange(7) * 0.5
    wanted = np.array([NONE, 0.3, NONE, NONE, -0.2, NONE, 0.0])
    points = shape(times, [0.0, 0.2, 0.5, 0.6, 0.4, 0.1, 0.0], wanted)
    known = np.isfinite(wanted)
    assert np.array_equal(points.velocities[known], wanted[known])
    speeds = points.velocities
    assert speeds[2] > 0.0 > speeds[5]
    made = generator(None)
    messages = [
        TrajectoryPoint(float(t), [float(q)], [] if np.isnan(v) else [float(v)])
        for t, q, v in zip(times + 0.5, points.positions, wanted, strict=True)
    ]
    made.follow(["elbow"], messages, start=None, now=0.0)
    assert made.sample("elbow", 1.0).velocity == pytest.approx(0.3)
    assert made.sample("elbow", 2.5).velocity == pytest.approx(-0.2)


@pytest.mark.parametrize("hertz", [0.5, 1.0, 2.0])
def test_samples_of_a_sine_have_its_speed_and_acceleration_also_where_it_turns(hertz):
    omega = 2.0 * np.pi * hertz
    times = np.arange(150) * STEP
    spline = JointSpline(shape(times, 0.25 * np.sin(omega * times + 0.3)))
    for time in np.arange(0.5, 2.5, 0.003):
        state, phase = spline.sample(float(time)), omega * time + 0.3
        assert state.velocity == pytest.approx(0.25 * omega * np.cos(phase), abs=3e-3 * omega)
        acceleration = -0.25 * omega**2 * np.sin(phase)
        assert state.acceleration == pytest.approx(acceleration, abs=6e-3 * omega**2)


def test_a_turning_point_between_samples_does_not_leave_the_position_limits():
    times = np.arange(11) * STEP
    curve = 0.99999 - 5.0 * (times - 0.09) ** 2  # the highest sample is 0.5 mrad lower
    curve[[4, 5]] = 1.0
    assert max(path.max() for path, _, _ in segments(shape(times, curve))) > 1.0
    inside = shape(times, curve, bounds=(-1.0, 1.0))
    assert max(path.max() for path, _, _ in segments(inside)) <= 1.0


@pytest.mark.parametrize("times", [[0.0, 0.7, 1.2, 2.0], [0.3, 0.7, 1.2, 2.0]])
def test_a_joint_at_rest_begins_and_ends_at_rest(times):
    made = generator(None)
    follow(made, times, [0.0 if times[0] == 0.0 else 0.2, 0.4, 0.5, -0.3])
    rows = np.array([made.sample("elbow", t).position for t in np.arange(-0.1, 2.3, 1e-3)])
    speeds = np.diff(rows) / 1e-3
    assert np.abs(np.diff(speeds)).max() < 0.03  # nowhere 30 rad/s^2
    assert speeds[0] == speeds[-1] == 0.0
    assert rows.max() <= 0.5 + 1e-9
    assert rows[-1] == pytest.approx(-0.3)


@pytest.mark.parametrize("stop", [0.2, 0.5, 0.7])
def test_samples_that_stop_in_motion_are_braked_on_their_path(stop):
    """The limits' own motion went 23 mrad beyond the last sample and came back."""

    def curve(times):
        return 0.4 * (1.0 - np.cos(np.pi * times))

    times = np.arange(round(stop / STEP) + 1) * STEP
    made = generator()
    made.horizon = 0.006
    assert not follow(made, times, curve(times))
    now = np.arange(0.0, stop + 0.3, 0.002)
    path = []
    for time in now:
        made.advance(float(time))
        path.append(made.sample("elbow", float(time)).position)
    path = np.array(path)
    assert path.max() <= curve(stop) + 1e-9
    assert path[-1] == pytest.approx(curve(stop), abs=1e-9)
    before = now < stop - 0.08
    late = curve(np.maximum(now - 0.01, 0.0))  # where jumps of the acceleration are evened out
    assert np.all(late[before] - 1e-3 <= path[before])
    assert np.all(path[before] <= curve(now[before]) + 1e-3)
    assert np.abs(np.diff(path, 2)).max() / 0.002**2 < LIMITS.own_push


@settings(deadline=None)
@given(
    st.lists(st.tuples(st.floats(1e-3, 0.04), position), min_size=2, max_size=60),
    st.floats(-1.0, 1.0),
)
def test_dense_samples_become_waypoints_in_their_range(steps, slope):
    gaps, positions = (np.array(each) for each in zip(*steps, strict=True))
    times = np.cumsum(gaps)
    kept, found = thinned(times, np.stack([positions, slope * times], axis=1))
    assert (kept[0], kept[-1]) == (times[0], times[-1])
    assert (found[0, 0], found[-1, 0]) == (positions[0], positions[-1])
    assert np.diff(kept)[:-1].min(initial=1.0) >= 0.0149
    assert found[:, 0].min() >= positions.min() - 1e-12
    assert found[:, 0].max() <= positions.max() + 1e-12
    assert found[:, 1] == pytest.approx(slope * kept, abs=1e-9)
    if np.diff(times).min() >= 0.015:
        assert np.array_equal(kept, times)
        assert np.array_equal(found[:, 0], positions)


@pytest.mark.parametrize(("hertz", "step"), [(500, 4e-4), (1000, 1e-4), (100, 4e-4)])
def test_the_rounding_of_a_dense_recording_does_not_slow_it_down(rig, hertz, step):
    """The step of an encoder between samples 2 ms apart would be 100 rad/s^2."""
    controller = Controller(rig, ControlSettings())
    times = np.arange(0, hertz + 1) / hertz
    curve = 0.5 * smooth(times / 0.8)
    assert not follow(controller.references, times, np.round(curve / step) * step)
    spline = controller.references.spline("elbow")
    for time, expected in zip(times, curve, strict=True):
        assert spline.sample(float(time)).position == pytest.approx(expected, abs=1e-3)


def tracked(closed_loop, controller, points, duration, curve):
    """RMS of the joint beside the curve that was asked for, and the mean motion of a valve."""
    controller.deactivate()
    loop = closed_loop(controller)
    loop.run(2.0)
    begin = loop.time
    controller.references.follow(["elbow"], points, start=None, now=begin)
    rows = loop.run(duration + 0.2)
    asked = curve(rows.column(0) - begin)
    return (
        float(np.sqrt(np.mean((asked - rows.column(2)) ** 2))),
        float(np.abs(np.diff(rows.column(5))).mean()),
    )


def reach(times):
    return 0.5 * smooth(times / 0.8)


def sine(times):
    times = np.clip(times, 0.0, 3.0)
    return 0.25 * smooth(np.minimum(times, 3.0 - times) / 0.5) * np.sin(2.0 * np.pi * times)


@pytest.mark.parametrize(("curve", "duration"), [(reach, 0.8), (sine, 3.0)])
def test_samples_at_50_hz_are_followed_as_with_velocities_and_accelerations(
    rig, closed_loop, curve, duration
):
    """With straight lines between them, the error was 20 times as large."""
    controller = Controller(rig, ControlSettings())
    h, times = 1e-4, np.arange(1, round(duration / STEP) + 1) * STEP
    before, middle, after = (curve(times + side) for side in (-h, 0.0, h))
    speeds, pushes = (after - before) / (2.0 * h), (after - 2.0 * middle + before) / h**2
    speeds[-1] = pushes[-1] = 0.0
    complete = [
        TrajectoryPoint(float(t), [float(q)], [float(v)], [float(a)])
        for t, q, v, a in zip(times, middle, speeds, pushes, strict=True)
    ]
    alone = [TrajectoryPoint(point.time_from_start, point.positions) for point in complete]
    best, calm = tracked(closed_loop, controller, complete, duration, curve)
    error, activity = tracked(closed_loop, controller, alone, duration, curve)
    assert error < 1.5 * best
    assert activity < 1.5 * calm


@pytest.mark.parametrize("first", [0.0, STEP])
def test_chunks_that_replace_each_other_in_motion_go_on_smoothly(rig, closed_loop, first):
    """Ten positions every 0.1 s, as a policy sends them; the last are never played but once."""
    controller = Controller(rig, ControlSettings())
    loop = closed_loop(controller)
    loop.run(2.0)
    begin, sent = loop.time, []

    def curve(times):
        return 0.3 * np.sin(np.pi * np.clip(times, 0.0, 2.0)) ** 3

    def send(time):
        since = time - begin
        if since >= 0.1 * len(sent) - 1e-9 and len(sent) < 18:
            ahead = first + STEP * np.arange(10)
            sent.append(follow(controller.references, ahead, curve(since + ahead), now=time))

    rows = loop.run(2.5, send)
    since, reference, joint = (rows.column(index) for index in (0, 1, 2))
    since = since - begin
    assert not any(sent)  # none was slowed down
    played = since < 1.7
    assert np.abs(reference - curve(since))[played].max() < 0.01
    assert np.abs(reference - joint).max() < 5e-3
    assert np.abs(np.diff(reference, 2)).max() / 0.002**2 < 40.0
    last = curve(1.7 + first + 0.18)  # where the last chunk ends
    assert reference[-1] == pytest.approx(last, abs=1e-6)
    assert joint[-1] == pytest.approx(last, abs=2e-3)


@pytest.mark.filterwarnings("error")
def test_a_difference_of_nearly_nothing_fades_in_a_time_that_is_not_zero():
    made = generator()
    made.hold({"elbow": 1e-60})
    made.horizon = 0.006
    made.advance(1000.0)
    points = [TrajectoryPoint(0.0, [0.0], [0.0], [0.0]), TrajectoryPoint(1.0, [0.5], [0.0], [0.0])]
    made.follow(["elbow"], points, start=None, now=1000.0)
    assert made.sample("elbow", 1000.5).position == pytest.approx(0.0, abs=1e-9)
    spline = made.spline("elbow")
    assert spline.sample(1000.5).position == pytest.approx(0.25)


def test_an_end_in_motion_is_braked_for_all_joints_alike_so_that_their_path_stays_the_same():
    weak = MotionLimits(1.0, 20.0, 0.8, 5.0, 200.0, 400.0)
    made = ReferenceGenerator(BOUNDS | {"wrist": (-1.0, 1.0)}, {"elbow": LIMITS, "wrist": weak})
    made.hold({"elbow": 0.0, "wrist": 0.0})
    times = np.arange(26) * STEP
    curve = 0.1 * (1.0 - np.cos(np.pi * times))
    points = [
        TrajectoryPoint(float(t), [float(q), float(0.5 * q)])
        for t, q in zip(times, curve, strict=True)
    ]
    made.follow(["elbow", "wrist"], points, start=None, now=0.0)
    elbow, wrist = made.spline("elbow"), made.spline("wrist")
    assert elbow.end_time == wrist.end_time > 0.53  # the elbow alone could stop within 0.52 s
    for time in np.arange(0.0, 0.8, 0.003):
        expected = 0.5 * elbow.sample(float(time)).position
        assert wrist.sample(float(time)).position == pytest.approx(expected, abs=1e-9)
