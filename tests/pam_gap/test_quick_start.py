"""A diagnosis starts without what only few of them need, and what replaces it is the same."""

import subprocess
import sys

import numpy as np
from scipy import special
from scipy.signal import detrend

from pam_gap.inference.log_sum_exp import logsumexp
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


def test_a_sum_of_exponentials_at_all_sizes() -> None:
    random = np.random.default_rng(1)
    a = 900.0 * random.standard_normal((4, 3, 5))
    weights = random.uniform(size=(4, 1, 5))
    for axis in (None, 0, (0, 2)):
        np.testing.assert_allclose(
            logsumexp(a, axis=axis, b=weights), special.logsumexp(a, axis=axis, b=weights)
        )
