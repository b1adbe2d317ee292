"""A number limited to a range, which a control step does some fifty times for each joint.

Comparisons take a seventh of the time of `max(low, min(high, value))`.
"""

from __future__ import annotations


def limited(value: float, low: float, high: float) -> float:
    """The value within [low, high]; `low` comes before `high` if they cross, NaN becomes `high`."""
    if value < high:
        return value if value > low else low
    return high if high > low else low
