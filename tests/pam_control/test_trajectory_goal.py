"""The watch over an action goal, without ROS: tolerances on the way and at the end, replacement."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from pam_control.actions.goal_tolerances import (
    PARAMETERS,
    GoalCode,
    GoalError,
    GoalTolerances,
    Tolerance,
    goal_tolerances,
    joint_tolerances,
)
from pam_control.actions.trajectory_goal import TrajectoryGoal
from pam_control.controller import Controller
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.settings import ControlSettings

DEFAULTS = {p.key: p.default for p in (*PARAMETERS, *joint_tolerances("elbow"))} | {
    "constraints.elbow.trajectory": 0.3,
    "constraints.elbow.goal": 0.05,
    "constraints.goal_time": 2.0,
}


def given(name="elbow", position=0.0, velocity=0.0, acceleration=0.0):
    return SimpleNamespace(
        name=name, position=position, velocity=velocity, acceleration=acceleration
    )


def test_zero_means_the_default_and_minus_one_no_limit():
    found = goal_tolerances(["elbow"], [given()], [given(position=-1.0, velocity=0.4)], 0, DEFAULTS)
    assert found.path["elbow"] == Tolerance(0.3, math.inf)
    assert found.goal["elbow"] == Tolerance(math.inf, 0.4)
    assert found.goal_time == 2.0
    assert goal_tolerances(["elbow"], [], [], -1.0, DEFAULTS).goal_time == math.inf


@pytest.mark.parametrize(
    ("path", "time", "code", "text"),
    [
        ([given("knee", 0.1)], 0.0, GoalCode.INVALID_JOINTS, "'knee'"),
        ([given(), given()], 0.0, GoalCode.INVALID_JOINTS, "given twice"),
        ([given(position=-0.5)], 0.0, GoalCode.INVALID_GOAL, "position = -0.5"),
        ([given(velocity=math.nan)], 0.0, GoalCode.INVALID_GOAL, "velocity = nan"),
        ([given(acceleration=1.0)], 0.0, GoalCode.INVALID_GOAL, "not measured"),
        ([], -2.0, GoalCode.INVALID_GOAL, "goal_time_tolerance = -2"),
    ],
)
def test_a_tolerance_that_cannot_be_meant_is_refused(path, time, code, text):
    with pytest.raises(GoalError, match=text) as caught:
        goal_tolerances(["elbow"], path, [], time, DEFAULTS)
    assert caught.value.code is code


class Following:
    """An elbow that follows a goal; `run` judges the goal after every cycle."""

    def __init__(self, closed_loop, rig, tolerances, *, effects=None, duration=1.0):
        self.controller = Controller(rig, ControlSettings())
        self.loop = closed_loop(self.controller, effects=effects)
        self.loop.run(1.5)
        references, now = self.controller.references, self.loop.time
        points = [TrajectoryPoint(duration, [0.4], [0.0], [0.0])]
        planned = references.plan(["elbow"], points, start=None, now=now)
        splines, note = references.join(planned, references.references_at_join(planned, now), now)
        references.take(splines)
        self.goal = TrajectoryGoal(splines, tolerances, note, now)

    def run(self, duration):
        def judge(time):
            names, telemetry = self.controller.rig.joint_names, self.controller.telemetry
            joints = dict(zip(names, telemetry, strict=True))
            self.goal.observe(time, joints, self.controller.references)

        return self.loop.run(duration, judge)


def tolerances(path=math.inf, goal=math.inf, goal_time=math.inf):
    return GoalTolerances({"elbow": Tolerance(path)}, {"elbow": Tolerance(goal, 0.1)}, goal_time)


def test_a_goal_is_reached_after_the_end_of_its_trajectory_and_not_before(closed_loop, rig):
    following = Following(closed_loop, rig, tolerances(0.1, 0.01, 2.0))
    following.run(0.9)
    assert following.goal.outcome is None
    following.run(1.0)
    assert following.goal.outcome.reached
    assert following.goal.outcome.code is GoalCode.SUCCESSFUL


def test_a_path_tolerance_aborts_and_the_joint_brakes_within_its_limits(closed_loop, rig):
    following = Following(
        closed_loop,
        rig,
        tolerances(path=0.004),
        effects={"coulomb_friction.torque": 1.5},
        duration=0.6,
    )
    record = following.run(1.5)
    outcome = following.goal.outcome
    assert outcome.code is GoalCode.PATH_TOLERANCE_VIOLATED
    assert "elbow" in outcome.text and "0.004 rad" in outcome.text
    reference = record.column(1)
    acceleration = np.diff(reference, 2) / 0.002**2
    assert np.abs(acceleration).max() < 1.02 * rig.joints[0].max_acceleration
    assert np.ptp(reference[-100:]) < 1e-9
    assert reference[-1] < 0.39


def test_a_goal_that_is_not_reached_in_time_is_aborted_with_its_error(closed_loop, rig):
    following = Following(closed_loop, rig, tolerances(goal=1e-6, goal_time=0.3))
    following.run(1.2)
    assert following.goal.outcome is None
    following.run(0.3)
    outcome = following.goal.outcome
    assert outcome.code is GoalCode.GOAL_TOLERANCE_VIOLATED
    assert "after the end of the trajectory" in outcome.text


@pytest.mark.parametrize("what", ["another trajectory", "a streamed command", "a stop"])
def test_a_goal_ends_when_something_else_moves_its_joint(closed_loop, rig, what):
    following = Following(closed_loop, rig, tolerances())
    following.run(0.3)
    references, now = following.controller.references, following.loop.time
    if what == "another trajectory":
        points = [TrajectoryPoint(1.0, [0.1], [0.0], [0.0])]
        references.follow(["elbow"], points, start=None, now=now)
    elif what == "a streamed command":
        references.stream(["elbow"], [0.2], now=now)
    else:
        references.stop([], now)
    following.run(0.01)
    assert following.goal.outcome.code is GoalCode.INVALID_GOAL
    assert what in following.goal.outcome.text
