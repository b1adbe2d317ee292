"""References keep the joint's limits of speed and acceleration, whatever is asked for."""

import contextlib
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pam_control.controller import Controller
from pam_control.references.motion_limiter import MotionLimits
from pam_control.references.reference_generator import ReferenceGenerator
from pam_control.references.trajectory import CommandError, TrajectoryPoint
from pam_control.settings import ControlSettings

BOUNDS = {"elbow": (-1.0, 1.0), "wrist": (-0.5, 0.5)}
LIMITS = {"elbow": MotionLimits(3.6, 200.0), "wrist": MotionLimits(2.0, 50.0)}
PERIOD = 0.002
HORIZON = 0.006
TOLERANCE = 1.02
JOINED = 1.05  # of the acceleration: a target that is nearly reached is taken as it is


class Played:
    """A generator that is advanced as the controller does, and what it gave out."""

    def __init__(self, start: float = 0.0) -> None:
        self.generator = ReferenceGenerator(
            BOUNDS, LIMITS, max_velocities={"elbow": 6.0, "wrist": 2.5}
        )
        self.generator.horizon = HORIZON
        self.generator.hold({"elbow": start, "wrist": 0.0})
        self.now = 0.0
        self.positions: dict[str, list[float]] = {name: [] for name in BOUNDS}

    def run(self, duration: float) -> "Played":
        for _ in range(round(duration / PERIOD)):
            self.generator.advance(self.now)
            for name, found in self.positions.items():
                found.append(self.generator.sample(name, self.now).position)
            self.now += PERIOD
        return self

    def peaks(self, name: str = "elbow") -> tuple[float, float]:
        """Largest speed and acceleration, from the positions alone."""
        speed = np.diff(self.positions[name]) / PERIOD
        return float(np.abs(speed).max()), float(np.abs(np.diff(speed)).max() / PERIOD)

    def check(self) -> None:
        for name, limits in LIMITS.items():
            speed, acceleration = self.peaks(name)
            assert speed <= TOLERANCE * limits.velocity
            assert acceleration <= JOINED * limits.acceleration
            assert min(self.positions[name]) >= BOUNDS[name][0]
            assert max(self.positions[name]) <= BOUNDS[name][1]


@pytest.mark.parametrize("fields", [(), ([0.0],), ([0.0], [0.0])])
@pytest.mark.parametrize("moving_for", [0.5, 0.9, 0.97, 0.999])
def test_a_slow_trajectory_sent_in_motion_goes_to_its_goal_and_not_beyond(
    fields, moving_for
) -> None:
    """The spline carried the motion on for a share of the 20 s, up to the end of the range."""
    played = Played()
    first = TrajectoryPoint(1.0, [-0.5], [0.0], [0.0])
    played.generator.follow(["elbow"], [first], start=None, now=0.0)
    played.run(moving_for)
    slow = TrajectoryPoint(20.0, [0.5], *fields)
    played.generator.follow(["elbow"], [slow], start=None, now=played.now)
    played.positions["elbow"].clear()
    played.run(20.5)
    assert max(played.positions["elbow"]) < 0.515
    assert min(played.positions["elbow"]) > -0.6
    assert played.positions["elbow"][-1] == pytest.approx(0.5, abs=1e-3)
    assert played.peaks()[0] < 1.5


@pytest.mark.parametrize("fields", [(), ([0.0],), ([0.0], [0.0])])
def test_a_trajectory_of_a_millisecond_takes_as_long_as_the_limits_need(fields):
    played = Played(-0.95).run(0.1)
    note = played.generator.follow(
        ["elbow"], [TrajectoryPoint(0.001, [0.95], *fields)], start=None, now=played.now
    )
    played.run(1.5).check()
    assert played.positions["elbow"][-1] == pytest.approx(0.95, abs=1e-6)
    assert played.peaks()[0] > 0.5 * LIMITS["elbow"].velocity  # it moves nevertheless
    assert "slowed down" in note
    assert "elbow would need" in note


def test_a_trajectory_within_the_limits_is_played_exactly_as_it_was_asked():
    played = Played().run(0.1)
    rate = 2.0 * math.pi * 1.5
    times = np.arange(1, 101) * 0.02
    points = [
        TrajectoryPoint(
            float(t),
            [0.3 * (1 - math.cos(rate * t)) / 2],
            [0.15 * rate * math.sin(rate * t)],
            [0.15 * rate**2 * math.cos(rate * t)],
        )
        for t in times
    ]
    points[-1] = replace(points[-1], velocities=[0.0])
    begin = played.now
    assert played.generator.follow(["elbow"], points, start=None, now=begin) == ""
    played.run(1.9)
    # the first segment starts with the acceleration of the rest, not of the cosine
    found = np.array(played.positions["elbow"][50 + 20 :])
    wanted = [
        0.15 * (1 - math.cos(rate * (PERIOD * (50 + 20 + i) - begin))) for i in range(found.size)
    ]
    assert np.abs(found - wanted).max() < 1e-5
    assert not played.generator.limited("elbow")


def test_joints_that_are_slowed_down_together_stay_on_their_path():
    played = Played().run(0.1)
    points = [
        TrajectoryPoint(0.05, [0.4, 0.4], [0.0, 0.0], [0.0, 0.0]),
        TrajectoryPoint(0.10, [-0.4, -0.4], [0.0, 0.0], [0.0, 0.0]),
    ]
    note = played.generator.follow(["elbow", "wrist"], points, start=None, now=played.now)
    played.run(3.0).check()
    assert "wrist would need" in note
    elbow, wrist = (np.array(played.positions[name]) for name in ("elbow", "wrist"))
    assert np.abs(elbow - wrist).max() < 1e-3
    assert elbow.max() == pytest.approx(0.4, abs=1e-3)
    assert elbow[-1] == pytest.approx(-0.4, abs=1e-6)


def test_a_velocity_that_the_joint_cannot_have_is_refused_by_name():
    played = Played()
    points = [TrajectoryPoint(1.0, [0.2], [100.0]), TrajectoryPoint(2.0, [0.0], [0.0])]
    with pytest.raises(
        CommandError, match=r"elbow at 100 rad/s is above its max_velocity, 6 rad/s"
    ):
        played.generator.follow(["elbow"], points, start=None, now=0.0)


def test_a_streamed_step_becomes_a_limited_motion_and_is_told():
    played = Played(-0.9).run(0.1)
    told = False
    for _ in range(100):
        played.generator.stream(["elbow"], [0.9], now=played.now)
        played.run(0.01)
        told = told or played.generator.limited("elbow")
    played.check()
    assert told
    assert played.positions["elbow"][-1] == pytest.approx(0.9, abs=1e-3)
    assert max(played.positions["elbow"]) < 0.92
    assert not played.generator.limited("elbow")


def test_a_streamed_velocity_does_not_exceed_the_limits():
    played = Played().run(0.1)
    for index in range(100):
        sign = 1.0 if index % 20 < 10 else -1.0
        played.generator.stream(["elbow"], [0.9 * sign], [6.0 * sign], now=played.now)
        played.run(0.01)
    played.check()


@pytest.mark.parametrize("how", ["stop", "no points", "stream timeout"])
def test_stopping_brakes_within_the_limit_and_does_not_go_back(how):
    played = Played(-0.8).run(0.1)
    name = "elbow"
    if how == "stream timeout":
        for index in range(20):
            played.generator.stream([name], [-0.8 + 0.03 * index], [3.0], now=played.now)
            played.run(0.01)
        played.run(0.7)
    else:
        point = TrajectoryPoint(0.6, [0.8], [0.0], [0.0])
        played.generator.follow([name], [point], start=None, now=played.now)
        played.run(0.3)
        if how == "stop":
            played.generator.stop([name], played.now)
        else:
            played.generator.follow([name], [], start=None, now=played.now)
        played.run(0.5)
    played.check()
    positions = np.array(played.positions[name])
    assert np.ptp(positions[-100:]) < 1e-6
    assert positions.max() - positions[-1] < 2e-3
    assert played.generator.following(name) == "hold"


def test_positions_alone_that_turn_quickly_are_slowed_down_to_the_limits():
    played = Played().run(0.1)
    points = [TrajectoryPoint(0.2 * (i + 1), [0.4 if i % 2 == 0 else -0.2]) for i in range(6)]
    note = played.generator.follow(["elbow"], points, start=None, now=played.now)
    assert "elbow would need 4.5 rad/s" in note
    played.run(2.0).check()
    assert not played.generator.limited("elbow")
    assert max(played.positions["elbow"]) == pytest.approx(0.4, abs=1e-3)
    assert played.positions["elbow"][-1] == pytest.approx(-0.2, abs=1e-6)


position = st.floats(-1.0, 1.0)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(["trajectory", "stream", "stop"]),
            position,
            st.floats(-6.0, 6.0),
            st.floats(0.001, 0.3),
        ),
        min_size=1,
        max_size=8,
    )
)
@example(acts=[("trajectory", 1.0, 1.0, 0.28125)])  # leaves the range between its points
def test_no_sequence_of_commands_exceeds_the_limits(acts):
    played = Played().run(0.02)
    for kind, target, velocity, pause in acts:
        if kind == "trajectory":
            points = [
                TrajectoryPoint(0.5 * pause, [target], [velocity]),
                TrajectoryPoint(pause, [0.5 * target], [0.0]),
            ]
            played.generator.follow(["elbow"], points, start=None, now=played.now)
        elif kind == "stream":
            with contextlib.suppress(CommandError):  # a stream that goes on after a stop
                played.generator.stream(["elbow"], [target], [velocity], now=played.now)
        else:
            played.generator.stop(["elbow"], played.now)
        played.run(0.7 * pause)
    played.run(0.5).check()


def test_stiffness_changes_no_faster_than_the_rig_allows(closed_loop, rig):
    slow = rig.with_joint(replace(rig.joint("elbow"), max_stiffness_rate=5.0))
    controller = Controller(slow, ControlSettings(stiffness_rate=1e4))
    loop = closed_loop(controller)
    loop.run(3.0)
    before = controller.channels[0].telemetry.stiffness
    controller.set_stiffness([before + 8.0])
    loop.run(1.0)
    assert controller.channels[0].telemetry.stiffness - before == pytest.approx(5.0, abs=0.1)


def test_the_joint_itself_stays_below_its_limit_for_the_fastest_references(closed_loop, rig):
    controller = Controller(rig, ControlSettings())
    loop = closed_loop(controller)
    loop.run(2.0)
    peak = 0.0
    for target in (-0.95, 0.95, -0.95):
        points = [TrajectoryPoint(0.001, [target])]
        controller.references.follow(["elbow"], points, start=None, now=loop.time)
        record = loop.run(1.2)
        peak = max(peak, float(np.abs(np.diff(record.column(2)) / 0.002).max()))
    assert peak < rig.joint("elbow").max_velocity


def held_back(asked, rate, seconds=3.0):
    """Share of the cycles in which the limits keep a stream's reference away from what it asks."""
    played, count = Played(asked(0.0)).run(0.1), 0
    for index in range(round(seconds * rate)):
        played.generator.stream(["elbow"], [asked(index / rate)], now=played.now)
        for _ in range(round(1.0 / (rate * PERIOD))):
            played.run(PERIOD)
            count += played.generator.held_back("elbow")
    return count * PERIOD / seconds


@pytest.mark.parametrize("rate", [20.0, 50.0, 100.0, 250.0])
def test_only_a_stream_that_asks_for_too_much_is_held_back(rate):
    """A warning for every stream with steps is one that nobody reads."""

    def sine(frequency):
        return lambda time: 0.3 * math.sin(2.0 * math.pi * frequency * time)

    assert held_back(sine(0.3), rate) == 0.0
    assert held_back(lambda time: min(0.4 * time, 0.6), rate) == 0.0
    assert held_back(sine(4.0), rate) > 0.2
    assert held_back(lambda time: 0.8 if time > 0.5 else -0.8, rate) > 0.02
