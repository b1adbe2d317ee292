"""Sums of a least-squares fit whose older samples fade, as functions of rows of numbers.

numba compiles these functions with whatever calls them; without numba, the rows are lists.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pam_control.adaptation.forgetting_fit import MEMORY
from pam_control.adaptation.normal_equations import ENERGY, Array, squares_left
from pam_model.plant.compiled import entry_point, for_kernel, listed, prepare

SECONDS, SQUARES, N_TOTALS = range(3)
"""Totals: motion in the sums [s], and the sum of the squares of the target, times seconds."""
assert SQUARES == ENERGY  # where `squares_left` looks for it


def add_fading(
    products: Any, targets: Any, totals: Any, parts: Any, target: float, elapsed: float
) -> None:
    """Take a target and its parts after a time [s]; a row of parts may go on behind those used."""
    fade_sums(products, targets, totals, math.exp(-elapsed / MEMORY))
    for i in range(len(targets)):
        scaled = elapsed * parts[i]
        targets[i] += scaled * target
        for j in range(len(targets)):
            products[i][j] += scaled * parts[j]
    totals[SQUARES] += elapsed * target * target
    totals[SECONDS] += elapsed


def fade_sums(products: Any, targets: Any, totals: Any, share: float) -> None:
    """Let what was seen count less."""
    for i in range(len(targets)):
        targets[i] *= share
        for j in range(len(targets)):
            products[i][j] *= share
    totals[SQUARES] *= share
    totals[SECONDS] *= share


@entry_point
def fade_all(products: Any, targets: Any, totals: Any, share: float) -> None:
    """`fade_sums` for Python."""
    fade_sums(products, targets, totals, share)


def rms_left(products: Any, targets: Any, totals: Any, found: Any) -> float:
    """Root mean square of what these weights leave of the target, in its unit."""
    if totals[SECONDS] <= 0.0:
        return 0.0
    left = squares_left(totals, products, targets, found)
    return math.sqrt(max(left, 0.0) / totals[SECONDS])


class FadingSums:
    """Sums of a least-squares fit that forgets.

    Parameters
    ----------
    size : int
        Number of parts.

    Attributes
    ----------
    rows : tuple
        Products (size, size), targets (size,) and totals, which the functions above change.
    """

    def __init__(self, size: int) -> None:
        self.rows: tuple[Any, Any, Any] = (
            for_kernel(np.zeros((size, size))),
            for_kernel(np.zeros(size)),
            for_kernel(np.zeros(N_TOTALS)),
        )
        prepare(fade_all, *self.rows, 0.0)

    @property
    def products(self) -> Array:
        """Shape (size, size)."""
        return np.array(self.rows[0])

    @property
    def targets(self) -> Array:
        """Shape (size,)."""
        return np.array(self.rows[1])

    @property
    def seconds(self) -> float:
        """Motion in them [s]."""
        return float(self.rows[2][SECONDS])

    def fade(self, share: float) -> None:
        """Let what was seen count less."""
        fade_all(*self.rows, share)

    def left(self, found: Array) -> float:
        """Root mean square of what these weights leave of the target, in its unit."""
        products, targets, totals = map(listed, self.rows)
        return rms_left(products, targets, totals, found.tolist())
