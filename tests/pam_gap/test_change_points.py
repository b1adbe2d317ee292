"""Steps and slopes are found where they are, and nowhere else."""

import numpy as np
import pytest

from pam_gap.fleet.change_points import SLOPE, STEP, SeriesModel, deviations, find_changes
from pam_gap.rules import DEFAULT

WEEK = 7 * 86400.0
SCATTER = 0.05


def course(law, *, n=12, weeks=8.0, seed=0, stated=1.0, outliers=()) -> SeriesModel:
    """The changes found in a law of the weeks with scatter; `stated`: share that intervals tell."""
    random = np.random.default_rng(seed)
    time = np.linspace(0.0, weeks, n)
    value = np.array([law(t) for t in time]) + random.normal(0.0, SCATTER, n)
    for place in outliers:
        value[place] += 10.0 * SCATTER
    return find_changes(time * WEEK, value, np.full(n, stated * SCATTER))


@pytest.mark.sampled("one of the three cases", cases=1)
@pytest.mark.parametrize(("stated", "outliers"), [(1.0, ()), (0.3, ()), (0.3, (4,))])
def test_a_constant_has_no_change_in_95_percent_of_draws(stated, outliers):
    draws = [
        course(lambda t: 1.0, n=9, seed=k, stated=stated, outliers=outliers) for k in range(20)
    ]
    assert sum(bool(found.changes) for found in draws) <= 1


def test_a_repair_is_one_step_at_its_date_with_its_size():
    found = course(lambda t: 1.0 if t < 5.0 else 0.6, stated=0.5)
    (step,) = found.changes
    assert step.kind == STEP
    assert step.earliest <= 5.0 * WEEK <= step.latest
    assert step.latest - step.earliest <= 1.5 * WEEK
    assert step.low < -0.4 < step.high
    assert found.last == pytest.approx(0.6, abs=0.06)


def test_wear_is_a_slope_from_its_beginning_on():
    found = course(lambda t: 1.0 + 0.2 * max(0.0, t - 3.0), n=16)
    (slope,) = found.changes
    assert slope.kind == SLOPE and not slope.from_start
    assert slope.time == pytest.approx(3.0 * WEEK, abs=1.0 * WEEK)
    assert slope.low * WEEK < 0.2 < slope.high * WEEK
    assert found.rate == slope.size


def test_wear_and_its_repair_are_told_apart():
    found = course(lambda t: 1.0 + 0.15 * t - (0.9 if t >= 6.0 else 0.0), n=16)
    assert [c.kind for c in found.changes] == [SLOPE, STEP]
    assert found.changes[0].from_start
    assert found.changes[1].earliest <= 6.0 * WEEK <= found.changes[1].latest
    assert found.changes[1].size == pytest.approx(-0.9, abs=0.15)


# Conductance of a simulated leak [1e-11 m^3/(s Pa)] that was closed, and half its intervals. Motion
# and motion differ by 10 % where it leaks and by nothing where it does not.
LEAK = [7.70, 8.54, 7.81, 7.95, 7.96, 8.52, 8.27, 7.12, 9.01, 9.12, 7.57, 9.17, 8.61, 8.38, 8.81,
        0.002, 0.0, 0.001, 0.015, 0.0, 0.003, 0.001, 0.017, 0.0]  # fmt: skip
HALF = [0.48, 0.21, 0.22, 0.28, 0.26, 0.50, 0.15, 0.50, 0.09, 0.14, 0.12, 0.29, 0.07, 0.25, 0.20,
        0.012, 0.016, 0.012, 0.020, 0.010, 0.010, 0.015, 0.020, 0.013]  # fmt: skip


def test_precise_zeros_after_a_repair_do_not_make_scatter_before_it_a_change():
    time = np.linspace(0.0, 8.0, len(LEAK)) * WEEK
    found = find_changes(time, np.array(LEAK), np.array(HALF) / 1.645)
    assert [(c.kind, c.earliest) for c in found.changes] == [(STEP, time[14])]


def test_an_outlier_at_the_end_is_no_step():
    assert course(lambda t: 1.0, outliers=(11,)).changes == ()
    assert course(lambda t: 1.0, outliers=(0,)).changes == ()


def test_the_unit_of_the_values_changes_nothing():
    plain = course(lambda t: 1.0 if t < 5.0 else 0.6)
    random = np.random.default_rng(0)
    time = np.linspace(0.0, 8.0, 12)
    value = np.where(time < 5.0, 1.0, 0.6) + random.normal(0.0, SCATTER, 12)
    tiny = find_changes(time * WEEK, 1e-11 * value, np.full(12, 1e-11 * SCATTER))
    assert [c.time for c in tiny.changes] == [c.time for c in plain.changes]
    assert tiny.changes[0].size == pytest.approx(1e-11 * plain.changes[0].size, rel=1e-6)


@pytest.mark.parametrize(
    "value", [np.zeros(8), np.linspace(0.0, 5.0, DEFAULT.fleet.fewest - 1), np.zeros(0)]
)
def test_too_few_or_equal_values_have_no_change(value):
    found = find_changes(np.arange(value.size) * WEEK, value, np.zeros(value.size))
    assert found.changes == ()
    assert found.enough == (value.size >= DEFAULT.fleet.fewest)


def test_deviations_are_those_of_90_percent_intervals():
    assert deviations(np.array([1.0]), np.array([4.29])) == pytest.approx([1.0])
