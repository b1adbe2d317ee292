"""The fit on problems whose answer is known."""

import numpy as np
import pytest

from pam_gap.prediction.fit import (
    FreeParameter,
    fit,
    fit_steps,
    fit_together,
    mean_squares,
)
from pam_gap.prediction.fit_step import bounded_step

ROWS = np.ones(400, dtype=bool)


def exponential(noise: float):
    time = np.linspace(0, 4, 400)
    random = np.random.default_rng(0)
    data = 2.0 * np.exp(-time / 0.7) + noise * random.standard_normal(400)

    def predict(lanes: np.ndarray) -> np.ndarray:
        model = lanes[:, :1] * np.exp(-time / lanes[:, 1:2])
        return ((data - model) / noise)[:, :, None]

    return predict


def test_finds_an_exponential_from_afar() -> None:
    free = [
        FreeParameter("size", 0.0, 10.0, 1.0),
        FreeParameter("time", 1e-2, 100.0, 0.7, is_logarithmic=True),
    ]
    result = fit(
        exponential(0.01), free, np.array([0.3, 5.0]), rows=ROWS, floor=np.ones(1),
        max_iterations=40, tolerance=1e-6,
    )  # fmt: skip
    assert result.values == pytest.approx([2.0, 0.7], rel=0.01)
    assert mean_squares(result.errors)[0] == pytest.approx(1.0, rel=0.2)


def test_a_bound_is_kept_and_the_rest_is_the_best_there() -> None:
    free = [
        FreeParameter("size", 0.0, 1.5, 1.0),
        FreeParameter("time", 1e-2, 100.0, 0.7, is_logarithmic=True),
    ]
    result = fit(
        exponential(0.01), free, np.array([0.3, 5.0]), rows=ROWS, floor=np.ones(1),
        max_iterations=40, tolerance=1e-8,
    )  # fmt: skip
    assert result.values[0] == pytest.approx(1.5)
    predict = exponential(0.01)
    around = np.array([[1.5, result.values[1] * f] for f in (0.99, 1.0, 1.01)])
    left = mean_squares(predict(around))[:, 0]
    assert left[1] <= left.min() * 1.001


def test_a_tight_prior_holds_what_the_data_hardly_see() -> None:
    free = [FreeParameter("seen", -10, 10, 1.0), FreeParameter("unseen", -10, 10, 1.0, 0.1, 0.5)]

    def predict(lanes: np.ndarray) -> np.ndarray:
        errors = np.random.default_rng(1).standard_normal(400)
        return (errors + lanes[:, :1] - 1.0 + 1e-6 * lanes[:, 1:2])[:, :, None]

    result = fit(predict, free, np.array([0.0, 2.0]), rows=ROWS, floor=np.ones(1))
    assert result.values[0] == pytest.approx(1.0, abs=0.15)
    assert result.values[1] == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("seed", range(5))
def test_bounded_step_is_the_minimum_in_the_box(seed: int) -> None:
    random = np.random.default_rng(seed)
    root = random.standard_normal((6, 6))
    hessian, slope = root @ root.T + 0.1 * np.eye(6), 3.0 * random.standard_normal(6)
    low, high = -random.uniform(0, 1, 6), random.uniform(0, 1, 6)
    low[0] = high[0] = 0.0  # fixed
    step = bounded_step(hessian, slope, low, high)
    assert (step >= low - 1e-12).all() and (step <= high + 1e-12).all()

    def value(x: np.ndarray) -> float:
        return float(0.5 * x @ hessian @ x + slope @ x)

    trials = random.uniform(low, high, (4000, 6))
    assert value(step) <= min(value(x) for x in trials) + 1e-9


@pytest.mark.parametrize("seed", [0, 1, 25, 31])
def test_bounded_step_is_the_minimum_where_columns_are_nearly_dependent(seed: int) -> None:
    """There, active sets return to themselves, and bounds have to be changed one by one."""
    random = np.random.default_rng(seed)
    columns = random.standard_normal((200, 10)) @ random.standard_normal((10, 20))
    columns += 1e-3 * random.standard_normal(columns.shape)
    hessian, slope = columns.T @ columns, columns.T @ random.standard_normal(200)
    low, high = -random.uniform(0.0, 0.05, 20), random.uniform(0.0, 0.05, 20)
    step = bounded_step(hessian, slope, low, high)
    force = -(hessian @ step + slope) / np.abs(slope).max()
    is_low, is_high = step <= low + 1e-12, step >= high - 1e-12
    assert (is_low | is_high).sum() > 5
    assert np.abs(force[~is_low & ~is_high]).max() < 1e-6
    assert force[is_low].max(initial=0.0) < 1e-6
    assert force[is_high].min(initial=0.0) > -1e-6


def test_fits_side_by_side_give_what_each_gives_alone_in_fewer_batches() -> None:
    free = [
        FreeParameter("size", 0.0, 10.0, 1.0),
        FreeParameter("time", 1e-2, 100.0, 0.7, is_logarithmic=True),
    ]
    starts = [np.array([0.3, 5.0]), np.array([4.0, 0.1]), np.array([2.0, 0.7])]
    batches: list[int] = []

    def counted(lanes: np.ndarray) -> np.ndarray:
        batches.append(len(lanes))
        return exponential(0.01)(lanes)

    alone = [fit(counted, free, start, rows=ROWS, floor=np.ones(1)) for start in starts]
    lanes_alone, batches_alone = sum(batches), len(batches)
    batches.clear()
    fits = [
        (lambda lanes: lanes, fit_steps(free, start, rows=ROWS, floor=np.ones(1)))
        for start in starts
    ]
    together = fit_together(fits, counted)
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one.values, other.values)
        assert one.iterations == other.iterations
    assert sum(batches) == lanes_alone
    assert len(batches) < 0.6 * batches_alone
