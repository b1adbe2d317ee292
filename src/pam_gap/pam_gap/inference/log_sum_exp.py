"""Logarithm of a sum of exponentials; the import of scipy.special takes a third of a second."""

from __future__ import annotations

from typing import Any

import numpy as np


def logsumexp(a: Any, axis: int | tuple[int, ...] | None = None, b: Any = 1.0) -> Any:
    """log(sum(b exp(a))), without overflow.

    Parameters
    ----------
    a : array_like
        Logarithms of the summands.
    axis : int or tuple of int, optional
        Over which is summed; all by default.
    b : array_like
        Weights of the summands, not negative.
    """
    largest = np.max(a, axis=axis, keepdims=True)
    total = np.sum(b * np.exp(a - largest), axis=axis)
    return np.log(total) + np.squeeze(largest, axis=axis)
