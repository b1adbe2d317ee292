"""Fits with known linear terms: their amounts are found within their bounds."""

import numpy as np
import pytest

from pam_gap.prediction.fit import FreeParameter, PlantFit, fit_together, mean_squares
from pam_gap.prediction.linear_terms import LinearTerms, fit_steps_with_terms

ROWS = np.ones(400, dtype=bool)
TIME = np.linspace(0.0, 4.0, 400)
WAVE = 30.0 * np.sin(np.linspace(0.0, 40.0, 400))


@pytest.mark.parametrize(("true", "found"), [(0.4, 0.4), (2.5, 1.0), (-0.5, 0.0)])
def test_amounts_are_fitted_within_their_bounds_beside_the_parameters(
    true: float, found: float
) -> None:
    noise = 0.01 * np.random.default_rng(3).normal(size=TIME.size)
    lanes_simulated: list[int] = []

    def predict(lanes: np.ndarray) -> np.ndarray:
        lanes_simulated.append(len(lanes))
        curve = lanes[:, :1] * np.exp(-TIME / lanes[:, 1:])
        target = 2.0 * np.exp(-TIME / 0.7) + noise
        return ((curve - target) / 0.01 - true * WAVE)[:, :, None]

    free = [
        FreeParameter("size", 0.0, 10.0, 1.0),
        FreeParameter("time", 1e-2, 100.0, 0.7, is_logarithmic=True),
    ]
    terms = LinearTerms(WAVE[:, None, None], (FreeParameter("amount", 0.0, 1.0, 0.5),))
    steps = fit_steps_with_terms(
        free, np.array([1.5, 1.0]), terms, rows=ROWS, floor=np.ones(1), max_iterations=40,
        tolerance=1e-8,
    )  # fmt: skip
    result = fit_together([(lambda lanes: lanes, steps)], predict)[0]
    assert result.amounts == pytest.approx([found], abs=0.02)
    assert result.jacobian.shape[-1] == result.values.size == 2
    assert max(lanes_simulated) <= 3  # no lane is simulated for the amount
    if true == found:
        assert result.values == pytest.approx([2.0, 0.7], rel=0.02)
        assert mean_squares(result.errors)[0] == pytest.approx(1.0, rel=0.2)
    # what the bounds leave belongs to the errors, which contain the terms
    left = predict(result.values[None])[0] + terms.columns @ result.amounts
    np.testing.assert_allclose(result.errors, left)


def test_amounts_that_are_given_are_kept_and_the_parameters_are_fitted_beside_them() -> None:
    """A fold keeps the drift of all data; one fitted to a half would be carried on."""
    drift = (TIME / TIME[-1] - 0.5)[:, None, None] * 100.0
    terms = LinearTerms(drift, (FreeParameter("drift", -1.0, 1.0, 0.5),))

    def predict(lanes: np.ndarray) -> np.ndarray:
        curve = lanes[:, :1] * np.exp(-TIME / 0.7)
        return ((curve - 2.0 * np.exp(-TIME / 0.7)) / 0.01)[:, :, None] - 0.4 * drift[None, :, :, 0]

    free = [FreeParameter("size", 0.0, 10.0, 1.0)]
    first_half = ROWS & (TIME < 2.0)
    steps = fit_steps_with_terms(
        free, np.array([1.5]), terms, rows=first_half, floor=np.ones(1), amounts=np.array([0.4])
    )
    result = fit_together([(lambda lanes: lanes, steps)], predict)[0]
    assert result.amounts == pytest.approx([0.4])
    assert result.values == pytest.approx([2.0], abs=1e-3)
    assert mean_squares(result.errors)[0] < 1e-3


@pytest.mark.parametrize("kept", [None, np.array([0.4])])
def test_no_point_is_simulated_twice_and_a_fit_goes_on_where_another_one_ended(
    kept: np.ndarray | None,
) -> None:
    wave = WAVE[:, None, None]
    terms = LinearTerms(wave, (FreeParameter("amount", 0.0, 1.0, 0.5),))
    free = [
        FreeParameter("size", 0.0, 10.0, 1.0),
        FreeParameter("time", 1e-2, 100.0, 0.7, is_logarithmic=True),
    ]
    simulated: list[tuple[float, ...]] = []

    def predict(lanes: np.ndarray) -> np.ndarray:
        simulated.extend(tuple(round(float(value), 12) for value in lane) for lane in lanes)
        curve = lanes[:, :1] * np.exp(-TIME / lanes[:, 1:])
        return ((curve - 2.0 * np.exp(-TIME / 0.7)) / 0.01 - 0.4 * WAVE)[:, :, None]

    def fit(start: np.ndarray, errors: np.ndarray | None = None) -> PlantFit:
        steps = fit_steps_with_terms(
            free, start, terms, rows=ROWS, floor=np.ones(1), max_iterations=3, errors=errors,
            amounts=kept,
        )  # fmt: skip
        return fit_together([(lambda lanes: lanes, steps)], predict)[0]

    first = fit(np.array([1.5, 1.0]))
    assert first.simulated is not None
    np.testing.assert_allclose(first.simulated, predict(first.values[None])[0], atol=1e-9)
    simulated.clear()
    known = fit(first.values, first.simulated)
    assert tuple(round(float(value), 12) for value in first.values) not in simulated
    count = len(simulated)
    simulated.clear()
    again = fit(first.values)
    assert len(simulated) == len(set(simulated)) == count + 1
    assert known.objective == pytest.approx(again.objective, abs=1e-6)
    assert known.values == pytest.approx(again.values, rel=1e-6)


def test_terms_without_some_share_the_columns_and_fix_the_amounts_of_these_at_0() -> None:
    columns = np.stack([WAVE, 20.0 * np.cos(3.0 * TIME)], axis=-1)[:, None]
    amount = FreeParameter("amount", 0.2, 1.0, 0.5)
    terms = LinearTerms(columns, (amount, amount)).without([True, False])
    assert terms.columns is columns

    def predict(lanes: np.ndarray) -> np.ndarray:
        return 10.0 * (lanes - 2.0)[:, :, None] - columns @ np.array([0.5, 0.7])

    free = [FreeParameter("size", 0.0, 10.0, 1.0)]
    steps = fit_steps_with_terms(free, np.array([1.5]), terms, rows=ROWS, floor=np.ones(1))
    result = fit_together([(lambda lanes: lanes, steps)], predict)[0]
    assert result.amounts[0] == 0.0
    assert result.amounts[1] == pytest.approx(0.7, abs=0.1)
    np.testing.assert_array_equal(terms.slopes()[..., 0], 0.0)
    np.testing.assert_allclose(terms.slopes()[..., 1], 0.5 * columns[..., 1])
