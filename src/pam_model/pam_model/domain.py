"""Check that a quantity is in a model's domain; the error names quantity and bound."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pam_model.errors import DomainError

ROUNDING = 1e-12
"""Relative amount by which a value may exceed a closed bound and still be accepted: thousands of
times the rounding error of one operation, and far below the resolution of any sensor."""


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

    A value that exceeds a closed bound by at most `ROUNDING` of the bound is accepted.

    Parameters
    ----------
    quantity : str
        Name and unit, such as "thread_length [m]".
    value : float or array
        The value to check.
    low, high : float
        The bounds.
    open_low, open_high : bool
        Whether the bound itself is outside the domain.
    why : str
        Meaning of the bound, for the message.

    Raises
    ------
    DomainError
        With the quantity, the first bad value and the bound.
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
    """Convert a zero-dimensional result to float, so that float arguments give float results."""
    return float(value) if np.ndim(value) == 0 else value
