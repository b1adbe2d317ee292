"""From the keys `unit`, `reference`, `scale`, `sign` and `zero` to the conversion of a signal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from pam_driver.boards.units import (
    ANGLE,
    ELECTRICAL,
    OTHER_UNITS,
    PRESSURE,
    SHARE,
    UNITS,
    Linear,
    reference_called,
    scale_of,
    unit_called,
    unknown_unit,
)
from pam_model.rig.keys import Key, Section
from pam_ros.foreign_text import shown

_REFERENCES: Final = ("gauge", "absolute")
_NO_UNITS: Final = frozenset({"-", "1", "raw", "count", "counts", "digit", "digits", "inc"})


class Source(NamedTuple):
    """What the device's own file says about a signal."""

    signal: str  # the signal, as messages name it
    unit: str  # its unit in that file; empty if it has none
    file: str  # what kind of file it is, as messages name it


def read_conversion(
    where: Section,
    source: Source,
    quantities: Sequence[str],
    ambient: float,
    *,
    absolute: bool = False,
) -> tuple[Linear, str] | None:
    """The conversion from the signal's physical value to SI.

    Parameters
    ----------
    where : Section
        The keys of one signal in the rig file.
    source : Source
        The signal and its unit in the device's file.
    quantities : sequence of str
        What the signal may be, see `units`.
    ambient : float
        Ambient pressure [Pa absolute].
    absolute : bool, optional
        Whether the result of a pressure is absolute; else gauge.

    Returns
    -------
    (Linear, str) or None
        The conversion, and the quantity; None if a problem was added.
    """
    unit = _unit(where, source, quantities)
    if unit is None:
        return None
    scaled = _scaled(where, unit, quantities)
    if scaled is None:
        return None
    result, quantity = scaled
    if quantity == PRESSURE:
        shift = _reference_shift(where, source, ambient, absolute)
        if shift is None:
            return None
        result = Linear(result.factor, result.offset + shift)
    elif where.get("reference") is not None:
        where.add("reference", f": only a pressure is gauge or absolute, and {unit} is none")
        return None
    return _directed(where, result, unit, quantity), quantity


def _scaled(where: Section, unit: str, quantities: Sequence[str]) -> tuple[Linear, str] | None:
    """The conversion by the unit alone, or by the key `scale`; and the resulting quantity."""
    quantity, factor = UNITS[unit]
    scale = where.get("scale")
    if scale is None and quantity in quantities:
        return Linear(factor), quantity
    if scale is None:
        where.add(
            "unit",
            f" = {unit}: a scale is needed, two points that say what {unit} means, as "
            f"scale: {{{unit}: [0.0, 10.0], {_example(quantities)}}}",
        )
        return None
    if not isinstance(scale, Mapping):
        where.add("scale", f" = {scale!r}: must be two points, as {{{unit}: [0.0, 10.0], ...}}")
        return None
    result = scale_of(unit, scale, quantities)
    if isinstance(result, str):
        where.add("scale", f": {result}")
        return None
    return result, UNITS[next(name for name in scale if name != unit)].quantity


def _unit(where: Section, source: Source, quantities: Sequence[str]) -> str | None:
    """The name of the signal's unit in the table, from the rig file or the device's file."""
    stated = where.get("unit")
    in_file = unit_called(source.unit) if source.unit else None
    allowed = [*quantities, ELECTRICAL, SHARE]
    place = source.signal
    wanted = " or ".join(f"{'an' if name[0] in 'ae' else 'a'} {name}" for name in quantities)
    if stated is None and in_file is None:
        given = f"has the unit {shown(source.unit)}" if source.unit else "has no unit"
        where.add(
            "unit",
            f": missing, and {place} {given} in the {source.file}; {unknown_unit('', allowed)}",
        )
        return None
    unit = in_file if stated is None else unit_called(str(stated))
    if unit is None:
        where.add("unit", f" = {stated}: unknown unit; {unknown_unit(stated, allowed)}")
        return None
    foreign = source.unit.strip()
    if foreign and foreign.lower() not in _NO_UNITS and in_file != unit:
        given = shown(source.unit) if in_file is None else source.unit
        told = f" = {unit}: the {source.file} says {given} for {place}"
        if in_file is not None or foreign.lower() in OTHER_UNITS:
            where.add("unit", told)
            return None
        where.doubt("unit", f"{told}, which is no known unit; {unit} is used")
    if UNITS[unit].quantity not in allowed:
        where.add("unit", f" = {unit}: {place} must be {wanted}, or have a scale")
        return None
    return unit


def _reference_shift(
    where: Section, source: Source, ambient: float, absolute: bool
) -> float | None:
    reference = where.get("reference")
    if reference not in _REFERENCES:
        given = ": missing" if reference is None else f" = {reference!r}"
        where.add("reference", f"{given}; must be gauge or absolute")
        return None
    stated = reference_called(source.unit)
    if stated not in {"", reference}:
        where.doubt(
            "reference", f" = {reference}: the {source.file} says {source.unit} for {source.signal}"
        )
    if (reference == "absolute") is absolute:
        return 0.0
    return ambient if absolute else -ambient


def _directed(where: Section, linear: Linear, unit: str, quantity: str) -> Linear:
    """The conversion with the sign and the zero of an angle or of a valve opening."""
    if quantity not in {ANGLE, SHARE}:
        return linear
    sign = where.get("sign")
    if sign not in (None, 1, -1) or isinstance(sign, bool):
        where.add("sign", f" = {sign!r}: must be 1 or -1")
        sign = 1
    zero = where.number("zero", Key(unit, -1e6, 1e6, 0.0))
    factor = linear.factor * (sign or 1)
    offset = linear.offset * (sign or 1)
    return Linear(factor, offset - factor * (zero or 0.0))


def _example(quantities: Sequence[str]) -> str:
    return {PRESSURE: "bar: [0.0, 6.0]", ANGLE: "deg: [0.0, 360.0]"}.get(
        quantities[0], "percent: [-100.0, 100.0]"
    )


def fits(value: float, low: float, high: float) -> bool:
    """Whether a value lies within a range, up to rounding."""
    margin = 1e-9 * max(abs(low), abs(high), 1.0)
    return math.isfinite(value) and low - margin <= value <= high + margin
