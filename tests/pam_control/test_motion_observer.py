"""The motion observer: what it sees without a lag, and that its response is that of its design."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from pam_control.controller import Controller
from pam_control.cycle.joint_cycle import K_FEEDBACK
from pam_control.feedback.closed_loop import is_stable
from pam_control.feedback.gain_design import (
    OMEGA,
    UNKNOWN_MARGINS,
    stated_loop,
    unknown_loops,
)
from pam_control.feedback.linear_joint import LoopTiming, frequency_response
from pam_control.feedback.loop_shape import encloses_nothing
from pam_control.feedback.margins import derivative_response, loop_margins, pid_response
from pam_control.feedback.motion_observer import correction_gains, observe_motion, seen_motion
from pam_control.feedback.pid import F_BEND, F_MOTION, F_SLOPE
from pam_control.settings import ControlSettings

STEP = 2e-3
BANDWIDTH = 160.0
TIMING = LoopTiming(STEP, 0.012, 0.005, 0.7, 0.01)
COUNTS = 4096  # of an encoder's turn


def observed(positions, explained, bandwidth=BANDWIDTH):
    """Speed and unexplained acceleration after each position."""
    row, found = [math.nan, 0.0, 0.0], []
    for k, position in enumerate(positions):
        observe_motion(row, 0, position, 0.0, explained[k], STEP, bandwidth)
        found.append((row[1], row[2]))
    return np.array(found)


@pytest.mark.parametrize("bandwidth", [20.0, 160.0, 1000.0])
@pytest.mark.parametrize("step", [1e-3, 2e-3, 2e-2])
def test_all_poles_of_the_error_are_those_of_the_bandwidth(bandwidth, step):
    gains = np.array(correction_gains(bandwidth, step))
    ahead = np.array([[1.0, step, 0.5 * step * step], [0.0, 1.0, step], [0.0, 0.0, 1.0]])
    error = (np.eye(3) - np.outer(gains, [1.0, 0.0, 0.0])) @ ahead
    assert np.linalg.eigvals(error) == pytest.approx(math.exp(-bandwidth * step), abs=1e-4)


def test_a_motion_that_the_model_explains_is_seen_without_a_lag():
    times = STEP * np.arange(1500)
    acceleration = 40.0 * np.sin(12.0 * times)
    # exact for an acceleration that is constant between two measurements
    speed = np.concatenate([[0.0], np.cumsum(acceleration[:-1]) * STEP])
    position = np.concatenate(
        [[0.0], np.cumsum(speed[:-1] * STEP + 0.5 * acceleration[:-1] * STEP**2)]
    )
    before = np.concatenate([[0.0], acceleration[:-1]])
    found = observed(position, before)
    assert np.max(np.abs(found[:, 0] - speed)) < 1e-9 * np.max(np.abs(speed))
    assert np.max(np.abs(found[:, 1])) < 1e-6


def test_a_torque_that_the_model_lacks_leaves_no_error_of_the_speed():
    times = STEP * np.arange(500)
    found = observed(0.5 * 3.0 * times**2, np.zeros(500))
    assert found[-1] == pytest.approx([3.0 * times[-1], 3.0], rel=1e-6)


def test_a_joint_that_is_taken_over_rests_whatever_the_model_says():
    """A load that nobody knows of would push the joint until the observer had found it."""
    found = observed(np.full(200, 0.3), np.concatenate([[math.nan] * 3, np.full(197, -25.0)]))
    assert np.max(np.abs(found[:, 0])) == 0.0
    assert found[-1][1] == 25.0


def test_the_response_is_that_of_the_function_in_the_cycle():
    omega, inertia_ratio = 30.0, 0.7
    times = STEP * np.arange(4000)
    position = np.exp(1j * omega * times)
    explained = inertia_ratio * -(omega**2) * np.exp(1j * omega * (times - STEP))
    real, imag = (observed(part(position), part(explained)) for part in (np.real, np.imag))
    last = (real[-1] + 1j * imag[-1]) / position[-1]
    seen = seen_motion(
        BANDWIDTH, TIMING, np.array([omega]), 1.0, np.array([-inertia_ratio * omega**2 + 0j])
    )
    acceleration = last[1] + explained[-1] / position[-1]
    assert last[0] == pytest.approx(seen.speed[0], rel=1e-3)
    assert acceleration == pytest.approx(seen.acceleration[0], rel=1e-3)


def test_steps_of_an_encoder_move_the_output_less_than_through_a_filter():
    """Beside it, the derivative of the observer is less late."""
    times = STEP * np.arange(2000)
    true = 0.3 * np.sin(2.0 * times)
    shown = np.round(true * COUNTS / (2.0 * math.pi)) * 2.0 * math.pi / COUNTS
    speed = 0.6 * np.cos(2.0 * times)
    found = observed(shown, np.concatenate([[0.0], -1.2 * np.sin(2.0 * times)[:-1]]))[:, 0]
    slope, filtered = 0.0, []
    for change in np.diff(shown, prepend=shown[0]) / STEP:
        slope += STEP / (0.01 + STEP) * (change - slope)
        filtered.append(slope)
    settled, acceleration = slice(200, None), -1.2 * np.sin(2.0 * times)[200:]
    jumps = [np.std(np.diff(each[settled])) for each in (found, np.array(filtered))]
    assert jumps[0] < 1.1 * jumps[1]
    late = [
        -np.mean((each - speed)[settled] * acceleration) / np.mean(acceleration**2)
        for each in (found, np.array(filtered))
    ]
    assert abs(late[0]) < 1e-3
    assert late[1] > 8e-3


def designed(rig, **settings):
    controller = Controller(rig, ControlSettings(**settings))
    channel = controller.channels[0]
    return controller, channel.models, controller.settings


def test_designed_gains_keep_margins_with_an_unknown_at_any_place(rig):
    controller, models, settings = designed(rig)
    design, schedule = controller.design, settings.gains[models.name]
    for stiffness, gains in zip(schedule.stiffnesses, schedule.gains, strict=True):
        assert gains.motion == settings.motion_observer > 0.0
        near = settings.replace(stiffness_grid=(stiffness,))
        task = design._task(models, near)
        task = dataclasses.replace(task, motion=gains.motion)
        for case in task.cases:
            loops = [*stated_loop(task, case, OMEGA), *unknown_loops(task, case, OMEGA)]
            limits = ((task.phase_margin, task.sensitivity), *UNKNOWN_MARGINS)
            for (plant, position, led), (margin, sensitivity) in zip(loops, limits, strict=True):
                fed = (gains.proportional + gains.integral / (1j * OMEGA)) * position
                opened = plant * (fed + gains.derivative * led)
                found = loop_margins(lambda omega, of=opened: np.interp(omega, OMEGA, of))
                assert found.phase_margin > margin - 0.01
                assert found.modulus_margin > 1.0 / (sensitivity + 0.02)


def test_poles_and_the_exact_response_agree_about_the_largest_derivative(rig):
    """Poles decide whether a loop is safe; they are of a continuous observer, this one samples."""
    controller, models, settings = designed(rig)
    timing = controller.design.timing(models, settings)
    case = controller.design.cases(models, settings)[4]
    gains = settings.gains[models.name].at(case.scheduled)
    plant = frequency_response(case.point, case.loop, timing, OMEGA)

    def largest(stable):
        low, high = 1.0, 20.0
        while high - low > 1e-3:
            middle = 0.5 * (low + high)
            more = dataclasses.replace(gains, derivative=middle * gains.derivative)
            low, high = (middle, high) if stable(more) else (low, middle)
        return low

    def encircles_nothing(each):
        returned = (1.0 + plant * pid_response(each, timing, OMEGA))[None]
        return encloses_nothing(
            np.ascontiguousarray(returned.real), np.ascontiguousarray(returned.imag)
        )

    by_poles = largest(lambda each: is_stable(case, timing, each))
    assert 1.5 < by_poles < 20.0
    assert by_poles == pytest.approx(largest(encircles_nothing), rel=0.03)


def test_without_a_bandwidth_the_derivative_is_filtered(rig):
    _, models, settings = designed(rig, motion_observer=0.0)
    gains = settings.gains[models.name].gains[0]
    assert gains.motion == 0.0
    s = 1j * OMEGA
    slope = s / (settings.derivative_filter * s + 1.0)
    assert derivative_response(gains, TIMING, OMEGA) == pytest.approx(
        slope * (1.0 + gains.lead * slope)
    )


def test_soft_gains_do_not_rely_on_the_model(rig):
    controller, models, _ = designed(rig)
    soft = controller.prepared.soft
    assert soft is not None
    assert soft.settings.gains[models.name].gains[0].motion == 0.0


@pytest.mark.parametrize("adapts", [True, False])
def test_the_observed_speed_is_that_of_the_joint(closed_loop, rig, reaching, adapts):
    points, duration = reaching
    controller = Controller(rig, ControlSettings(adaptation=adapts))
    loop = closed_loop(controller)
    loop.run(2.0)
    controller.references.follow(["elbow"], points, start=None, now=loop.time)
    errors, bends = [], []
    row = controller.channels[0]._k

    def look(_):
        errors.append(row[K_FEEDBACK + F_SLOPE])
        bends.append(row[K_FEEDBACK + F_BEND])
        assert math.isfinite(row[K_FEEDBACK + F_MOTION])

    loop.run(duration, look)
    assert np.std(errors) < 0.05
    assert np.std(bends) < 4.0
