"""Numbers of one plant, or of several at once: floats, or arrays with an entry for each plant.

What is computed from them is written once, with operators and with the functions below. A number
that is the same in all plants stays a float, so that what depends on such numbers alone is computed
once. Choices are those of Python's `max`, `min` and `if`, also for values that are not finite.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import reduce
from itertools import repeat
from typing import Any

import numpy as np
import numpy.typing as npt

Numbers = Any
"""A float, or a float64 array with an entry for each plant."""


def columns_of(rows: npt.NDArray[np.float64]) -> list[Numbers]:
    """The entries of one row (n,) as floats, or those of several rows (n_plant, n)."""
    if rows.ndim == 1 or len(rows) == 1:
        return rows.ravel().tolist()
    first, columns = rows[0].tolist(), np.ascontiguousarray(rows.T)
    is_same = (rows == rows[0]).all(axis=0).tolist()
    return [
        one if same else column for one, same, column in zip(first, is_same, columns, strict=True)
    ]


def rows_of(columns: list[Numbers], like: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """The inverse of `columns_of`: one row, or as many rows as `like` has."""
    if like.ndim == 1 or len(like) == 1:
        return np.array(columns, dtype=float).reshape(*like.shape[:-1], -1)
    result: npt.NDArray[np.float64] = np.empty((len(like), len(columns)))
    for place, column in enumerate(columns):
        result[:, place] = column
    return result


def larger(first: Numbers, second: Numbers) -> Numbers:
    """`max(first, second)`."""
    if type(first) is float and type(second) is float:
        return max(first, second)
    return np.where(second > first, second, first)


def smaller(first: Numbers, second: Numbers) -> Numbers:
    """`min(first, second)`."""
    if type(first) is float and type(second) is float:
        return min(first, second)
    return np.where(second < first, second, first)


def largest(numbers: list[Numbers]) -> Numbers:
    """The largest of several numbers; 0 of none."""
    return reduce(larger, numbers) if numbers else 0.0


def either(condition: Any, one: Numbers, other: Numbers) -> Numbers:
    """`one if condition else other`, of which both are computed."""
    if isinstance(condition, np.ndarray):
        return np.where(condition, one, other)
    return one if condition else other


def root(number: Numbers) -> Numbers:
    """The square root."""
    return np.sqrt(number) if isinstance(number, np.ndarray) else math.sqrt(number)


def law_of(law: Callable[..., float], *numbers: Numbers) -> Numbers:
    """What a law of floats gives for each plant."""
    if np.ndarray not in map(type, numbers):
        return law(*numbers)
    return np.array(list(map(law, *_lists(numbers))))


def law_where(is_on: Numbers, law: Callable[..., float], *numbers: Numbers) -> Numbers:
    """As `law_of`, but 0 for plants in which the law does not act; it is not called for them."""
    if not isinstance(is_on, np.ndarray):
        return law_of(law, *numbers) if is_on else 0.0
    rows = zip(is_on.tolist(), *_lists(numbers), strict=False)
    return np.array([law(*row) if acts else 0.0 for acts, *row in rows])


def _lists(numbers: tuple[Numbers, ...]) -> list[Iterable[float]]:
    return [n.tolist() if isinstance(n, np.ndarray) else repeat(n) for n in numbers]
