"""The pull of a softening bladder never changes its sign and never decreases with stretch."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pam_model.effects.bladder_elasticity import bladder_pull


@given(stretch=st.floats(-0.1, 0.1), linear=st.floats(0.0, 1e4), cubic=st.floats(-1e7, 1e7))
def test_restoring_odd_and_never_falling(stretch: float, linear: float, cubic: float) -> None:
    pull, slope = bladder_pull(stretch, linear, cubic)
    assert pull * stretch >= 0.0
    assert slope >= 0.0
    assert bladder_pull(-stretch, linear, cubic) == (-pull, slope)


@pytest.mark.parametrize("cubic", [-4e5, 0.0, 4e5])
def test_slope_is_the_derivative_of_the_pull(cubic: float) -> None:
    for stretch in np.linspace(-0.06, 0.06, 25):
        step = 1e-6
        rise = bladder_pull(stretch + step, 600.0, cubic)[0]
        rise -= bladder_pull(stretch - step, 600.0, cubic)[0]
        slope = bladder_pull(stretch, 600.0, cubic)[1]
        assert rise / (2 * step) == pytest.approx(slope, rel=1e-6, abs=1e-2)
