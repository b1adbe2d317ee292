"""The small errors of a good robot that a calibration fits beside its numbers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from pam_gap.calibration.small_errors import CREEP_TIMES

SLOWEST, FASTEST = 0.1, 2.0  # Hz, of the motions that docs/record_for_diagnosis.md asks for


@pytest.mark.parametrize("order", [0.15, 0.25, 0.4])
def test_loss_of_relaxing_rubber_is_that_of_its_elements_at_all_speeds_of_a_recording(
    order: float,
) -> None:
    """A springpot of Maxwell elements; what they do not lose would be taken for friction."""
    turn = 2j * np.pi * np.geomspace(SLOWEST, FASTEST, 30)
    rubber = turn**order
    elements = [np.ones_like(turn), *(turn * t / (1.0 + turn * t) for t in CREEP_TIMES)]
    columns = np.stack([one / abs(rubber) for one in elements], axis=1)
    goal = rubber / abs(rubber)
    amounts, _ = nnls(
        np.concatenate([columns.real, columns.imag]), np.concatenate([goal.real, goal.imag])
    )
    loss = (columns @ amounts).imag / goal.imag
    assert np.abs(loss - 1.0).max() < 0.25
