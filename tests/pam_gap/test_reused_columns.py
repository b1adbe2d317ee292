"""Fits that reuse columns of the Jacobian find the same minimum with fewer simulations."""

import numpy as np
import pytest

from pam_gap.prediction.fit import FreeParameter, fit_steps, fit_together, normal_equations
from pam_gap.prediction.running_equations import KnownColumns, RunningEquations

BLOCKS, NOMINAL = 300, 12
ROWS = np.arange(BLOCKS) >= 20


def curved(lanes: np.ndarray) -> np.ndarray:
    """Errors of a plant with many numbers known within a tolerance, and one unknown effect."""
    random = np.random.default_rng(3)
    columns = random.standard_normal((BLOCKS, 2, NOMINAL))
    truth = random.uniform(-1, 1, NOMINAL)
    own, effect = lanes[:, :NOMINAL], lanes[:, NOMINAL]
    near = (own - truth) + 0.1 * (own - truth) ** 2
    time = np.linspace(0, 4, BLOCKS)
    moved = np.exp(-time[None] / effect[:, None]) - np.exp(-time / 0.7)
    noise = 0.05 * random.standard_normal((BLOCKS, 2))
    return np.einsum("bcn,ln->lbc", columns, near) + 40.0 * moved[:, :, None] + noise


FREE = [
    *(FreeParameter(f"number {i}", -1.05, 1.05, 0.3, prior=0.6) for i in range(NOMINAL)),
    FreeParameter("time", 1e-2, 100.0, 0.7, is_logarithmic=True),
]
START = np.append(np.zeros(NOMINAL), 3.0)


def run(**options):
    """Result of the fit and the number of simulations."""
    lanes = []

    def predict(asked: np.ndarray) -> np.ndarray:
        lanes.append(len(asked))
        return curved(asked)

    steps = fit_steps(
        FREE, START, rows=ROWS, floor=np.full(2, 1e-4), max_iterations=30, tolerance=1e-7, **options
    )
    return fit_together([(lambda x: x, steps)], predict)[0], sum(lanes)


def test_numbers_known_within_a_tolerance_are_not_varied_again_in_every_step() -> None:
    result, simulations = run()
    every_step = (len(FREE) + 3) * result.iterations
    assert simulations < 0.75 * every_step
    around = (curved(result.values[None] + step * np.eye(len(FREE))) for step in (1e-4, -1e-4))
    gradient = np.subtract(*around) / 2e-4
    weights = 1.0 / np.mean(result.errors[ROWS] ** 2, axis=0)
    slope = np.einsum("lbc,bc,c->l", gradient[:, ROWS], result.errors[ROWS], weights)
    slope[:NOMINAL] += result.values[:NOMINAL] / 0.6**2
    curvature = np.einsum("lbc,c->l", gradient[:, ROWS] ** 2, weights)
    assert np.abs(slope / curvature).max() < 1e-3  # the step that is left, in own units


@pytest.mark.parametrize("wrong", [0.0, -1.0, 3.0])
def test_a_wrong_guess_of_the_columns_does_not_change_the_result(wrong: float) -> None:
    alone, _ = run()
    guess = wrong * alone.jacobian
    guessed, _ = run(guess=guess)
    assert guessed.objective == pytest.approx(alone.objective, abs=0.02)
    assert guessed.values == pytest.approx(alone.values, abs=2e-3)


def test_a_good_guess_saves_simulations() -> None:
    alone, simulations = run()
    _, fewer = run(guess=alone.jacobian)
    assert fewer < simulations


def test_running_equations_are_those_of_all_columns_at_once() -> None:
    random = np.random.default_rng(0)
    errors = random.standard_normal((BLOCKS, 3))
    errors[40:60, 1] = np.nan
    errors[:, 2] = np.nan
    jacobian = np.where(np.isnan(errors)[..., None], np.nan, random.random((BLOCKS, 3, 5)))
    weights = np.array([0.5, 2.0, 1.0])
    running = RunningEquations(5, errors, ROWS, KnownColumns(jacobian[..., :2]))
    running.put(np.arange(2, 5), random.random((BLOCKS, 3, 3)))
    running.put(np.array([2, 4]), jacobian[..., [2, 4]])
    running.put(np.array([3]), jacobian[..., [3]])
    hessian, slope = normal_equations(errors, jacobian, ROWS, weights)
    own_hessian, own_slope = running.equations(errors, weights)
    np.testing.assert_allclose(own_hessian, hessian, rtol=1e-12)
    np.testing.assert_allclose(own_slope, slope, rtol=1e-12)


def test_results_share_the_columns_that_they_reuse() -> None:
    """A search keeps hundreds of results that reuse the columns of one."""
    alone, _ = run()
    reused = alone.jacobian[..., :NOMINAL]
    one, other = run(cached=reused)[0], run(cached=reused)[0]
    assert one.reused is reused
    assert other.reused is reused
    assert one.columns.shape[-1] == len(FREE) - NOMINAL
    np.testing.assert_array_equal(one.jacobian[..., :NOMINAL], reused)


def test_a_result_does_not_keep_the_other_lanes_that_were_simulated_with_it() -> None:
    """Many results are kept, and a batch is a hundred times as large as one of them."""
    result, _ = run()
    assert result.errors.base is None
