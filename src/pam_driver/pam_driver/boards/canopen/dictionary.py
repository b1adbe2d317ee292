"""A device's object dictionary from its EDS file or a built-in profile, and what is used of it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final, NamedTuple

from canopen.objectdictionary import (
    ObjectDictionary,
    ODArray,
    ODRecord,
    ODVariable,
    datatypes,
)

from pam_driver.boards.canopen.eds_file import EdsContent, Flaw, read_eds
from pam_driver.boards.maker_file import read_maker_file
from pam_model.errors import PamError

PROFILES: Final = ("cia401_analogue", "cia404_pressure", "cia406_encoder", "regulator")
"""The built-in profiles: an EDS file of each is in the folder `profiles`."""
_FOLDER: Final = Path(__file__).parent / "profiles"
_MAX_BYTES: Final = 5_000_000
_OBJECT: Final = re.compile(r"0x([0-9A-Fa-f]{4})(?::(\d{1,3}|0x[0-9A-Fa-f]{1,2}))?")
_SIZES: Final = {
    datatypes.BOOLEAN: 8,
    **dict.fromkeys((datatypes.INTEGER8, datatypes.UNSIGNED8), 8),
    **dict.fromkeys((datatypes.INTEGER16, datatypes.UNSIGNED16), 16),
    **dict.fromkeys((datatypes.INTEGER24, datatypes.UNSIGNED24), 24),
    **dict.fromkeys((datatypes.INTEGER32, datatypes.UNSIGNED32, datatypes.REAL32), 32),
    **dict.fromkeys((datatypes.INTEGER64, datatypes.UNSIGNED64, datatypes.REAL64), 64),
}
"""Bits of the data types that can be configured or mapped."""


class EdsError(PamError):
    """An EDS file that cannot be used; the message names file and reason."""


@dataclass(frozen=True, slots=True, order=True)
class ObjectName:
    """An object: its index and sub-index."""

    index: int
    sub: int = 0

    def __iter__(self) -> Iterator[int]:
        return iter((self.index, self.sub))

    def __str__(self) -> str:
        return f"0x{self.index:04X}:{self.sub}"


def object_name(value: object) -> ObjectName | None:
    """The object that a rig file names as "0x6411:1" or 0x6004; None for anything else."""
    if isinstance(value, int) and not isinstance(value, bool):
        return ObjectName(value) if 0x1000 <= value <= 0xFFFF else None
    match = _OBJECT.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        return None
    name = ObjectName(int(match[1], 16), int(match[2] or "0", 0))
    return name if name.index >= 0x1000 and name.sub <= 0xFE else None


class ObjectType(NamedTuple):
    """How an object is encoded: its bits, and whether it is signed or a float."""

    bits: int
    signed: bool
    is_float: bool

    def holds(self, value: int) -> bool:
        """Whether a whole number fits."""
        low = -(1 << self.bits - 1) if self.signed else 0
        return low <= value < 1 << self.bits - self.signed


class Dictionary:
    """The objects of one device.

    Parameters
    ----------
    path : Path
        The EDS file.
    node : int
        Node number of the device, on which its default identifiers depend.

    Attributes
    ----------
    file : str
        The name of the EDS file, for messages.
    vendor, product : int
        The identity that the file states; 0 if it states none.
    doubts : list of str
        What is wrong with used objects although they can be used.

    Raises
    ------
    EdsError
        If the file cannot be used.
    """

    def __init__(self, path: Path, node: int) -> None:
        self.file = path.name
        self.doubts: list[str] = []
        content = _load(path, _changed_at(path), node)
        self._objects, self._lines, self._flaws = content
        self._used: set[ObjectName] = set()
        self.vendor = self.certain(ObjectName(0x1018, 1)) or 0
        if 0x1000 not in self._objects:
            self.doubts.append("it has no object 0x1000, so the device profile is not checked")
        self.product = self.certain(ObjectName(0x1018, 2)) or 0

    def line(self, name: ObjectName) -> int:
        """The line of the file in which an object begins; 0 if it has none."""
        return self._lines.get((name.index, name.sub), self._lines.get((name.index, 0), 0))

    def use(self, name: ObjectName) -> None:
        """Note that the robot depends on what the file says about an object."""
        self._used.add(name)

    def flaws(self, *, used: bool) -> list[Flaw]:
        """What is wrong with the objects that were used, or with everything else in the file."""
        return [
            flaw
            for flaw in self._flaws
            if used is any(flaw.concerns(one.index, one.sub) for one in self._used)
        ]

    def doubtful_names(self) -> list[ObjectName]:
        """The objects that were used and about which something is wrong in the file."""
        return [
            one
            for one in self._used
            if any(flaw.concerns(one.index, one.sub) for flaw in self._flaws)
        ]

    def as_canopen(self) -> ObjectDictionary:
        """The same objects as `canopen` keeps them."""
        result = ObjectDictionary()  # type: ignore[no-untyped-call]
        result.indices = dict(self._objects)
        return result

    def find(self, name: ObjectName, *, used: bool = True) -> ODVariable | None:
        """The entry of an object, which is `used` by that; None if the device does not have it."""
        if used:
            self.use(name)
        found = self._objects.get(name.index)
        if isinstance(found, ODVariable):
            return found if name.sub == 0 else None
        if found is None:
            return None
        if name.sub in found.subindices:
            one: ODVariable = found.subindices[name.sub]
            return one
        count = self.default(ObjectName(name.index, 0), used=used) if name.sub else None
        if isinstance(found, ODArray) and 1 in found.subindices and name.sub <= (count or 0):
            made: ODVariable = found[name.sub]
            return made
        return None

    def __contains__(self, name: ObjectName) -> bool:
        return self.find(name) is not None

    def type_of(self, name: ObjectName) -> ObjectType | None:
        """The type of an object; None if the device does not have it, or it is no number."""
        entry = self.find(name)
        kind = None if entry is None else entry.data_type
        bits = _SIZES.get(kind) if kind is not None else None
        if kind is None or bits is None:
            return None
        return ObjectType(bits, kind in datatypes.SIGNED_TYPES, kind in datatypes.FLOAT_TYPES)

    def default(self, name: ObjectName, *, used: bool = True) -> int | None:
        """The value of an integer object after power-up, as the EDS file states it."""
        entry = self.find(name, used=used)
        if entry is None:
            return None
        value = entry.value if entry.value is not None else entry.default
        return value if isinstance(value, int) else None

    def certain(self, name: ObjectName) -> int | None:
        """The default of an object that can be done without; None if anything is wrong with it."""
        if any(flaw.concerns(name.index, name.sub) for flaw in self._flaws):
            return None
        return self.default(name, used=False)

    def numbers(self, first: int) -> list[int]:
        """The numbers of the PDOs whose communication parameters begin at an index."""
        return [index - first + 1 for index in sorted(self._objects) if 0 <= index - first < 0x200]

    def near(self, name: ObjectName) -> str:
        """The end of a message about an object that is missing: what there is in its place."""
        found = self._objects.get(name.index)
        if isinstance(found, ODRecord | ODArray):
            subs = ", ".join(str(sub) for sub in list(found.subindices)[:8])
            return f"; 0x{name.index:04X} has the sub-indices {subs}"
        if found is not None:
            return f"; 0x{name.index:04X} has no sub-indices"
        mapped = [
            str(ObjectName(index, entry.subindex))
            for index, one in sorted(self._objects.items())
            if index >= 0x2000
            for entry in ([one] if isinstance(one, ODVariable) else list(one.subindices.values()))
            if entry.pdo_mappable
        ]
        return f"; for PDOs it has {', '.join(mapped[:6])}" if mapped else ""


def profile_path(name: str) -> Path:
    """The EDS file of a built-in profile."""
    return _FOLDER / f"{name}.eds"


def encoded(kind: ObjectType, value: int) -> bytes:
    """An integer as the data of an object.

    Raises
    ------
    OverflowError
        If it does not fit.
    """
    return value.to_bytes(kind.bits // 8, "little", signed=value < 0)


def _changed_at(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError as error:
        raise EdsError(f"{path}: cannot be read: {error.strerror}") from None


@lru_cache(maxsize=64)
def _load(path: Path, changed_at: int, node: int) -> EdsContent:
    """What the file describes; `changed_at` makes a changed file be read again."""
    content = read_eds(read_maker_file(path, _MAX_BYTES, "an EDS file", EdsError), node)
    if not content.objects:
        raise EdsError(f"{path}: not a valid EDS file: it describes no object, as [1000] would")
    return content
