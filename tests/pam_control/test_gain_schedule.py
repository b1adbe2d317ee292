"""Gains follow the stiffness, and are safe at and between the stiffnesses that were designed."""

import math

import numpy as np
import pytest

from pam_control.controller import Controller
from pam_control.feedback.closed_loop import is_stable
from pam_control.feedback.gain_design import INFEASIBLE, DesignTask, PidCost
from pam_control.feedback.gain_schedule import GainSchedule
from pam_control.feedback.margins import margins
from pam_control.feedback.pid import PidGains, pid_output
from pam_control.references.trajectory import TrajectoryPoint
from pam_control.settings import ControlSettings
from support.feedback_rows import feedback

SOFT, STIFF = PidGains(2.0, 20.0, 0.1, 0.01, lead=0.02), PidGains(6.0, 60.0, 0.5, 0.01, lead=0.02)
SCHEDULE = GainSchedule((5.0, 15.0), (SOFT, STIFF))


@pytest.fixture(scope="module")
def controller(rig):
    return Controller(rig, ControlSettings())


def test_gains_are_linear_between_two_stiffnesses_and_constant_outside():
    assert SCHEDULE.at(7.5) == PidGains(3.0, 30.0, 0.2, 0.01, lead=0.02)
    assert SCHEDULE.at(1.0) == SCHEDULE.at(math.nan) == SOFT
    assert SCHEDULE.at(99.0) == STIFF
    assert GainSchedule.constant(SOFT).at(99.0) == SOFT


def dense_cases(controller):
    """Operating points at 13 stiffnesses, most of which nobody designed."""
    channel, settings = controller.channels[0], controller.settings
    grid = channel.models.scale.complete(settings).stiffness_grid
    dense = tuple(np.linspace(grid[0], grid[-1], 13).tolist())
    cases = controller.design.cases(channel.models, settings.replace(stiffness_grid=dense))
    return cases, controller.design.timing(channel.models, settings)


def test_the_margins_hold_between_the_designed_stiffnesses(controller):
    cases, timing = dense_cases(controller)
    schedule, settings = controller.settings.gains["elbow"], controller.settings
    assert len(schedule.gains) > 1
    for case in cases:
        gains = schedule.at(case.scheduled)
        found = margins(case, timing, gains, is_stable(case, timing, gains))
        assert found.stable
        assert found.phase_margin > settings.phase_margin - math.radians(1.0)
        assert found.modulus_margin > 1.0 / settings.sensitivity - 0.01


def test_disturbances_are_rejected_better_than_with_one_set_for_the_whole_range(controller):
    cases, timing = dense_cases(controller)
    one = controller.designs.pid("elbow", plain_task(controller))
    schedule, better = controller.settings.gains["elbow"], []
    for case in cases:
        here, filter = schedule.at(case.scheduled), one.derivative_filter
        errors = []
        for gains in (here, one):
            task = DesignTask((case,), timing, 0.1, 9.0, filter, lead=gains.lead)
            errors.append(PidCost(task).of(gains))
        assert max(errors) < INFEASIBLE
        better.append(errors[0] / errors[1])
    assert max(better) < 0.8


def plain_task(controller):
    """One set of gains without a lead for the whole range, as the other laws have it."""
    channel, settings = controller.channels[0], controller.settings
    return DesignTask(
        tuple(controller.design.cases(channel.models, settings)),
        controller.design.timing(channel.models, settings),
        settings.phase_margin,
        settings.sensitivity,
        settings.derivative_filter,
    )


def test_where_gains_between_two_stiffnesses_are_not_safe_one_set_serves_all(controller):
    """Those for an unknown delay of 80 ms differ too much."""
    asked = controller.settings.replace(
        extra_delay=0.08,
        pressure_gain=None,
        gains={},
        feedback_lead=0.0,
        motion_observer=0.0,
    )
    assert len(controller.design.designed(asked).gains["elbow"].gains) == 1


def test_the_soft_gains_are_one_set_without_a_lead(controller):
    assert controller.prepared.soft is not None
    (gains,) = controller.prepared.soft.settings.gains["elbow"].gains
    assert gains.lead == 0.0


def test_a_stiffness_that_changes_as_fast_as_it_may_does_not_make_the_joint_swing(closed_loop, rig):
    """With 10 ms that nobody knows of, and a load that the feedback has to carry."""
    moving = Controller(rig, ControlSettings(adaptation=False))
    effects = {"payload.mass": 0.5, "payload.distance": 0.2}
    loop = closed_loop(moving, effects=effects, command_delay=0.013)
    loop.run(0.5)
    points = [TrajectoryPoint(1.0, [0.5], [0.0], [0.0])]
    moving.references.follow(["elbow"], points, start=None, now=loop.time)
    loop.run(2.5)
    swings = []
    for turn in range(5):
        moving.stiffness_commands[0] = (7.0, 18.0)[turn % 2]
        swings.append(float(np.ptp(loop.run(0.8).column(2))))
    assert max(swings) < 0.01
    assert moving.guard.softened == ""


def test_the_lead_is_the_derivative_of_the_derivative():
    pid, step = feedback(PidGains(0.0, 0.0, 1.0, 1e-4, lead=0.02)), 1e-3
    for k in range(400):
        time = k * step
        output = pid_output(*pid, math.sin(5.0 * time), 0.0 if k == 0 else step)
    expected = 5.0 * math.cos(5.0 * time) - 0.02 * 25.0 * math.sin(5.0 * time)
    assert output == pytest.approx(expected, abs=0.05)
