"""Stability and phase margin of sampled loop gains, many at a time, without trigonometry per point.

The gain designs evaluate them some thousand times. Rows are loops, columns are frequencies.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Real = npt.NDArray[np.float64]


def _changes(flags: npt.NDArray[np.bool_]) -> npt.NDArray[np.intp]:
    """Flat indices after which a flag changes its value within a row."""
    changed = flags.ravel()[:-1] != flags.ravel()[1:]
    changed[flags.shape[1] - 1 :: flags.shape[1]] = False  # from one row to the next
    return np.flatnonzero(changed)


def encloses_nothing(re: Real, im: Real) -> bool:
    """Whether no row of 1 + L, from low to high frequency, encircles 0.

    By the Nyquist criterion the phase of 1 + L begins at -90 degrees (the integrator) and must end
    near 0. A step between two frequencies crosses the negative real axis if the imaginary part
    changes its sign and the chord passes to the left of 0. A downward crossing counts as one
    encirclement, an upward crossing takes one back.
    """
    place = _changes(im >= 0.0)
    x, y = re.ravel(), im.ravel()
    turn = np.where(y[place] >= 0.0, 1.0, -1.0)
    left = (x[place] * y[place + 1] - x[place + 1] * y[place]) * turn > 0.0
    turns = np.bincount(place // re.shape[1], turn * left, len(re))
    return bool(np.all(turns == 0.0) and np.all(re[:, -1] >= 0.0))


def least_phase_margin(re: Real, im: Real, squared_size: Real) -> float:
    """Least phase margin [rad] over the rows of a loop gain, at the crossings of gain one."""
    place = _changes(squared_size > 1.0)
    if not place.size:
        return math.pi
    x, y, squared = re.ravel(), im.ravel(), squared_size.ravel()
    low, high = np.sqrt(squared[place]), np.sqrt(squared[place + 1])
    weight = (1.0 - low) / (high - low + 1e-300)
    at_x = x[place] + weight * (x[place + 1] - x[place])
    at_y = y[place] + weight * (y[place + 1] - y[place])
    return float(np.min(np.abs(np.arctan2(-at_y, -at_x))))
