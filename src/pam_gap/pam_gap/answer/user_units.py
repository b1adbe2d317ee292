"""Numbers and names for people: 0.3 mrad, 120 kPa, null offset of the agonist."""

from __future__ import annotations

import re

_SMALLER = {"rad": ("mrad", 1e3, 0.1), "m": ("mm", 1e3, 1.0), "s": ("ms", 1e3, 1.0)}
"""Unit -> smaller unit, its factor, and the value from which the plain unit is used."""
_LARGER = {"Pa": ("kPa", 1e-3, 1e3)}
"""Unit -> larger unit, its factor, and the value from which it is used."""

_PEOPLE = re.compile("coulomb|stribeck")
"""Effects that are named after a person."""


def spoken(name: str) -> str:
    """Name of an effect or parameter: "null_offset.agonist" is "null offset of the agonist".

    Names of people keep their capital: "coulomb_friction" is "Coulomb friction".
    """
    words = name.replace("_", " ").replace(".", " of the ")
    return _PEOPLE.sub(lambda person: person[0].capitalize(), words)


def user_unit(size: float, unit: str) -> tuple[str, float]:
    """Unit in which values of about this size are shown, and the factor to it."""
    if unit in _SMALLER:
        name, factor, limit = _SMALLER[unit]
        return (name, factor) if abs(size) < limit else (unit, 1.0)
    if unit in _LARGER:
        name, factor, limit = _LARGER[unit]
        return (name, factor) if abs(size) >= limit else (unit, 1.0)
    return unit, 1.0


def plain(value: float, digits: int = 3) -> str:
    """A number with some significant digits, as 1200 rather than 1.2e+03, and never "-0"."""
    text = f"{value:.{digits}g}"
    if "e" in text and 1e-4 <= abs(value) < 1e7:
        text = f"{float(text):.{max(0, digits)}f}".rstrip("0").rstrip(".")
    return "0" if float(text) == 0.0 else text


def interval_digits(low: float, high: float) -> int:
    """Significant digits, three or more, with which the ends of an interval differ."""
    return next((n for n in range(3, 7) if plain(low, n) != plain(high, n)), 3)


def told(value: float, unit: str, digits: int = 2) -> str:
    """A value with its unit, such as "0.3 mrad" or "150 kPa"; "-" is no unit."""
    name, factor = user_unit(value, unit)
    shown = plain(value * factor, digits)
    return shown if name in ("", "-") else f"{shown} {name}"


def percent(share: float) -> str:
    """A share as per cent: "81 %", "0.07 %"."""
    value = 100.0 * share
    return f"{value:.0f} %" if value >= 9.95 else f"{plain(value, 2)} %"


def as_probability(probability: float) -> str:
    """A probability as per cent, which is never said to be 100 %."""
    return "over 99 %" if probability > 0.994 else percent(probability)
