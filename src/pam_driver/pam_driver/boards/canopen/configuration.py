"""The steps that configure a device before it is started: heartbeats, errors, further objects.

Sources: CiA 301 version 4.2, objects 0x1016, 0x1017, 0x1029; CiA 401 version 3.0, objects 0x6423,
0x6443, 0x6444; CiA 404, objects 0x6131, 0x6132; CiA 303-2 (codes of physical units).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Final

from pam_driver.boards.canopen.device import Check, Step, Write
from pam_driver.boards.canopen.dictionary import Dictionary, ObjectName, encoded, object_name
from pam_driver.boards.canopen.signals import SignalReader
from pam_model.rig.keys import Section

_ENTRY: Final = re.compile(r"\s*([^=\s]+)\s*=\s*(-?(?:0x[0-9A-Fa-f]+|\d+))\s*")
_STOPPED_ON_ERROR: Final = 2
# CiA 401: output, error mode and error value have the same sub-index
_OUTPUTS, _ERROR_MODE, _ERROR_VALUE = 0x6411, 0x6443, 0x6444
_INTERRUPT: Final = ObjectName(0x6423)
# CiA 404: process values as float32 and int32, their unit and their decimal digits
_PROCESS_VALUES: Final = frozenset({0x6130, 0x7130, 0x9130})
_UNIT, _DIGITS = 0x6131, 0x6132
_UNIT_CODES: Final = {
    "Pa": 0x0022_0000,
    "hPa": 0x0222_0000,
    "kPa": 0x0322_0000,
    "MPa": 0x0622_0000,
    "bar": 0x004E_0000,
    "mbar": 0xFD4E_0000,
    "psi": 0x00AB_0000,
}


def read_configuration(top: Section, dictionary: Dictionary) -> Iterator[Step]:
    """The steps of the keys `configuration` and `expect`."""
    for key in ("expect", "configuration"):
        entries = top.get(key)
        if entries is None:
            continue
        if isinstance(entries, str) or not isinstance(entries, list | tuple):
            top.add(key, f' = {entries!r}: must be a list, as ["0x6112:1 = 3"]')
            continue
        for entry in entries:
            step = _step(key, entry, top, dictionary)
            if step is not None:
                yield step


def _step(key: str, entry: object, top: Section, dictionary: Dictionary) -> Step | None:
    match = _ENTRY.fullmatch(entry) if isinstance(entry, str) else None
    name = object_name(match[1]) if match else None
    if match is None or name is None:
        top.add(key, f': {entry!r} must be an object and its value, as "0x6112:1 = 3"')
        return None
    kind, found = dictionary.type_of(name), dictionary.find(name)
    value, file = int(match[2], 0), dictionary.file
    problem = ""
    if found is None:
        problem = f": {name}: {file} has no such object{dictionary.near(name)}"
    elif kind is None or kind.is_float or kind.bits > 32:
        problem = f": {name}: only integers of at most 32 bits can be given here"
    elif not -(1 << kind.bits - 1) * int(kind.signed) <= value < 1 << kind.bits:
        low = -(1 << kind.bits - 1) * int(kind.signed)
        problem = f": {name} = {value}: takes values from {low} to {(1 << kind.bits) - 1}"
    elif key == "configuration" and not found.writable:
        problem = f": {name}: {file} says that it cannot be written"
    if problem or kind is None:
        top.add(key, problem)
        return None
    if key == "expect":
        mask = (1 << kind.bits) - 1
        return Check(name, value & mask, "expect of the rig file", mask)
    return Write(name, encoded(kind, value), "configuration of the rig file")


def heartbeat_steps(
    dictionary: Dictionary,
    period: float,
    guards: float | None,
    host_node: int,
    drives: bool,
    top: Section,
) -> Iterator[Step]:
    """The device's heartbeat, and what it does without that of the host."""
    produced, why = ObjectName(0x1017), "producer heartbeat time"
    entry, fixed = dictionary.find(produced), dictionary.default(produced)
    if entry is not None and not entry.writable and fixed:
        if fixed != round(1e3 * period):
            top.add(
                "heartbeat_period",
                f" = {period:g} s: {produced} of {dictionary.file} is fixed at {fixed} ms; write "
                f"{fixed / 1000:g}",
            )
        yield Check(produced, fixed, why, 0xFFFF)
    else:
        yield Write(produced, round(1e3 * period).to_bytes(2, "little"), why)
    if not drives:
        return
    time = 0 if guards is None else round(1e3 * guards)
    consumer, behaviour = ObjectName(0x1016, 1), ObjectName(0x1029, 1)
    if guards is not None or _is_writable(dictionary, consumer):
        value = host_node << 16 | time if time else 0
        yield Write(consumer, value.to_bytes(4, "little"), "consumer heartbeat time")
    if _is_writable(dictionary, behaviour):
        yield Write(behaviour, bytes([_STOPPED_ON_ERROR]), "error behaviour: stopped")


def _is_writable(dictionary: Dictionary, name: ObjectName) -> bool:
    entry = dictionary.find(name)
    return entry is not None and bool(entry.writable)


def error_values(
    dictionary: Dictionary,
    signals: SignalReader,
    given: Mapping[ObjectName, float | None],
    top: Section,
    watchdog: float | None,
) -> dict[ObjectName, int]:
    """By output of CiA 401, the raw value on errors; empty if the device has no such objects."""
    values: dict[ObjectName, int] = {}
    for demand in signals.demands:
        index, sub = demand.name
        objects = [ObjectName(one, sub) for one in (_ERROR_MODE, _ERROR_VALUE)]
        kinds = [dictionary.type_of(one) for one in objects]
        known = index == _OUTPUTS and all(_is_writable(dictionary, one) for one in objects)
        if not known:
            if watchdog is not None and "outputs_off_on_error" not in top.tree:
                top.add(
                    "outputs_off_on_error",
                    f": missing; {demand.name} has no error mode (0x6443) in {dictionary.file}, so "
                    "the manual must say whether the outputs go off when the device leaves the "
                    "state operational: true or false",
                )
            return {}
        vented = demand.linear.si(demand.vented)
        value = given[demand.name]
        if value is None and abs(vented) >= 0.5:
            top.problems.add(
                demand.key,
                f".error_value: missing; the valve vents at the raw value {vented:.0f}, and the "
                f"manual says how 0x6444:{sub} expresses it",
            )
            continue
        kind = kinds[1]
        if value and kind is not None and not kind.holds(int(value)):
            size = f"{kind.bits} bits {'with' if kind.signed else 'without'} sign"
            top.problems.add(demand.key, f".error_value = {value:g}: 0x6444:{sub} has {size}")
            continue
        values[demand.name] = int(value or 0)
    return values


def error_steps(dictionary: Dictionary, values: Mapping[ObjectName, int]) -> Iterator[Step]:
    """The outputs go to their error value when the device is stopped or misses the host.

    CiA 401 has 8 and 32 bits for the two objects; there are modules with 16 bits for both, so the
    EDS file decides.
    """
    for (_, sub), value in values.items():
        for index, wanted, why in (
            (_ERROR_MODE, 1, "error mode of the output"),
            (_ERROR_VALUE, value, "error value of the output"),
        ):
            name = ObjectName(index, sub)
            kind = dictionary.type_of(name)
            assert kind is not None, "error_values has checked it"
            yield Write(name, encoded(kind, wanted), why)


def input_steps(dictionary: Dictionary, signals: SignalReader) -> Iterator[Step]:
    """What a device profile needs so that its inputs are sent and mean what the rig file says."""
    inputs = signals.readings
    if any(one.name.index & 0xFFF0 == 0x6400 for one in inputs) and _INTERRUPT in dictionary:
        yield Write(_INTERRUPT, b"\1", "transmission of analogue inputs")
    for one in inputs:
        if one.name.index not in _PROCESS_VALUES:
            continue
        unit = ObjectName(_UNIT, one.name.sub)
        if unit in dictionary and one.unit in _UNIT_CODES:
            yield Check(unit, _UNIT_CODES[one.unit], f"unit of {one.name}: {one.unit}")
        digits = -math.log10(abs(one.slope))
        places = ObjectName(_DIGITS, one.name.sub)
        is_float = signals.types[one.name].is_float
        if places in dictionary and not is_float and abs(digits - round(digits)) < 1e-9:
            yield Check(places, round(digits), f"decimal digits of {one.name}", 0xFF)


def vented_steps(signals: SignalReader) -> Iterator[Step]:
    """Every set point vents before the device is started."""
    for demand in signals.demands:
        kind = signals.types[demand.name]
        if kind.is_float or kind.bits > 32:
            continue
        value = round(min(max(demand.linear.si(demand.vented), demand.low), demand.high))
        yield Write(demand.name, encoded(kind, value), "vented set point", may_fail=True)
