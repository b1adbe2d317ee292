"""A trajectory that replaces a motion is played in a sensible time, whatever the motion was."""

from __future__ import annotations

import random
from dataclasses import replace

import numpy as np
import pytest

from pam_control.control_step import Measurement
from pam_control.controller import Controller
from pam_control.references.motion_limiter import REFERENCE_SHARE
from pam_control.references.trajectory import CommandError, TrajectoryPoint
from pam_control.settings import ControlSettings
from pam_model.rig import Rig

REPLACEMENTS = 60


def controller_of(rig: Rig) -> Controller:
    controller = Controller(rig, ControlSettings())
    controller.step(0.0, Measurement([0.0], [2e5, 2e5], 0.0, 0.0))
    return controller


def weaker(rig: Rig) -> Rig:
    """Slow valves: most motions ask for more than they can drive."""
    for muscle in rig.muscles:
        valve = replace(muscle.valve, sonic_conductance=0.3 * muscle.valve.sonic_conductance)
        rig = rig.with_muscle(replace(muscle, valve=valve))
    return rig


def drawn(draw: random.Random, speed: float) -> list[TrajectoryPoint]:
    """One to four waypoints within the range, the last at rest."""
    count, time, points = draw.randint(1, 4), 0.0, []
    for index in range(count):
        time += draw.choice([0.5, 1.0, 3.0])
        velocity = 0.0 if index == count - 1 else draw.uniform(-speed, speed)
        points.append(TrajectoryPoint(time, (draw.uniform(-0.9, 0.9),), (velocity,), ()))
    return points


@pytest.mark.sampled("each speed once, with strong or with slow valves")
@pytest.mark.parametrize("change", [lambda rig: rig, weaker], ids=["elbow", "slow valves"])
@pytest.mark.parametrize("speed", [0.0, 1.0, 3.0])
def test_no_replacement_takes_for_ever(rig, change, speed):
    """Trajectories in motion were stretched up to 1e14 s, so that the joint stood still."""
    controller, draw, now = controller_of(change(rig)), random.Random(5), 0.0
    fastest = REFERENCE_SHARE * rig.joints[0].max_velocity
    played = 0
    for _ in range(REPLACEMENTS):
        controller.set_stiffness([draw.choice([4.0, 14.0, 30.0, 100.0])])
        points = drawn(draw, speed)
        try:
            note = controller.references.follow(["elbow"], points, start=None, now=now)
        except CommandError:  # out of the range between its waypoints
            continue
        played += 1
        spline = controller.references.spline("elbow")
        takes, asked = spline.end_time - now, points[-1].time_from_start
        assert takes < 25.0 * asked + 5.0, note
        assert takes < 1.1 * asked + 0.1 or "trajectory slowed down" in note
        times = np.linspace(now, now + takes, 200)
        speeds = [abs(controller.references.sample("elbow", t).velocity) for t in times]
        assert max(speeds) < 1.02 * fastest
        now += draw.uniform(0.02, min(takes, 4.0))
    assert played > 0.5 * REPLACEMENTS


def test_a_motion_beyond_what_the_valves_drive_is_braked_before_the_next(rig):
    """However long the way from it takes, its beginning exceeds the limit."""
    controller = controller_of(weaker(rig))
    references = controller.references
    swing = [
        TrajectoryPoint(1.0 + 0.02 * k, (0.4 * np.sin(0.16 * k),), (3.2 * np.cos(0.16 * k),), ())
        for k in range(100)
    ]
    swing.append(TrajectoryPoint(4.0, (0.0,), (0.0,), ()))
    references.follow(["elbow"], swing, start=None, now=0.0)
    end = references.spline("elbow").end_time
    for now in np.linspace(0.3 * end, 0.9 * end, 7):
        references.follow(["elbow"], swing, start=None, now=0.0)
        goal = [TrajectoryPoint(3.0, (0.3,), (0.0,), (0.0,))]
        references.follow(["elbow"], goal, start=None, now=float(now))
        spline = references.spline("elbow")
        assert spline.end_time - now < 6.0
        assert spline.sample(spline.end_time).position == pytest.approx(0.3)
