"""The units of a device's signals, and their conversion to SI.

This is the only table of units of the kinds `mapped` and `canopen`. Sources: BIPM, The
International System of Units, 9th edition (bar, degree); NIST SP 811 (psi).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from typing import Any, Final, NamedTuple

PRESSURE: Final = "pressure"
ANGLE: Final = "angle"
TIME: Final = "time"
SHARE: Final = "share of full scale"
ELECTRICAL: Final = "electrical value"


class Unit(NamedTuple):
    """A unit: the kind of quantity, and how much of the SI unit it is."""

    quantity: str
    factor: float


UNITS: Final[Mapping[str, Unit]] = {
    "Pa": Unit(PRESSURE, 1.0),
    "hPa": Unit(PRESSURE, 1e2),
    "mbar": Unit(PRESSURE, 1e2),
    "kPa": Unit(PRESSURE, 1e3),
    "bar": Unit(PRESSURE, 1e5),
    "MPa": Unit(PRESSURE, 1e6),
    "psi": Unit(PRESSURE, 6894.757293168361),
    "rad": Unit(ANGLE, 1.0),
    "mrad": Unit(ANGLE, 1e-3),
    "deg": Unit(ANGLE, math.pi / 180.0),
    "rev": Unit(ANGLE, 2.0 * math.pi),
    "s": Unit(TIME, 1.0),
    "ms": Unit(TIME, 1e-3),
    "fraction": Unit(SHARE, 1.0),
    "percent": Unit(SHARE, 1e-2),
    "V": Unit(ELECTRICAL, 1.0),
    "mV": Unit(ELECTRICAL, 1e-3),
    "mA": Unit(ELECTRICAL, 1e-3),
}
"""All units by the name that the rig file uses; an electrical value is in V or A."""

# Other spellings in DBC and EDS files. A spelling that implies gauge or absolute is none of them on
# purpose: the reference is written in the rig file, where a reader sees it.
_SPELLINGS: Final[Mapping[str, str]] = {
    "%": "percent",
    "°": "deg",
    "degree": "deg",
    "degrees": "deg",
    "Deg": "deg",
    "turn": "rev",
    "turns": "rev",
    "Bar": "bar",
    "barg": "bar",
    "bara": "bar",
    "PSI": "psi",
    "psig": "psi",
    "psia": "psi",
    "kpa": "kPa",
    "pa": "Pa",
    "volt": "V",
    "Volt": "V",
    "sec": "s",
}


class Linear(NamedTuple):
    """The conversion of a device's value to SI: `factor` times the value plus `offset`."""

    factor: float
    offset: float = 0.0

    def si(self, value: float) -> float:
        """The value in SI."""
        return self.factor * value + self.offset

    def device(self, value: float) -> float:
        """The value in the device's unit."""
        return (value - self.offset) / self.factor


def unit_called(name: str) -> str | None:
    """The name in `UNITS` of a unit as a DBC or EDS file spells it; None for an unknown one."""
    name = _SPELLINGS.get(name, name)
    return name if name in UNITS else None


def unknown_unit(name: object, quantities: Sequence[str]) -> str:
    """The end of a message that refuses a unit: a suggestion, or the units that are known."""
    known = [unit for unit, (quantity, _) in UNITS.items() if quantity in quantities]
    close = get_close_matches(str(name), known, 1, 0.7)
    return f"did you mean {close[0]}?" if close else f"known: {', '.join(known)}"


def scale_of(unit: str, scale: Mapping[str, Any], quantities: Sequence[str]) -> Linear | str:
    """The conversion by two points, such as {V: [0, 10], bar: [0, 6]}.

    Parameters
    ----------
    unit : str
        The unit of the signal.
    scale : mapping
        For two units the values that belong together; one of them is `unit`.
    quantities : sequence of str
        The quantities that the other unit may have.

    Returns
    -------
    Linear or str
        From the value in `unit` to SI; or what is wrong, as the end of a message.
    """
    other = [name for name in scale if name != unit]
    if unit not in scale or len(other) != 1:
        return f"must have the two keys {unit} and a unit of {' or '.join(quantities)}"
    known = UNITS.get(other[0])
    if known is None or known.quantity not in quantities:
        return f"{other[0]} is no unit of {' or '.join(quantities)}; " + unknown_unit(
            other[0], quantities
        )
    points = (scale[unit], scale[other[0]])
    for name, values in zip((unit, other[0]), points, strict=True):
        if not isinstance(values, list | tuple) or len(values) != 2 or not all(map(_real, values)):
            return f"{name} must be two numbers, as [0.0, 10.0]"
    (x0, x1), (y0, y1) = ((float(a), float(b)) for a, b in points)
    if x0 == x1 or y0 == y1:
        return "the two points must differ in both units"
    slope = (y1 - y0) / (x1 - x0) * known.factor
    return Linear(slope, y0 * known.factor - slope * x0)


def _real(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value)
