"""Within limits up to rounding; a number beyond them is shown so that this can be seen."""

import math

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from pam_model.within_limits import beyond, is_at_joint, within

LIMITS = st.floats(-1e4, 1e4)


@example(2.0**-1023, 2.0**-1022)
@given(LIMITS, LIMITS)
def test_rounding_to_single_precision_stays_within(low: float, high: float) -> None:
    assume(low < high)
    for end in (low, high):
        assert within(float(np.float32(end)), low, high)
        assert within(math.nextafter(end, math.inf), low, high)
        assert within(math.nextafter(end, -math.inf), low, high)


@given(LIMITS, LIMITS, st.floats(allow_nan=False))
def test_what_is_shown_is_visibly_beyond(low: float, high: float, value: float) -> None:
    assume(low < high)
    assume(not low <= value <= high)
    told, lower, upper = map(float, beyond(value, low, high))
    assert (told < lower) == (value < low)
    assert (told > upper) == (value > high)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1.00001, -1.00001])
def test_what_is_beyond(value: float) -> None:
    assert not within(value, -1.0, 1.0)


def test_limits_that_are_infinite_or_zero() -> None:
    assert within(1e300, -math.inf, math.inf)
    assert not within(math.nan, -math.inf, math.inf)
    assert within(0.0, 0.0, 0.0)
    assert not within(1e-300, 0.0, 0.0)


@pytest.mark.parametrize(
    ("position", "measured", "there"),
    [
        (-1.003, -1.003, True),
        (-1.003, -0.98, True),
        (-1.003, None, True),
        (-1.003, math.nan, True),
        (-1.003, 0.5, False),
        (-1.06, -1.06, False),
        (1.05, 1.05, True),
        (math.nan, -1.0, False),
    ],
)
def test_a_joint_at_its_stop(position: float, measured: float | None, there: bool) -> None:
    assert is_at_joint(position, measured, -1.0, 1.0, 0.05) == there
