"""Recognises by its size that a number has another unit than expected.

A number in bar where Pa is expected causes no error in any formula. It is wrong by a factor of
100 000 and the result is meaningless. The rig file, the tables of `fit` and the recordings of a
diagnosis therefore share this table of the units that people use in place of SI units.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

_PRESSURES = (("bar", 1e5), ("kPa", 1e3), ("MPa", 1e6), ("psi", 6894.757))
SCALES: Mapping[str, tuple[tuple[str, float], ...]] = {
    "Pa absolute": _PRESSURES,
    "Pa gauge": _PRESSURES,
    "m": (("mm", 1e-3), ("cm", 1e-2)),
    "m^3": (("cm^3 or ml", 1e-6), ("litres", 1e-3)),
    "rad": (("deg", math.pi / 180.0),),
    "rad/s": (("deg/s", math.pi / 180.0),),
    "s": (("ms", 1e-3),),
    "m^3/(s Pa)": (("L/(s bar)", 1e-8), ("L/(min bar)", 1e-8 / 60.0)),
}
"""Unit -> other units with the factor to it."""
RECORDED: Mapping[str, tuple[tuple[str, float], ...]] = {
    **SCALES,
    "Pa gauge": (*_PRESSURES, ("mbar", 100.0)),
    "Pa absolute": (*_PRESSURES, ("mbar", 100.0)),
    "rad": (("deg", math.pi / 180.0), ("mrad", 1e-3)),
    "s": (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("min", 60.0), ("h", 3600.0)),
    "-": (("per cent", 0.01), ("per mille", 1e-3)),
    "N": (("mN", 1e-3), ("kN", 1e3)),
}
"""The same for measured channels, which also come in the units of sensors and loggers."""

Scales = Mapping[str, tuple[tuple[str, float], ...]]
_WRITTEN = re.compile(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(\S.*?)\s*")


def units_that_fit(
    value: float, unit: str, low: float, high: float, scales: Scales = SCALES
) -> list[tuple[str, float]]:
    """Units in which a value would lie between `low` and `high` of the expected unit.

    Parameters
    ----------
    value : float
        The number as given.
    low, high : float
        Range of the quantity in the expected unit.
    scales : mapping
        `SCALES` or `RECORDED`.

    Returns
    -------
    list of (str, float)
        Name of each unit and its factor to the expected unit.
    """
    return [(name, scale) for name, scale in scales.get(unit, ()) if low <= value * scale <= high]


def conversion_hint(value: float, unit: str, low: float, high: float) -> str:
    """The hint which unit a measured value seems to have and how to convert it; "" without one."""
    found = units_that_fit(value, unit, low, high, RECORDED)
    if not found:
        return ""
    named = " or ".join(f"{name} (multiply by {scale:.7g})" for name, scale in found)
    return f"; looks like {named}"


def other_units(unit: str) -> dict[str, float]:
    """The units that people write in place of a unit, with their factors to it."""
    if unit == "deg":
        return {"rad": 180.0 / math.pi}
    return dict(RECORDED.get(f"{unit} gauge", RECORDED.get(unit, ())))


def read_with_unit(text: str, unit: str) -> float:
    """The number that a person wrote, with or without a unit behind it, such as 23deg or 20 mm.

    Parameters
    ----------
    text : str
        What was written.
    unit : str
        Unit of the result, and of a number without one.

    Returns
    -------
    float
        NaN if the text is no number, or its unit is no unit of this quantity.
    """
    factors = other_units(unit) | {unit: 1.0}
    written = _WRITTEN.fullmatch(text)
    number, factor = text, 1.0
    if written and written[2] in factors:
        number, factor = written[1], factors[written[2]]
    try:
        return factor * float(number)
    except ValueError:
        return math.nan
