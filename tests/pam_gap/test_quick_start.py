"""A diagnosis starts without what only few of them need, and what replaces it is the same."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.signal import detrend
from scipy.special import expit

from pam_gap.inference.logistic import logistic
from pam_gap.prediction.directions import without_trend

SLOW = ("signal", "stats", "optimize", "linalg", "special", "io", "sparse", "interpolate")


def test_a_diagnosis_is_imported_without_the_slow_packages_of_scipy() -> None:
    """They took more than half of the time until a diagnosis began."""
    line = "import sys, pam_gap.__main__, pam_gap.diagnosis_files; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", line], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {f"scipy.{name}" for name in SLOW} & set(loaded)


def test_a_trend_is_the_straight_line_that_fits_best() -> None:
    signal = np.random.default_rng(0).standard_normal(101) + np.linspace(3.0, 40.0, 101)
    np.testing.assert_allclose(without_trend(signal), detrend(signal), atol=1e-12)


@pytest.mark.parametrize("x", [-np.inf, -800.0, -40.0, -1.0, 0.0, 1e-9, 3.0, 800.0, np.inf])
def test_the_logistic_function_at_all_sizes(x: float) -> None:
    assert logistic(x) == pytest.approx(float(expit(x)), rel=1e-14)
