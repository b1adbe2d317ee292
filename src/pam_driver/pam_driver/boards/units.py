"""The units of a device's signals, and their conversion to SI.

This is the only table of units of the kinds `mapped` and `canopen`. Sources: BIPM, The
International System of Units, 9th edition (bar, degree); NIST SP 811 (psi).
"""

from __future__ import annotations

import math
import re
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

# Other spellings in DBC and EDS files, in lower case. "¡ã" and "Â°" are "°" in GBK and in UTF-8,
# read as Windows-1252.
_SPELLINGS: Final[Mapping[str, str]] = {
    **{name.lower(): name for name in UNITS},
    "%": "percent",
    **dict.fromkeys(("°", "º", "˚", "¡ã", "â°", "degree", "degrees", "degs", "°deg"), "deg"),
    **dict.fromkeys(("turn", "turns", "revolution", "revolutions"), "rev"),
    **dict.fromkeys(("radian", "radians"), "rad"),
    **dict.fromkeys(("volt", "volts"), "V"),
    **dict.fromkeys(("pascal", "pascals", "n/m2", "n/m^2", "n/m²"), "Pa"),
    **dict.fromkeys(("hectopascal", "hectopascals"), "hPa"),
    **dict.fromkeys(("kilopascal", "kilopascals", "kn/m2", "kn/m^2", "kn/m²"), "kPa"),
    **dict.fromkeys(("megapascal", "megapascals", "n/mm2", "n/mm^2", "n/mm²"), "MPa"),
    "bars": "bar",
    **dict.fromkeys(("lbf/in2", "lbf/in^2", "lbf/in²", "pound/in2"), "psi"),
    **dict.fromkeys(("sec", "second", "seconds"), "s"),
    **dict.fromkeys(("millibar", "millibars"), "mbar"),
}
_BRACKETS: Final = re.compile(r"[\[({](.*)[\])}]")
# "bar abs", "bar(a)", "kPa_g", "psig": a unit of pressure, and what it is measured from
_REFERRED: Final = re.compile(
    r"(.*?)[\s_\-.,(\[]*(?:(abs(?:olute)?\.?|a)|(gauge|gage|rel(?:ative)?\.?|g))[)\]]?",
    re.IGNORECASE,
)
OTHER_UNITS: Final = frozenset(
    {
        "°c",
        "degc",
        "deg c",
        "celsius",
        "k",
        "°f",
        "degf",
        "rpm",
        "1/min",
        "hz",
        "khz",
        "n",
        "nm",
        "a",
    }
    | {"w", "kw", "l/min", "m/s", "km/h", "mm", "m", "kg", "g", "ohm", "rad/s", "deg/s", "°/s", "h"}
)
"""Units, in lower case, that are well known and measure something else."""


class Linear(NamedTuple):
    """The conversion of a device's value to SI: `factor` times the value plus `offset`."""

    factor: float
    offset: float = 0.0

    @property
    def is_usable(self) -> bool:
        """Whether every value has a finite counterpart in both directions, as far as known."""
        return (
            self.factor != 0.0
            and all(map(math.isfinite, self))
            and math.isfinite(1.0 / self.factor)
            and math.isfinite(self.offset / self.factor)
        )

    def si(self, value: float) -> float:
        """The value in SI."""
        return self.factor * value + self.offset

    def device(self, value: float) -> float:
        """The value in the device's unit."""
        return (value - self.offset) / self.factor


def unit_called(name: str) -> str | None:
    """The name in `UNITS` of a unit as a DBC or EDS file spells it; None for an unknown one."""
    return _unit_and_reference(name)[0]


def reference_called(name: str) -> str:
    """Whether the spelling of a unit says "gauge" or "absolute"; empty if it says neither.

    It never replaces the key `reference` of the rig file, where a reader sees it.
    """
    return _unit_and_reference(name)[1]


def _unit_and_reference(name: str) -> tuple[str | None, str]:
    name = " ".join(name.split())
    whole = _BRACKETS.fullmatch(name)
    name = whole[1].strip() if whole else name
    unit = _spelled(name)
    if unit is not None:
        return unit, ""
    match = _REFERRED.fullmatch(name)
    unit = _spelled(match[1].strip()) if match else None
    if match is None or unit is None or UNITS[unit].quantity != PRESSURE:
        return None, ""
    return unit, "absolute" if match[2] else "gauge"


def _spelled(name: str) -> str | None:
    """A unit in any case; but mPa is not MPa, and Mbar is not mbar."""
    if name in UNITS:
        return name
    unit = _SPELLINGS.get(name.removesuffix(".").lower())
    if unit is None or name.islower() or name.isupper():
        return unit
    prefixes = {name[0], unit[0]}
    return None if prefixes == {"m", "M"} and name[1:].lower() == unit[1:].lower() else unit


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
    result = Linear(slope, y0 * known.factor - slope * x0)
    return result if result.is_usable else "the two points give no finite scale"


def _real(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value)
