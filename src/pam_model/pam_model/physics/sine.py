"""The sine as a polynomial, which a compiler can evaluate for several lanes at once.

Compiled loops call the sine of the C library once per lane. This polynomial consists of additions
and products only. It differs from `math.sin` by at most 2e-16 for angles up to 100 rad.

Source: Taylor series on [-pi/2, pi/2] (Abramowitz and Stegun, 4.3.65); reduction by multiples of pi
in two parts after W. J. Cody and W. Waite, Software Manual for the Elementary Functions, 1980.
"""

from __future__ import annotations

from typing import Final

PER_PI: Final = 0.3183098861837907
PI_HIGH: Final = 3.141592653589793
PI_LOW: Final = 1.2246467991473532e-16
ROUNDING: Final = 6755399441055744.0
"""1.5 * 2^52: adding and subtracting it rounds a float to the nearest integer, ties to even."""


def sine(angle: float) -> float:
    """sin(angle) of an angle in rad."""
    turns = (angle * PER_PI + ROUNDING) - ROUNDING
    pairs = (0.5 * turns + ROUNDING) - ROUNDING
    sign = 1.0 - 2.0 * abs(turns - 2.0 * pairs)
    x = (angle - turns * PI_HIGH) - turns * PI_LOW
    z = x * x
    series = 1.0 / 51090942171709440000.0
    series = series * z - 1.0 / 121645100408832000.0
    series = series * z + 1.0 / 355687428096000.0
    series = series * z - 1.0 / 1307674368000.0
    series = series * z + 1.0 / 6227020800.0
    series = series * z - 1.0 / 39916800.0
    series = series * z + 1.0 / 362880.0
    series = series * z - 1.0 / 5040.0
    series = series * z + 1.0 / 120.0
    series = series * z - 1.0 / 6.0
    return sign * (x + x * z * series)
