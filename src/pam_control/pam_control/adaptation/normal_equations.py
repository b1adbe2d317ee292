"""Sums of a weighted least-squares fit and their solution, as functions of rows of numbers.

numba compiles these functions with whatever calls them; without numba, the rows are lists. A matrix
is a list of rows. The factorisation is that of Cholesky: normal equations with a penalty on every
weight are positive definite.

Source: G. H. Golub, C. F. Van Loan, Matrix Computations, Johns Hopkins 2013, algorithms 4.2.1
(Cholesky), 3.1.1 and 3.1.2 (substitution).
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

ROUNDING: Final = 1e-14
"""Of a diagonal element; what is left of it is at least that, so that rounding ends no fit."""
CORRELATED: Final = 0.05  # s, for which the error of a fit stays about the same
SOLVED_EVERY: Final = 0.045  # s of motion or work; the weights change within seconds

SEEN, ENERGY, UNSOLVED, COMMON, OWN, SHARE, N_SUMS = range(7)
"""State of a fit: sums of weights and of squared values, time since the last solution [s]; three
numbers of `running_comparison`."""


def add_sample(
    state: Any, products: Any, wanted: Any, functions: Any, value: float, duration: float,
    kept: float, soon: float = math.inf,
) -> bool:  # fmt: skip
    """Let older samples fade, and add one; return whether the fit is to be solved again.

    Parameters
    ----------
    state : row
        `SEEN` and its like; changed.
    products : matrix
        (n, n) sums of the products of the functions; changed.
    wanted : row
        (n,) sums of the functions times the value; changed.
    functions : row
        (n,) values of the functions.
    value : float
        That they should explain.
    duration : float
        Time since the sample before [s].
    kept : float
        Share of the older sums that stays [-].
    soon : float, optional
        Share of the time that was seen [-], after which a fit of few samples is solved again.
    """
    share = duration / CORRELATED
    for i in range(len(wanted)):
        scaled = share * functions[i]
        wanted[i] = kept * wanted[i] + scaled * value
        for j in range(len(wanted)):
            products[i][j] = kept * products[i][j] + scaled * functions[j]
    state[ENERGY] = kept * state[ENERGY] + share * value * value
    state[SEEN] = kept * state[SEEN] + share
    state[UNSOLVED] += duration
    if state[UNSOLVED] < min(SOLVED_EVERY, soon * CORRELATED * state[SEEN]):
        return False
    state[UNSOLVED] = 0.0
    return True


def square_sum(products: Any, weights: Any) -> float:
    """Sum of the squares that these weights explain."""
    total = 0.0
    for i in range(len(weights)):
        row = 0.0
        for j in range(len(weights)):
            row += products[i][j] * weights[j]
        total += weights[i] * row
    return total


def squares_left(state: Any, products: Any, wanted: Any, weights: Any) -> float:
    """Sum of the squared errors that weights leave."""
    explained = square_sum(products, weights)
    return float(state[ENERGY] - 2.0 * dot(weights, wanted) + explained)


def worth(explained: float, least: float) -> float:
    """The factor on weights [-] that explain so much, where less than `least` is a trifle."""
    return 0.0 if explained <= least else 1.0 - least / explained


def dot(one: Any, other: Any) -> float:
    """Scalar product of two rows."""
    total = 0.0
    for i in range(len(one)):
        total += one[i] * other[i]
    return total


def factorise(matrix: Any, size: int) -> None:
    """Replace the lower triangle of a positive definite matrix of this size by its factor."""
    for j in range(size):
        rest = least = matrix[j][j]
        for k in range(j):
            rest -= matrix[j][k] * matrix[j][k]
        pivot = math.sqrt(max(rest, ROUNDING * least))
        matrix[j][j] = pivot
        for i in range(j + 1, size):
            rest = matrix[i][j]
            for k in range(j):
                rest -= matrix[i][k] * matrix[j][k]
            matrix[i][j] = rest / pivot


def substitute(factor: Any, size: int, side: Any) -> None:
    """Replace the right side of an equation by its solution."""
    for i in range(size):
        rest = side[i]
        for k in range(i):
            rest -= factor[i][k] * side[k]
        side[i] = rest / factor[i][i]
    for i in range(size - 1, -1, -1):
        rest = side[i]
        for k in range(i + 1, size):
            rest -= factor[k][i] * side[k]
        side[i] = rest / factor[i][i]


def log_determinant(factor: Any, size: int) -> float:
    """Logarithm of the determinant of the matrix whose factor this is."""
    total = 0.0
    for i in range(size):
        total += math.log(factor[i][i])
    return 2.0 * total
