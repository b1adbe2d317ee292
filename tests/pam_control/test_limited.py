"""The limit of a number is that of max and min, for crossed limits and for NaN as well."""

import itertools
import math

import pytest

from pam_control.limited import limited

NUMBERS = (-math.inf, -2.0, -1.0, 0.0, 0.5, 1.0, 3.0, math.inf)


@pytest.mark.parametrize("value", [*NUMBERS, math.nan])
def test_it_equals_max_of_low_and_min_of_high_and_the_number(value):
    for low, high in itertools.product(NUMBERS, repeat=2):
        assert limited(value, low, high) == max(low, min(high, value))
