"""On a rig that is as its file says, no command makes the joint swing past its reference.

Drawn commands that the controller accepts, in closed loop with the simulated plant.
"""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from pam_control.controller import Controller
from pam_control.references.trajectory import CommandError, TrajectoryPoint
from pam_control.settings import ControlSettings
from pam_demo.motions import HOLD_STIFFNESS, arm_motion, chirp

DRAWS = 2  # of each kind; a draw takes about 0.4 s
MOST_BEYOND = 0.015  # rad past the range of the reference
MOST_ERROR = 0.05  # rad
KINDS = ("short", "waypoints", "positions only", "ends in motion", "interrupted", "streamed")


def short(draw: random.Random, position: float) -> list[TrajectoryPoint]:
    """5 to 500 mrad in 1 to 200 ms."""
    stroke = draw.choice((-1.0, 1.0)) * 10.0 ** draw.uniform(-2.3, -0.3)
    target = max(-0.95, min(0.95, position + stroke))
    fields = draw.choice(((), ([0.0],), ([0.0], [0.0])))
    return [TrajectoryPoint(10.0 ** draw.uniform(-3.0, -0.7), [target], *fields)]


def waypoints(
    draw: random.Random, speed: float, positions_only: bool = False
) -> list[TrajectoryPoint]:
    """Two to six waypoints, with speeds up to the joint's largest; the last one is at rest."""
    points, time, count = [], 0.0, draw.randint(2, 6)
    for index in range(count):
        time += 10.0 ** draw.uniform(-1.5, -0.2)
        velocity = draw.uniform(-speed, speed) if index < count - 1 else 0.0
        fields = () if positions_only else ([velocity],)
        points.append(TrajectoryPoint(time, [draw.uniform(-0.95, 0.95)], *fields))
    return points


def ends_in_motion(draw: random.Random) -> list[TrajectoryPoint]:
    time = 10.0 ** draw.uniform(-1.5, 0.0)
    return [TrajectoryPoint(time, [draw.uniform(-0.8, 0.8)], [draw.uniform(-5.0, 5.0)])]


@pytest.fixture
def controller(rig):
    settings = ControlSettings(allow_nonzero_end_velocity=True)
    return Controller(rig, settings)


def played(controller, loop, kind, draw):
    """The rows of a drawn command, until the joint rests again."""
    references, limit = controller.references, controller.rig.joints[0].max_velocity
    here = references.sample("elbow", loop.time).position
    if kind == "streamed":
        targets = [draw.uniform(-0.9, 0.9) for _ in range(20)]
        begin, pause = loop.time, draw.choice((0.05, 0.1, 0.3))

        def stream(time: float) -> None:
            if 0.25 < time - begin < 1.2:  # the pause in front makes it a new act
                target = targets[int((time - begin) / pause) % 20]
                references.stream(["elbow"], [target], now=time)

        return loop.run(2.5, stream).rows
    points = {
        "short": lambda: short(draw, here),
        "waypoints": lambda: waypoints(draw, limit),
        "positions only": lambda: waypoints(draw, limit, positions_only=True),
        "ends in motion": lambda: ends_in_motion(draw),
        "interrupted": lambda: waypoints(draw, limit),
    }[kind]()
    references.follow(["elbow"], points, start=None, now=loop.time)
    rows = []
    if kind == "interrupted":
        rows += loop.run(draw.uniform(0.02, 0.5)).rows
        next_points = draw.choice((short(draw, here), waypoints(draw, limit), []))
        references.follow(["elbow"], next_points, start=None, now=loop.time)
    spline = references.spline("elbow")
    rest = 0.0 if spline is None else min(spline.end_time - loop.time, 4.0)
    return rows + loop.run(rest + 0.8).rows


@pytest.mark.sampled("one draw of each kind of command", alike=lambda kind, number: kind)
@pytest.mark.parametrize("number", range(DRAWS))
@pytest.mark.parametrize("kind", KINDS)
def test_no_accepted_command_throws_the_joint_past_its_reference(
    controller, closed_loop, kind, number
):
    draw = random.Random(f"{kind} {number}")
    loop = closed_loop(controller)
    loop.run(0.5)
    start = [TrajectoryPoint(0.7, [draw.uniform(-0.6, 0.6)], [0.0], [0.0])]
    controller.references.follow(["elbow"], start, start=None, now=loop.time)
    loop.run(1.1)
    rows = np.array(played(controller, loop, kind, draw))
    reference, position = rows[:, 1], rows[:, 2]
    beyond = max(position.max() - reference.max(), reference.min() - position.min())
    assert beyond < MOST_BEYOND
    assert np.abs(reference - position).max() < MOST_ERROR
    assert not controller.guard.softened
    assert not controller.guard.stopped


def test_45_mrad_in_20_ms_does_not_become_a_swing_of_123_mrad(controller, closed_loop):
    loop = closed_loop(controller)
    loop.run(1.0)
    here = controller.references.sample("elbow", loop.time).position
    points = [TrajectoryPoint(0.02, [here + 0.045], [0.0], [0.0])]
    note = controller.references.follow(["elbow"], points, start=None, now=loop.time)
    assert "times what its valves can drive" in note
    position = loop.run(1.0).column(2)
    assert position.max() < here + 0.045 + 0.01
    assert position[-1] == pytest.approx(here + 0.045, abs=2e-3)
    assert not controller.guard.softened


@pytest.mark.parametrize("offset", [3.8e-4, -3e-3])  # a step of the encoder; almost `NEAR`
@pytest.mark.parametrize("first", [0.0, 0.02])  # s
def test_a_trajectory_that_begins_beside_the_joint_begins_calmly(
    controller, closed_loop, offset, first
):
    """Going to its first waypoint at once would open the valves fully for nothing."""
    loop = closed_loop(controller)
    loop.run(1.0)
    here = controller.references.sample("elbow", loop.time).position
    begin = here + offset
    points = [
        TrajectoryPoint(first + t, [begin + 0.01 * t**3], [0.03 * t**2], [0.06 * t])
        for t in np.arange(0.0, 1.0, 0.02).tolist()
    ]
    points.append(TrajectoryPoint(1.4 + first, [begin + 0.02], [0.0], [0.0]))
    sent = loop.time
    assert not controller.references.follow(["elbow"], points, start=None, now=sent)
    spline = controller.references.spline("elbow")
    rows = loop.run(0.8)
    for valve in (5, 6):
        assert np.abs(rows.column(valve)).max() < 0.3
    for t in (0.3, 0.6):
        expected = begin + 0.01 * t**3
        assert spline.sample(sent + first + t).position == pytest.approx(expected, abs=1e-9)
    reference = rows.column(1)
    assert np.abs(np.diff(reference, 2)).max() / 0.002**2 < 3.0


@pytest.mark.parametrize("velocity", [-5.0, -2.0, 3.0])
def test_a_trajectory_that_ends_in_motion_is_brought_to_rest_within_the_limits(rig, velocity):
    controller = Controller(rig, ControlSettings(allow_nonzero_end_velocity=True))
    generator = controller.references
    points = [TrajectoryPoint(0.3, [0.1 * math.copysign(1.0, velocity)], [velocity])]
    generator.follow(["elbow"], points, start=None, now=0.0)
    rows = []
    for step in range(1000):
        generator.advance(0.002 * step)
        rows.append(generator.sample("elbow", 0.002 * step).position)
    speed = np.diff(rows) / 0.002
    push = np.diff(speed) / 0.002
    limits = generator.motion["elbow"]
    assert np.abs(speed).max() > 1.0  # it does end in motion
    assert np.abs(push).max() <= limits.own_acceleration + limits.jerk * 0.02
    assert rows[-1] == pytest.approx(points[0].positions[0], abs=1e-6)


def test_an_end_in_motion_that_cannot_be_stopped_inside_the_range_is_refused(controller):
    upper = controller.rig.joints[0].position_limits[1]
    points = [TrajectoryPoint(0.5, [upper], [2.0])]
    with pytest.raises(CommandError, match="elbow ends at 1 rad with 2 rad/s"):
        controller.references.follow(["elbow"], points, start=None, now=0.0)
    assert controller.references.following("elbow") == "hold"


@pytest.mark.parametrize("motion", [arm_motion(), chirp()], ids=lambda motion: motion.name)
def test_motions_that_the_valves_just_follow_are_played_as_they_are(
    controller, closed_loop, motion
):
    """They need a few percent more than the valves' flow for some hundredths of a second."""
    loop = closed_loop(controller)
    controller.set_stiffness([HOLD_STIFFNESS])
    loop.run(1.0)
    rows = zip(motion.times, motion.positions, motion.velocities, motion.accelerations, strict=True)
    points = [TrajectoryPoint(2.0 + t, [q], [qd], [qdd]) for t, q, qd, qdd in rows]
    assert not controller.references.follow(["elbow"], points, start=None, now=loop.time)
