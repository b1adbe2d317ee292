"""Local polynomials are those of scipy, and exact for polynomials of their order."""

import numpy as np
import pytest
from scipy.signal import savgol_filter

from pam_gap.prediction.local_polynomial import local_polynomial


@pytest.mark.parametrize(
    ("width", "order", "derivative"), [(3, 1, 0), (7, 1, 0), (21, 2, 0), (15, 2, 1), (9, 3, 2)]
)
@pytest.mark.parametrize("count", [21, 22, 400])
def test_it_is_the_filter_of_scipy(width, order, derivative, count):
    values = np.random.default_rng(1).normal(3e5, 2e3, (count, 2))
    found = local_polynomial(values, width, order, derivative=derivative, step=0.002)
    expected = savgol_filter(values, width, order, deriv=derivative, delta=0.002, axis=0)
    assert np.abs(found - expected).max() <= 1e-12 * np.abs(values).max() / 0.002**derivative


def test_the_speed_of_a_parabola_is_exact_up_to_both_ends():
    time = np.arange(50) * 0.002
    position = (0.3 + 2.0 * time - 7.0 * time**2)[:, None]
    speed = local_polynomial(position, 13, 2, derivative=1, step=0.002)
    assert np.abs(speed[:, 0] - (2.0 - 14.0 * time)).max() < 1e-9


def test_fewer_samples_than_a_window_are_refused():
    with pytest.raises(ValueError, match="5 samples"):
        local_polynomial(np.zeros((5, 1)), 7, 2)
