"""Domains of the models: closed bounds tolerate rounding, values outside are refused."""

import math

import numpy as np
import pytest

from pam_model.catalogue.default_model import default_model
from pam_model.domain import require
from pam_model.errors import DomainError
from pam_model.identify.fit import fit
from pam_model.identify.measurements import Measurements
from pam_model.muscles.force_model import (
    MuscleGeometry,
    create_force_model,
    registered_models,
)
from pam_model.muscles.models.variable_thread_angle import LEAST_ANGLE

CLOSED = [name for name in registered_models() if name not in ("schulte", "martens_boblan")]
"""Models with a closed upper bound; the other models have a wall and no finite force there."""


@pytest.mark.parametrize("name", CLOSED)
def test_a_rounding_error_above_the_longest_length_is_the_longest_length(name: str) -> None:
    model, _ = default_model(name)
    longest = float(model.length_bounds[1])
    above = math.nextafter(longest, math.inf)
    for length in (above, longest * (1.0 + 1e-13)):
        for pressure in (0.0, 3e5):
            try:
                expected = model.force(pressure, longest, 0.01)
            except ZeroDivisionError:
                continue  # friction by contact area is infinite at diameter 0
            slightly = pytest.approx(expected, rel=1e-6, abs=1e-6)
            assert model.force(pressure, length, 0.01) == slightly
            many = model.force(pressure, np.array([length, 0.9 * longest]), 0.01)
            assert many[0] == slightly
        assert math.isfinite(model.volume(length))
    with pytest.raises(DomainError):
        model.force(3e5, longest * (1.0 + 1e-9), 0.01)


def test_the_rest_length_of_a_rounded_path_is_inside_the_model_that_ends_there() -> None:
    geometry = MuscleGeometry(0.3, 1.5, 0.281)
    model = create_force_model("hunt_sigmoid", geometry)
    path = math.nextafter(geometry.rest_length, 1.0)  # the rounding of a sum along the path
    assert path > geometry.rest_length
    assert model.force(2e5, path) == model.force(2e5, geometry.rest_length)


def test_require_bears_rounding_at_closed_ends_only() -> None:
    require("x", [0.1 + 0.2, 3.0], 0.0, 3.0)
    require("x", 0.1 + 0.2, 0.0, 0.3)
    require("x", 0.7 - 0.1, 0.6)
    for low, high, options in (
        (0.0, 0.3, {"open_high": True}),
        (0.1 + 0.2, 1.0, {"open_low": True}),
    ):
        with pytest.raises(DomainError):
            require("x", 0.1 + 0.2, low, high, **options)
    with pytest.raises(DomainError):
        require("x", -1e-13, 0.0)


def test_threads_along_the_axis_are_outside_the_variable_angle() -> None:
    geometry = MuscleGeometry(0.25, 2.0, 0.235)
    for angle in (1e-9, 0.01, 0.99 * LEAST_ANGLE):
        with pytest.raises(DomainError, match="rest_angle"):
            create_force_model("variable_thread_angle", geometry, {"rest_angle": angle})
    least = create_force_model("variable_thread_angle", geometry, {"rest_angle": LEAST_ANGLE})
    assert 0.0 < least.force(3e5, 0.235) < 1e6


def test_a_fit_of_the_variable_angle_starts_from_the_geometry() -> None:
    # The default 0 stands for the geometry's angle. A step away from this bound once gave threads
    # parallel to the axis, and the ranking showed 1e17 N.
    geometry = MuscleGeometry(0.25, 2.0, 0.235)
    pressure = np.repeat([1e5, 2e5, 3e5, 4e5], 10)
    length = np.tile(np.linspace(0.19, 0.23, 10), 4)
    truth = create_force_model("variable_thread_angle", geometry, {"rest_angle": 0.45})
    force = np.asarray(truth.force(pressure, length))
    force = force + np.random.default_rng(1).normal(0.0, 1.0, force.size)
    block = np.tile(["a", "b"], 20)
    no = np.full(40, "")
    data = Measurements(
        "made", pressure, length, force, np.zeros(40), block, np.arange(40), no, False
    )
    result = fit("variable_thread_angle", data, geometry)
    assert result.held_out_error < 2.0
    assert result.parameters["rest_angle"].value == pytest.approx(0.45, abs=0.01)
