"""Whether a number is within its limits, up to rounding; and how it is shown if it is not.

Numbers come with single precision or from a few operations, and a joint that hangs at its stop is
measured a little beyond its position limits. Whoever compares a command with a limit asks here.
"""

from __future__ import annotations

import math
from typing import Final

ROUNDING: Final = 1e-6
"""Relative; sixteen times the rounding of single precision."""
_SMALLEST: Final = 2.0**-126  # normal number of single precision; those below have fewer digits
_FEWEST, _MOST = 6, 17
"""Significant digits; 17 show every number of double precision as it is."""


def within(value: float, low: float, high: float) -> bool:
    """Whether a number is within [low, high], up to rounding; NaN never is."""
    size = max(abs(low), abs(high))
    rounding = ROUNDING * max(size, _SMALLEST) if size and math.isfinite(low - high) else 0.0
    return low - rounding <= value <= high + rounding


def is_at_joint(
    position: float, measured: float | None, low: float, high: float, margin: float
) -> bool:
    """Whether a position beyond the limits is just where the joint is.

    Parameters
    ----------
    position : float
        Commanded [rad].
    measured : float or None
        Where the joint is [rad]; None or NaN if unknown.
    low, high : float
        Position limits [rad].
    margin : float
        How far the driver permits the joint beyond them [rad].
    """
    if not within(position, low - margin, high + margin):
        return False
    if measured is None or math.isnan(measured):
        return True
    return within(position - measured, -margin, margin)


def beyond(value: float, low: float, high: float) -> tuple[str, str, str]:
    """A number outside of its limits and both limits, with digits enough to see it.

    Parameters
    ----------
    value, low, high : float
        With the same unit.

    Returns
    -------
    value, low, high : str
        As texts.
    """
    shown = ("", "", "")
    for digits in range(_FEWEST, _MOST + 1):
        shown = (f"{value:.{digits}g}", f"{low:.{digits}g}", f"{high:.{digits}g}")
        number, lower, upper = map(float, shown)
        if not lower <= number <= upper:
            break
    return shown
