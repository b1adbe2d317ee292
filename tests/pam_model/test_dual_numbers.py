"""Dual numbers: they give the slopes of every model, and losing the slopes is an error."""

import math

import numpy as np
import pytest

from pam_model.catalogue.default_model import default_model
from pam_model.dual_numbers import Dual, root_with_slopes, value_of
from pam_model.identify.fit_problem import FitProblem
from pam_model.identify.measurements import Measurements
from pam_model.muscles.force_model import registered_models

MODELS = registered_models()
PRESSURE = np.repeat([1.5e5, 3.1e5], 5)


def points_of(name: str, residual: str) -> tuple[FitProblem, np.ndarray]:
    model, geometry = default_model(name)
    low, high = model.length_bounds
    low, high = max(low, 0.75 * geometry.rest_length), min(high, geometry.rest_length)
    length = np.tile(np.linspace(low + 0.2 * (high - low), high - 0.1 * (high - low), 5), 2)
    velocity = np.full(10, 0.01)
    data = Measurements(
        name,
        PRESSURE,
        length,
        np.asarray(model.force(PRESSURE, length, velocity), dtype=float),
        velocity,
        np.full(10, "a"),
        np.arange(10),
        np.full(10, ""),
        False,
    )
    problem = FitProblem(
        name,
        data,
        geometry=geometry,
        constants={},
        fit_geometry=True,
        free=None,
        residual=residual,  # type: ignore[arg-type]
    )
    return problem, problem.inside(np.full(len(problem.free), 1.003))


@pytest.mark.parametrize("residual", ["force", "length"])
@pytest.mark.parametrize("name", MODELS)
def test_slopes_of_every_model_are_those_of_differences(name: str, residual: str) -> None:
    problem, at = points_of(name, residual)
    slopes = problem.jacobian(at)
    assert np.any(slopes != 0.0)
    for i, free in enumerate(problem.free):
        step = np.zeros(at.size)
        step[i] = 1e-4
        # fourth order, so that the error of the difference is below the ninth digit
        once = problem.residuals(at + step) - problem.residuals(at - step)
        twice = problem.residuals(at + 2.0 * step) - problem.residuals(at - 2.0 * step)
        expected = (8.0 * once - twice) / (12.0 * step[i])
        size = np.max(np.abs(slopes))
        # a length is solved to 1e-9 of its bound, so that its difference is accurate to 1e-5
        tolerance = 1e-7 if residual == "force" else 2e-5
        assert np.allclose(slopes[:, i], expected, rtol=0.0, atol=tolerance * size), free.name


@pytest.mark.parametrize("name", MODELS)
def test_numbers_that_act_as_one_have_slopes_equal_to_rounding(name: str) -> None:
    problem, at = points_of(name, "force")
    slopes = problem.jacobian(at)
    sizes = np.sqrt(np.sum(slopes * slopes, axis=0))
    told = sizes > 1e-9 * np.max(sizes)
    singular = np.linalg.svd(slopes[:, told] / sizes[told], compute_uv=False)
    # every singular value is either rounding error or clearly significant
    assert not np.any((singular > 1e-13) & (singular < 1e-9)), singular


def test_root_has_the_slopes_of_the_implicit_function() -> None:
    def equation(x: object, p: object) -> object:
        return x * x * x - p  # type: ignore[operator]

    inner = root_with_slopes(2.0, lambda x: equation(x, Dual.seed(8.0, 0, 1)))
    assert inner.slope[0] == pytest.approx(1.0 / 12.0, rel=1e-15)
    # the root of an equation that contains a root itself: y^2 = cube root of p
    outer = root_with_slopes(
        math.sqrt(2.0),
        lambda y: root_with_slopes(2.0, lambda x: equation(x, Dual.seed(8.0, 0, 1))) - y * y,
    )
    assert outer.slope[0] == pytest.approx(1.0 / 12.0 / (2.0 * math.sqrt(2.0)), rel=1e-14)


@pytest.mark.parametrize("lose", [float, math.sqrt, lambda x: np.asarray(x, dtype=float)])
def test_slopes_are_never_lost_in_silence(lose: object) -> None:
    with pytest.raises(TypeError):
        lose(Dual.seed(2.0, 0, 1))  # type: ignore[operator]


def test_dual_numbers_meet_arrays_on_either_side() -> None:
    p = Dual.seed(2.0, 0, 2)
    x = np.array([1.0, 3.0])
    for result in (x * p, p * x):
        assert np.array_equal(value_of(result), [2.0, 6.0])
        assert np.array_equal(result.slope[0], [1.0, 3.0])
    assert np.array_equal((np.exp(p) / x).slope[0], math.exp(2.0) / x)
    assert np.array_equal(x > p, [False, True])
    assert (p**3 - 1.0).slope[0] == 12.0
    assert f"{p:.1f}" == "2.0"
