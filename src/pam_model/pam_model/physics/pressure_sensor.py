"""Readings of a pressure sensor with gain and bias, and the true pressure from a reading.

These functions of floats also accept arrays, element by element.
"""

from __future__ import annotations

from typing import Any


def pressure_reading(pressure: Any, gain: Any, bias: Any) -> Any:
    """Reading [Pa] at a gauge pressure [Pa]: gain [-] times pressure, plus bias [Pa]."""
    return gain * pressure + bias


def true_pressure(reading: Any, gain: Any, bias: Any) -> Any:
    """Gauge pressure [Pa] of a reading [Pa]; the inverse of `pressure_reading`."""
    return (reading - bias) / gain
