"""Checks that a quantity lies in a model's domain, with an error that names it and the bound."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pam_model.errors import DomainError

ROUNDING = 1e-12
"""By how much, relative to a closed bound, a value may pass it and still count as the bound:
thousands of times the rounding of one operation, and far below what any sensor resolves."""


def require(
    quantity: str,
    value: Any,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    open_low: bool = False,
    open_high: bool = False,
    why: str = "",
) -> None:
    """Refuse a value, or any element of an array, outside [low, high] or not finite.

    A value that passes a closed bound by no more than `ROUNDING` of it is let through.

    Parameters
    ----------
    quantity : str
        Name and unit, such as "thread_length [m]".
    value : float or array
        What was given.
    low, high : float
        The bounds.
    open_low, open_high : bool
        Whether the bound itself is outside.
    why : str
        What the bound means, for the message.

    Raises
    ------
    DomainError
        Naming the quantity, the first bad value and the bound.
    """
    values = np.asarray(value, dtype=float)
    good = np.isfinite(values)
    good &= (values > low) if open_low else (values >= low - ROUNDING * _size(low))
    good &= (values < high) if open_high else (values <= high + ROUNDING * _size(high))
    if bool(np.all(good)):
        return
    bad = float(values[~good].ravel()[0]) if values.ndim else float(values)
    interval = f"{'(' if open_low else '['}{low:g}, {high:g}{')' if open_high else ']'}"
    raise DomainError(f"{quantity} = {bad:g} is outside {interval}" + (f": {why}" if why else ""))


def _size(bound: float) -> float:
    return abs(bound) if math.isfinite(bound) else 0.0


def plain(value: Any) -> Any:
    """A float for anything without dimensions, so that floats in give floats out."""
    return float(value) if np.ndim(value) == 0 else value
