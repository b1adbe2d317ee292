"""Elementary functions for the muscle models: fast for floats, exact for dual numbers.

Floats use `math` and stay floats, which takes a tenth of numpy's time in a control loop; arrays
and dual numbers (`pam_model.dual_numbers`) use numpy.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np


def square_root(value: Any) -> Any:
    """The square root."""
    return math.sqrt(value) if isinstance(value, float) else np.sqrt(value)


def exponential(value: Any) -> Any:
    """The exponential function."""
    return math.exp(value) if isinstance(value, float) else np.exp(value)


def sine(angle: Any) -> Any:
    """The sine of an angle [rad]."""
    return math.sin(angle) if isinstance(angle, float) else np.sin(angle)


def cosine(angle: Any) -> Any:
    """The cosine of an angle [rad]."""
    return math.cos(angle) if isinstance(angle, float) else np.cos(angle)


def tangent(angle: Any) -> Any:
    """The tangent of an angle [rad]."""
    return math.tan(angle) if isinstance(angle, float) else np.tan(angle)


def arc_sine(ratio: Any) -> Any:
    """The angle [rad] with this sine."""
    return math.asin(ratio) if isinstance(ratio, float) else np.arcsin(ratio)


def arc_cosine(ratio: Any) -> Any:
    """The angle [rad] with this cosine."""
    return math.acos(ratio) if isinstance(ratio, float) else np.arccos(ratio)


def is_finite_positive(value: Any) -> bool:
    """Whether a number is finite and above zero."""
    return bool(0.0 < value < math.inf)


def all_true(condition: Any) -> bool:
    """Whether a comparison holds, for arrays in every element; fast for floats."""
    return condition if isinstance(condition, bool) else bool(np.all(condition))


def direction(velocity: Any) -> Any:
    """Sign of a lengthening speed: 1.0 lengthening, -1.0 shortening, 0.0 at rest."""
    if isinstance(velocity, (float, int)):
        return 1.0 if velocity > 0.0 else (-1.0 if velocity < 0.0 else 0.0)
    return np.sign(velocity)
