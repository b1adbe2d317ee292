"""Which PDO carries which object, and the steps that make a device do so.

With `pdo_mapping: write` the driver fills the PDOs from the first one on and writes the mapping;
with `read` it takes the mapping of the EDS file, and the boot checks that the device has it.
Source: CiA 301 version 4.2, objects 0x1400 to 0x1BFF.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Final, NamedTuple

from pam_driver.boards.canopen.device import CanopenField, Check, Step, Write
from pam_driver.boards.canopen.dictionary import Dictionary, ObjectName, ObjectType
from pam_model.rig.keys import Section

_INVALID: Final = 0x8000_0000
_NO_REMOTE: Final = 0x4000_0000
_EVENT: Final = 255
_EVERY_SYNC: Final = 1
_LARGEST: Final = 64
_LAST_GAP: Final = 0x1F  # the objects below are data types, which fill a PDO and mean nothing


class PdoDirection(NamedTuple):
    """The objects of the PDOs of one direction."""

    word: str
    parameters: int
    mappings: int
    identifiers: int


RPDO: Final = PdoDirection("RPDO", 0x1400, 0x1600, 0x200)
TPDO: Final = PdoDirection("TPDO", 0x1800, 0x1A00, 0x180)


class PdoPlan(NamedTuple):
    """One PDO: its number, its identifier, its bytes, and the objects in it."""

    number: int
    frame_id: int
    length: int
    fields: tuple[CanopenField, ...]


def written(
    wanted: Mapping[ObjectName, ObjectType],
    direction: PdoDirection,
    dictionary: Dictionary,
    node: int,
    where: Section,
) -> list[PdoPlan]:
    """The PDOs that carry objects in the given order, filled one after the other."""
    rows: list[list[CanopenField]] = []
    for name, kind in wanted.items():
        used = sum(field.kind.bits for field in rows[-1]) if rows else _LARGEST
        if used + kind.bits > _LARGEST:
            rows.append([])
            used = 0
        rows[-1].append(CanopenField(name, used, kind))
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
        PdoPlan(
            number,
            direction.identifiers + 0x100 * (number - 1) + node,
            sum(field.kind.bits for field in row) // 8,
            tuple(row),
        )
        for number, row in zip(numbers, rows, strict=False)
    ]


def mapped_in_file(
    wanted: Mapping[ObjectName, ObjectType],
    direction: PdoDirection,
    dictionary: Dictionary,
    where: Section,
) -> list[PdoPlan]:
    """The PDOs of the EDS file that carry the objects."""
    missing = dict(wanted)
    plans = []
    for number in dictionary.numbers(direction.parameters):
        communication = ObjectName(direction.parameters + number - 1, 1)
        identifier = dictionary.default(communication, used=False)
        entries = mapped(dictionary, direction, number)
        carried = {name for name, _ in entries} & set(missing)
        if identifier is None or identifier & _INVALID or not carried:
            continue
        for name in (communication, *_mapping(dictionary, direction, number)):
            dictionary.use(name)
        fields, shift = [], 0
        for name, bits in entries:
            if name in missing:
                kind = missing.pop(name)
                fields.append(CanopenField(name, shift, kind))
                if kind.bits != bits:
                    where.add(
                        "pdo_mapping",
                        f" = read: {direction.word}{number} of {dictionary.file} carries {bits} "
                        f"bits of {name}, which has {kind.bits} bits",
                    )
            elif direction is RPDO and name.index > _LAST_GAP:
                where.add(
                    "pdo_mapping",
                    f" = read: {direction.word}{number} of {dictionary.file} also carries {name}, "
                    "which nothing in the rig file sets; pdo_mapping: write leaves it out",
                )
            shift += bits
        if shift > _LARGEST:
            where.add(
                "pdo_mapping",
                f" = read: {direction.word}{number} of {dictionary.file} has {shift} bits, "
                f"expected at most {_LARGEST}",
            )
            continue
        plans.append(PdoPlan(number, identifier & 0x7FF, (shift + 7) // 8, tuple(fields)))
    for name in missing:
        where.add(
            "pdo_mapping",
            f" = read: no {direction.word} of {dictionary.file} carries {name}; pdo_mapping: write "
            "adds it",
        )
    if missing:  # what is wrong with any of them may be the reason
        for number in dictionary.numbers(direction.parameters):
            dictionary.use(ObjectName(direction.parameters + number - 1, 1))
            for name in _mapping(dictionary, direction, number):
                dictionary.use(name)
    return plans


def mapped(
    dictionary: Dictionary, direction: PdoDirection, number: int
) -> list[tuple[ObjectName, int]]:
    """The objects of a PDO in their order by the EDS file, with their bits.

    A gap is an entry of a data type in place of an object, and several may be equal.
    """
    found = []
    for place in _mapping(dictionary, direction, number)[1:]:
        entry = dictionary.default(place, used=False) or 0
        found.append((ObjectName(entry >> 16, entry >> 8 & 0xFF), entry & 0xFF))
    return found


def default_carrier(dictionary: Dictionary, name: ObjectName, direction: PdoDirection) -> str:
    """The PDO that carries an object after power-up by the EDS file; empty if none does."""
    for number in dictionary.numbers(direction.parameters):
        if any(name == entry for entry, _ in mapped(dictionary, direction, number)):
            return f"{direction.word}{number}"
    return ""


def _mapping(dictionary: Dictionary, direction: PdoDirection, number: int) -> list[ObjectName]:
    """The number of mapped objects of a PDO, and its entries, as objects."""
    index = direction.mappings + number - 1
    count = dictionary.default(ObjectName(index, 0), used=False) or 0
    return [ObjectName(index, sub) for sub in range(1 + min(count, _LARGEST))]


def steps_of(
    plan: PdoPlan,
    direction: PdoDirection,
    dictionary: Dictionary,
    *,
    write: bool,
    sync: bool,
    period: int,
) -> Iterator[Step]:
    """The steps that configure a PDO, or check its mapping.

    Parameters
    ----------
    direction : PdoDirection
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
        known = mapped(dictionary, direction, plan.number)
        yield Check(ObjectName(mapping, 0), len(known), f"mapping of {called}", 0xFF)
        for sub, (name, bits) in enumerate(known, 1):
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
    used: Collection[int], direction: PdoDirection, dictionary: Dictionary
) -> Iterator[Step]:
    """The steps that turn off the PDOs that a device has after power-up and that are not used.

    One that cannot be turned off stays: its frames are ignored, and it receives nothing.
    """
    for number in dictionary.numbers(direction.parameters):
        name = ObjectName(direction.parameters + number - 1, 1)
        entry = dictionary.find(name, used=False)
        value = dictionary.default(name, used=False)
        if entry is None or not entry.writable:  # its frames are nobody's
            continue
        if number not in used and value is not None and not value & _INVALID:
            yield Write(name, _u32(value | _INVALID), f"{direction.word}{number} off")


def _u32(value: int) -> bytes:
    return value.to_bytes(4, "little")
