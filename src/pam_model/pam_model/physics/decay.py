"""exp(-x) as a polynomial, which a compiler can evaluate for several lanes at once.

Compiled loops call the exponential function of the C library once per lane. This one consists of
additions, products and choices only. It differs from `math.exp` by at most 4e-16 of its value.

Source: argument reduction by multiples of ln 2 in two parts, W. J. Cody and W. Waite, Software
Manual for the Elementary Functions, 1980; Taylor series (Abramowitz and Stegun, 4.2.1).
"""

from __future__ import annotations

from typing import Final

from pam_model.physics.sine import ROUNDING

PER_LN2: Final = 1.4426950408889634
LN2_HIGH: Final = 0.6931471803691238
LN2_LOW: Final = 1.9082149292705877e-10
LARGEST: Final = 88.0
"""Beyond it the result stays at 6e-39."""


def decay(x: float) -> float:
    """exp(-x) of a number from 0 to LARGEST."""
    x = min(x, LARGEST)
    halvings = (x * PER_LN2 + ROUNDING) - ROUNDING
    r = halvings * LN2_LOW - (x - halvings * LN2_HIGH)
    series = 1.0 / 87178291200.0
    series = series * r + 1.0 / 6227020800.0
    series = series * r + 1.0 / 479001600.0
    series = series * r + 1.0 / 39916800.0
    series = series * r + 1.0 / 3628800.0
    series = series * r + 1.0 / 362880.0
    series = series * r + 1.0 / 40320.0
    series = series * r + 1.0 / 5040.0
    series = series * r + 1.0 / 720.0
    series = series * r + 1.0 / 120.0
    series = series * r + 1.0 / 24.0
    series = series * r + 1.0 / 6.0
    series = series * r + 0.5
    value = 1.0 + (r + r * r * series)
    value *= 5.421010862427522e-20 if halvings >= 64.0 else 1.0  # 2^-64
    halvings -= 64.0 if halvings >= 64.0 else 0.0
    value *= 2.3283064365386963e-10 if halvings >= 32.0 else 1.0  # 2^-32
    halvings -= 32.0 if halvings >= 32.0 else 0.0
    value *= 1.52587890625e-05 if halvings >= 16.0 else 1.0  # 2^-16
    halvings -= 16.0 if halvings >= 16.0 else 0.0
    value *= 0.00390625 if halvings >= 8.0 else 1.0
    halvings -= 8.0 if halvings >= 8.0 else 0.0
    value *= 0.0625 if halvings >= 4.0 else 1.0
    halvings -= 4.0 if halvings >= 4.0 else 0.0
    value *= 0.25 if halvings >= 2.0 else 1.0
    halvings -= 2.0 if halvings >= 2.0 else 0.0
    return value * (0.5 if halvings >= 1.0 else 1.0)
