"""The small errors of a good robot that a calibration fits beside its numbers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from pam_gap.calibration.small_errors import CREEP_TIMES, LONG_STROKE

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


@pytest.mark.parametrize(("longer", "within"), [((LONG_STROKE,), 0.1), ((), 0.25)])
def test_loss_of_threads_that_slide_one_after_another_is_that_of_two_strokes(
    longer: tuple[float, ...], within: float
) -> None:
    """One stroke alone is off by more than 15 %, over half the middle stroke to 20 of them."""
    amplitudes = np.geomspace(0.5, 20.0, 40)
    begins = (2.0 * np.arange(8) + 1.0) / 8.0  # stroke at which each eighth of the threads slides
    # over 4 times the friction: a thread that is elastic until it slides, and Dahl's law
    goal = np.maximum(amplitudes[:, None] - begins, 0.0).mean(axis=1)
    worst = []
    for stroke in np.geomspace(0.05, 4.0, 100):
        strokes = stroke * np.array([1.0, *longer])
        losses = amplitudes[:, None] - strokes * np.tanh(amplitudes[:, None] / strokes)
        columns = losses / goal[:, None]
        amounts, *_ = np.linalg.lstsq(columns, np.ones_like(amplitudes), rcond=None)
        worst.append(np.abs(columns @ amounts - 1.0).max())
    assert min(worst) < within
    assert longer or min(worst) > 0.15
