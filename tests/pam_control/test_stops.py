"""Stops on request: brake and hold (category 2); brake, let air out slowly, stop (category 1)."""

import dataclasses

import numpy as np
import pytest

from pam_control.controller import MODEL_BASED, Controller
from pam_control.laws.pressure_ratio_pid import PressureRatioPid
from pam_control.reference_lowering import EMPTY, LoweringPhase
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.settings import ControlSettings


def moved(closed_loop, rig, law, target, duration):
    controller = Controller(rig, ControlSettings(), law=law)
    loop = closed_loop(controller)
    loop.run(2.0)
    points = [TrajectoryPoint(1.0, [target], [0.0], [0.0])]
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    loop.run(duration)
    return controller, loop


def test_stop_brakes_a_moving_joint_within_its_limits_and_holds_it(closed_loop, rig):
    slow = rig.with_joint(dataclasses.replace(rig.joints[0], max_acceleration=20.0))
    controller, loop = moved(closed_loop, slow, MODEL_BASED, 0.8, 0.5)
    assert controller.references.sample("elbow", loop.time).velocity > 0.5
    controller.stop(loop.time)
    record = loop.run(1.0)
    reference = record.column(1)
    speed = np.diff(reference) / 0.002
    assert np.abs(np.diff(speed)).max() / 0.002 < 1.02 * 20.0
    assert np.ptp(reference[-100:]) < 1e-6
    assert reference.max() < 0.8
    assert np.abs(record.error(loop.time - 0.2)).max() < 0.01


def sunk(controller, loop, duration):
    """The record until the controller stops sending."""
    rows = []
    while controller.lowering.phase is not LoweringPhase.OFF or not rows:
        try:
            rows += loop.run(0.02).rows
        except AssertionError:  # no more commands
            break
        assert rows[-1][0] - rows[0][0] < duration
    return np.array(rows)


@pytest.mark.parametrize("law", [MODEL_BASED, PressureRatioPid()])
def test_lowering_lets_a_loaded_joint_down_slowly_and_then_stops(closed_loop, rig, law):
    controller, loop = moved(closed_loop, rig, law, 0.8, 3.0)
    held = loop.run(0.1).column(2).mean()
    controller.lower(loop.time)
    rows = sunk(controller, loop, 8.0)
    time, position = rows[:, 0], rows[:, 2]
    assert controller.guard.stopped == "lowered as asked for"
    assert position.max() < held + 0.03  # it does not rise first
    speed = np.abs(np.diff(position[::25]) / np.diff(time[::25]))
    assert speed.max() < 1.0  # dropped, it reaches 3 rad/s
    assert max(rows[-1, 3], rows[-1, 4]) < EMPTY
    assert abs(position[-1]) < 0.3 * abs(held)


def test_lowering_brakes_a_moving_joint_first(closed_loop, rig):
    controller, loop = moved(closed_loop, rig, MODEL_BASED, 0.8, 0.5)
    controller.lower(loop.time)
    loop.run(0.02)
    assert controller.lowering.phase is LoweringPhase.BRAKING
    loop.run(0.4)
    assert controller.lowering.phase is LoweringPhase.SINKING
    assert "being lowered" in controller.reason_against_references()


def test_a_stop_ends_the_lowering_and_holds_the_joint_where_it_is(closed_loop, rig):
    controller, loop = moved(closed_loop, rig, MODEL_BASED, 0.8, 3.0)
    controller.lower(loop.time)
    before = loop.run(1.5).column(2)[-1]
    assert controller.lowering.phase is LoweringPhase.SINKING
    controller.stop(loop.time)
    after = loop.run(1.5).column(2)
    assert np.abs(after - before).max() < 0.05
    assert controller.reason_against_references() == ""


def test_a_lowered_controller_sends_nothing_until_the_driver_was_vented(closed_loop, rig):
    controller, loop = moved(closed_loop, rig, MODEL_BASED, 0.3, 1.5)
    controller.change(controller.prepared.asked.replace(lowering_time=0.3))
    controller.lower(loop.time)
    sunk(controller, loop, 4.0)
    with pytest.raises(AssertionError, match="lowered as asked for"):
        loop.run(0.1)
    controller.drop_commands()
    loop.run(0.1)
    assert controller.active
