"""Which PDO carries which object, and the steps that make a device do so.

With `pdo_mapping: write` the driver fills the PDOs from the first one on and writes the mapping;
with `read` it takes the mapping of the EDS file, and the boot checks that the device has it.
Source: CiA 301 version 4.2, objects 0x1400 to 0x1BFF.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Final, NamedTuple

from pam_driver.boards.canopen.device import Check, Field, Step, Write
from pam_driver.boards.canopen.dictionary import Dictionary, ObjectName, ObjectType
from pam_model.rig.keys import Section

_INVALID: Final = 0x8000_0000
_NO_REMOTE: Final = 0x4000_0000
_EVENT: Final = 255
_EVERY_SYNC: Final = 1
_LARGEST: Final = 64


class Direction(NamedTuple):
    """The objects of the PDOs of one direction."""

    word: str
    parameters: int
    mappings: int
    identifiers: int


RPDO: Final = Direction("RPDO", 0x1400, 0x1600, 0x200)
TPDO: Final = Direction("TPDO", 0x1800, 0x1A00, 0x180)


class Plan(NamedTuple):
    """One PDO: its number, its identifier, its bytes, and the objects in it."""

    number: int
    frame_id: int
    length: int
    fields: tuple[Field, ...]


def written(
    wanted: Mapping[ObjectName, ObjectType],
    direction: Direction,
    dictionary: Dictionary,
    node: int,
    where: Section,
) -> list[Plan]:
    """The PDOs that carry objects in the given order, filled one after the other."""
    rows: list[list[Field]] = []
    for name, kind in wanted.items():
        used = sum(field.kind.bits for field in rows[-1]) if rows else _LARGEST
        if used + kind.bits > _LARGEST:
            rows.append([])
            used = 0
        rows[-1].append(Field(name, used, kind))
    # only the first four have identifiers of the predefined connection set
    numbers = [number for number in dictionary.numbers(direction.parameters) if number <= 4]
    if len(rows) > len(numbers):
        where.add(
            "pdo_mapping",
            f": {len(rows)} {direction.word}s are needed, but {dictionary.file} has "
            f"{len(numbers)} of them with a default identifier",
        )
        return []
    return [
        Plan(
            number,
            direction.identifiers + 0x100 * (number - 1) + node,
            sum(field.kind.bits for field in row) // 8,
            tuple(row),
        )
        for number, row in zip(numbers, rows, strict=False)
    ]


def mapped_in_file(
    wanted: Mapping[ObjectName, ObjectType],
    direction: Direction,
    dictionary: Dictionary,
    where: Section,
) -> list[Plan]:
    """The PDOs of the EDS file that carry the objects."""
    missing = dict(wanted)
    plans = []
    for number in dictionary.numbers(direction.parameters):
        identifier = dictionary.default(ObjectName(direction.parameters + number - 1, 1))
        names = _entries(dictionary, direction, number)
        if identifier is None or identifier & _INVALID or not set(names) & set(missing):
            continue
        fields, shift = [], 0
        for name, bits in names.items():
            if name in missing:
                fields.append(Field(name, shift, missing.pop(name)))
            elif direction is RPDO:
                where.add(
                    "pdo_mapping",
                    f" = read: {direction.word}{number} of {dictionary.file} also carries {name}, "
                    "which nothing in the rig file sets; pdo_mapping: write leaves it out",
                )
            shift += bits
        plans.append(Plan(number, identifier & 0x7FF, (shift + 7) // 8, tuple(fields)))
    for name in missing:
        where.add(
            "pdo_mapping",
            f" = read: no {direction.word} of {dictionary.file} carries {name}; pdo_mapping: write "
            "adds it",
        )
    return plans


def _entries(dictionary: Dictionary, direction: Direction, number: int) -> dict[ObjectName, int]:
    """The objects of a PDO by the EDS file, with their bits."""
    index = direction.mappings + number - 1
    found = {}
    for sub in range(1, 1 + (dictionary.default(ObjectName(index, 0)) or 0)):
        entry = dictionary.default(ObjectName(index, sub)) or 0
        found[ObjectName(entry >> 16, entry >> 8 & 0xFF)] = entry & 0xFF
    return found


def steps_of(
    plan: Plan,
    direction: Direction,
    dictionary: Dictionary,
    *,
    write: bool,
    sync: bool,
    period: int,
) -> Iterator[Step]:
    """The steps that configure a PDO, or check its mapping.

    Parameters
    ----------
    plan : Plan
        The PDO.
    direction : Direction
        Whether the device receives or transmits it.
    dictionary : Dictionary
        The device.
    write : bool
        Whether the mapping is written; else it is checked.
    sync : bool
        Whether a TPDO follows SYNC.
    period : int
        Event timer of a TPDO without SYNC [ms].
    """
    index = direction.parameters + plan.number - 1
    mapping = direction.mappings + plan.number - 1
    called = f"{direction.word}{plan.number}"
    identifier, is_tpdo = ObjectName(index, 1), direction is TPDO
    default = dictionary.default(identifier) or 0
    value = plan.frame_id | default & _NO_REMOTE
    entries = [
        field.name.index << 16 | field.name.sub << 8 | field.kind.bits for field in plan.fields
    ]
    if write:
        yield Write(identifier, _u32(value | _INVALID), f"{called} off")
        yield Write(ObjectName(mapping, 0), b"\0", f"mapping of {called}")
        for sub, entry in enumerate(entries, 1):
            yield Write(ObjectName(mapping, sub), _u32(entry), f"mapping of {called}")
        yield Write(ObjectName(mapping, 0), bytes([len(entries)]), f"mapping of {called}")
    else:
        yield Check(identifier, plan.frame_id, f"identifier of {called}", _INVALID | 0x1FFF_FFFF)
        known = _entries(dictionary, direction, plan.number)
        yield Check(ObjectName(mapping, 0), len(known), f"mapping of {called}", 0xFF)
        for sub, (name, bits) in enumerate(known.items(), 1):
            entry = name.index << 16 | name.sub << 8 | bits
            yield Check(ObjectName(mapping, sub), entry, f"mapping of {called}")
    kind = _EVERY_SYNC if is_tpdo and sync else _EVENT
    writable = dictionary.find(ObjectName(index, 2))
    if writable is not None and writable.writable:
        yield Write(ObjectName(index, 2), bytes([kind]), f"transmission type of {called}")
    if is_tpdo:
        for sub, number, why in ((3, 0, "inhibit time"), (5, 0 if sync else period, "event timer")):
            entry_of = dictionary.find(ObjectName(index, sub))
            if entry_of is not None and entry_of.writable:
                data = number.to_bytes(2, "little")
                yield Write(ObjectName(index, sub), data, f"{why} of {called}")
    if write:
        yield Write(identifier, _u32(value), f"{called} on")


def unused_off(
    used: Collection[int], direction: Direction, dictionary: Dictionary
) -> Iterator[Step]:
    """The steps that turn off the PDOs that a device has after power-up and nobody uses."""
    for number in dictionary.numbers(direction.parameters):
        name = ObjectName(direction.parameters + number - 1, 1)
        value = dictionary.default(name)
        if number not in used and value is not None and not value & _INVALID:
            yield Write(name, _u32(value | _INVALID), f"{direction.word}{number} off")


def _u32(value: int) -> bytes:
    return value.to_bytes(4, "little")
