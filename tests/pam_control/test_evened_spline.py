"""A cubic spline whose acceleration changes gradually."""

from __future__ import annotations

import numpy as np
import pytest

from pam_control.references.evened_spline import EvenedSpline, largest_jump
from pam_control.references.spline import (
    JointReference,
    JointSpline,
    Waypoints,
    spline_coefficients,
)

WINDOW = 0.02
TIMES = np.array([0.0, 0.3, 0.5, 0.9])
CUBIC = Waypoints(
    TIMES,
    np.array([0.1, 0.4, 0.2, 0.3]),
    np.array([0.5, 0.2, -1.0, 0.0]),
    np.full(4, np.nan),
)
BEFORE = JointReference(0.1, 0.5, 2.0)


def test_it_is_the_mean_of_the_spline_around_each_time():
    plain, evened = JointSpline(CUBIC), EvenedSpline(CUBIC, WINDOW, BEFORE)
    for time in (0.05, 0.295, 0.3, 0.31, 0.5, 0.7, 0.889, 0.905):
        around = np.linspace(time - 0.5 * WINDOW, time + 0.5 * WINDOW, 4001)
        wanted = np.mean([plain.sample(t).position for t in around])
        assert evened.sample(time).position == pytest.approx(wanted, abs=1e-6)


def test_it_goes_on_from_the_motion_before_and_ends_at_rest():
    evened = EvenedSpline(CUBIC, WINDOW, BEFORE)
    start = evened.sample(-0.5 * WINDOW)
    assert start.velocity == pytest.approx(BEFORE.velocity - 2.0 * 0.5 * WINDOW, abs=1e-9)
    assert start.acceleration == pytest.approx(BEFORE.acceleration, abs=1e-9)
    assert evened.sample(evened.end_time) == JointReference(0.3)
    assert evened.sample(evened.end_time - 1e-9).velocity == pytest.approx(0.0, abs=1e-6)


def test_its_acceleration_changes_at_most_with_the_jump_over_the_window():
    jump = largest_jump(CUBIC, spline_coefficients(CUBIC), BEFORE.acceleration)
    assert jump > 10.0
    evened = EvenedSpline(CUBIC, WINDOW, BEFORE)
    times = np.arange(-0.01, 0.92, 1e-4)
    states = [evened.sample(t) for t in times]
    changes = np.abs(np.diff([state.acceleration for state in states])) / 1e-4
    within = np.abs(spline_coefficients(CUBIC)[:, 3]).max() * 6.0  # of the segments themselves
    assert changes.max() <= 1.05 * jump / WINDOW + within
    # velocity and acceleration are the derivatives of what it gives
    assert np.gradient([state.position for state in states], times)[5:-5] == pytest.approx(
        [state.velocity for state in states][5:-5], abs=2e-3
    )


def test_a_spline_at_rest_at_both_ends_without_jumps_needs_none():
    smooth = Waypoints(
        np.array([0.0, 1.0]), np.array([0.0, 0.5]), np.zeros(2), np.zeros(2)
    )  # quintic
    assert largest_jump(smooth, spline_coefficients(smooth), 0.0) == pytest.approx(0.0, abs=1e-9)
