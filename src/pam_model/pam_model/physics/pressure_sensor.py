"""What a pressure sensor with gain and zero shows, and what it should have shown.

Functions of floats, which also work on arrays element by element; the plant's observer compiles
them. The position sensor adds its offset to the position.
"""

from __future__ import annotations

from typing import Any


def pressure_reading(pressure: Any, gain: Any, bias: Any) -> Any:
    """The reading [Pa] at a gauge pressure [Pa]: gain [-] first, then bias [Pa]."""
    return gain * pressure + bias


def true_pressure(reading: Any, gain: Any, bias: Any) -> Any:
    """The gauge pressure [Pa] of a reading [Pa]; the inverse of `pressure_reading`."""
    return (reading - bias) / gain
