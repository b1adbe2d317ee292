"""Reads an EDS file tolerantly: the objects that it describes well, and what is wrong elsewhere.

`import_eds` of the package canopen refuses a file as a whole for one flaw anywhere in it. Here the
file is cut into its sections first; what describes an object is checked, completed where nothing is
lost, and handed over as an EDS file without flaws. Whoever uses an object asks for its flaws.
Source: CiA 306-1 version 1.3 (sections and keys, which are not case-sensitive; numbers).
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from canopen.objectdictionary import ODArray, ODRecord, ODVariable, datatypes
from canopen.objectdictionary.eds import import_eds

from pam_ros.foreign_text import shown

_OBJECT: Final = re.compile(r"([0-9a-f]{4})(?:sub([0-9a-f]{1,2}))?")
_VALUES: Final = re.compile(r"([0-9a-f]{4})value")
_HEADER: Final = re.compile(r"\[\s*([^\]\[]*?)\s*\](.*)")
_NODE: Final = re.compile(r"\+?\$NODEID\+?", re.IGNORECASE)
_TEXTS: Final = frozenset({datatypes.VISIBLE_STRING, datatypes.UNICODE_STRING})
_BYTES: Final = frozenset({datatypes.OCTET_STRING, datatypes.DOMAIN})
_LARGEST_STANDARD_TYPE: Final = 0x1B
_VAR, _DOMAIN, _ARRAY, _RECORD = 7, 2, 8, 9
_DEFTYPE, _DEFSTRUCT = 5, 6
_KINDS: Final = frozenset({_VAR, _DOMAIN, _ARRAY, _RECORD, _DEFTYPE, _DEFSTRUCT})
_ACCESS: Final = ("ro", "wo", "rw", "rwr", "rww", "const")
_DEVICE_NUMBER: Final = re.compile(
    r"(vendor|product|revision)number|baudrate_\d+|nrof[rt]xpdo|granularity|lss_supported"
    r"|(simplebootup|dynamicchannels|groupmessag)\w*"
)
# what is read of an object; anything else in its section means nothing to the driver
_KEYS: Final = frozenset(
    {"objecttype", "datatype", "accesstype", "pdomapping", "lowlimit", "highlimit"}
    | {"defaultvalue", "parametervalue", "compactsubobj", "factor", "unit"}
)

Object = ODVariable | ODArray | ODRecord


@dataclass(frozen=True, slots=True)
class Flaw:
    """Something that is wrong in a line.

    `index` and `sub` are the object that the line makes doubtful; `index` is None if it makes none
    doubtful, and `sub` is None for what concerns all sub-indices.
    """

    line: int
    text: str
    index: int | None = None
    sub: int | None = None

    def concerns(self, index: int, sub: int) -> bool:
        """Whether it makes an object doubtful."""
        return self.index == index and self.sub in {None, sub}

    def __str__(self) -> str:
        return f"line {self.line}: {self.text}"


class EdsContent(NamedTuple):
    """The objects of a file by index, where each object begins, and what is wrong."""

    objects: dict[int, Object]
    lines: dict[tuple[int, int], int]
    flaws: list[Flaw]


@dataclass
class _Section:
    """A section of the file: its values by key in lower case, each with its line."""

    name: str
    line: int
    values: dict[str, tuple[str, int]] = field(default_factory=dict)

    @property
    def place(self) -> tuple[int | None, int | None]:
        """The object that it describes, and its sub-index."""
        match = _OBJECT.fullmatch(self.name) or _VALUES.fullmatch(self.name)
        if match is None:
            return None, None
        sub = match[2] if match.re is _OBJECT else None
        return int(match[1], 16), None if sub is None else int(sub, 16)

    @property
    def meaning(self) -> dict[str, str]:
        """What the driver reads of it."""
        return {key: value for key, (value, _) in self.values.items() if key in _KEYS}

    def get(self, key: str) -> str:
        """A value; empty if it is missing."""
        return self.values.get(key, ("", 0))[0]

    def line_of(self, key: str) -> int:
        """The line of a key, or of the section if the key is missing."""
        return self.values.get(key, ("", self.line))[1]


def read_eds(text: str, node: int) -> EdsContent:
    """The objects that an EDS file describes.

    Parameters
    ----------
    node : int
        Node number, which replaces `$NODEID`.
    """
    flaws: list[Flaw] = []
    sections = _sections(text, flaws)
    flaws += _flaws_elsewhere(sections)
    reader = _Objects(sections, node, flaws)
    clean = "\n".join(("[DeviceInfo]", *reader.clean()))
    objects: dict[int, Object] = dict(
        import_eds(io.StringIO(clean), node).indices  # type: ignore[no-untyped-call]
    )
    return EdsContent(objects, reader.lines, sorted(flaws, key=lambda flaw: flaw.line))


def eds_number(text: str, node: int = 0) -> int | None:
    """A whole number of an EDS file; None if it is none.

    A number with a leading 0 is octal (CiA 306), and decimal if it cannot be octal.
    """
    plain = text.replace(" ", "")
    relative = _NODE.search(plain) is not None
    plain = _NODE.sub("", plain) or ("0" if relative else "")
    if not re.fullmatch(r"[-+]?(0[xX][0-9a-fA-F]+|[0-9]+)", plain) or len(plain) > 40:
        return None
    digits = plain.lstrip("+-")
    base = 16 if digits[:2].lower() == "0x" else 8 if re.fullmatch(r"0[0-7]+", digits) else 10
    value = int(digits, base) * (-1 if plain[0] == "-" else 1)
    return value + node if relative else value


def _sections(text: str, flaws: list[Flaw]) -> list[_Section]:
    """The sections in the order of the file; those of one name are put together."""
    written = [_Section("", 0)]
    for number, line in enumerate(text.split("\n"), 1):
        plain = line.strip()
        if not plain or plain[0] in ";#":
            continue
        current = written[-1]
        if plain[0] == "[":
            match = _HEADER.fullmatch(plain)
            name = (match[1] if match else plain.strip("[]")).strip().lower()
            current = _Section(name.removeprefix("0x"), number)
            written.append(current)
            if match is None or (match[2].strip() and match[2].strip()[0] not in ";#"):
                flaws.append(Flaw(number, f"{shown(plain)} is no [section]", *current.place))
            continue
        key, equals, value = plain.partition("=")
        value = re.split(r"(?:^|\s);", value, maxsplit=1)[0].strip()
        if equals:
            _keep(current, key.strip().lower(), (value, number), flaws)
        else:
            flaws.append(Flaw(number, f"{shown(plain)} is no key = value", *current.place))
    return _united(written, flaws)


def _keep(section: _Section, key: str, given: tuple[str, int], flaws: list[Flaw]) -> None:
    """Add a value with its line to a section, unless it has one; of two, the first counts."""
    before = section.values.setdefault(key, given)
    if before[1] != given[1]:
        text = f"{shown(key)} is there twice, first in line {before[1]}"
        doubtful = before[0] != given[0] and key in _KEYS
        flaws.append(Flaw(given[1], text, *(section.place if doubtful else ())))


def _united(written: Iterable[_Section], flaws: list[Flaw]) -> list[_Section]:
    """One section for each name; a second one that says the same makes nothing doubtful."""
    found: dict[str, _Section] = {}
    for section in written:
        first = found.setdefault(section.name, section)
        if first is section:
            continue
        text = f"[{section.name[:16]}] is there twice, first in line {first.line}"
        if first.meaning == section.meaning:
            flaws.append(Flaw(section.line, text))
            continue
        flaws.append(Flaw(section.line, text, *section.place))
        for key, given in section.values.items():
            _keep(first, key, given, flaws)
    return list(found.values())


def _flaws_elsewhere(sections: Iterable[_Section]) -> Iterator[Flaw]:
    """What is wrong in the sections that describe no object, and that the driver does not need."""
    for section in sections:
        if section.name == "deviceinfo":
            for key, (text, line) in section.values.items():
                if not _DEVICE_NUMBER.fullmatch(key):
                    continue
                number = eds_number(text)
                if number is None:
                    yield Flaw(line, f"[DeviceInfo] {key} = {shown(text)} is no number")
                elif re.match(r"0\d", text):
                    yield Flaw(line, f"[DeviceInfo] {key} = {text} means {number} (octal)")
        elif section.name == "comments":
            count = eds_number(section.get("lines"))
            there = sum(key.startswith("line") and key != "lines" for key in section.values)
            if count != there:
                text = f"[Comments] Lines = {shown(section.get('lines'))}, but there are {there}"
                yield Flaw(section.line_of("lines"), text)
        elif section.name == "dummyusage":
            missing = [
                f"Dummy{n:04d}" for n in range(1, 8) if f"dummy{n:04d}" not in section.values
            ]
            if missing:
                yield Flaw(section.line, f"[DummyUsage] has no {', '.join(missing)}")


class _Objects:
    """The sections of objects, completed and checked; `lines` has where each object begins."""

    def __init__(self, sections: Iterable[_Section], node: int, flaws: list[Flaw]) -> None:
        self.lines: dict[tuple[int, int], int] = {}
        self._node, self._flaws = node, flaws
        self._by_name = {section.name: section for section in sections}
        self._parents: dict[int, _Section] = {}
        self._subs: dict[int, dict[int, _Section]] = {}
        for section in self._by_name.values():
            index, sub = section.place
            if index is None or _VALUES.fullmatch(section.name):
                continue
            if sub is None:
                self._parents[index] = section
                self.lines[index, 0] = section.line
            else:
                self._subs.setdefault(index, {})[sub] = section
                self.lines[index, sub] = section.line

    def clean(self) -> Iterator[str]:
        """The lines of a file with these objects and without flaws."""
        for index in sorted(self._parents.keys() | self._subs.keys()):
            subs = self._subs.get(index, {})
            parent = self._parents.get(index)
            kind = self._kind(index, parent, subs)
            if kind == _VAR:
                assert parent is not None
                yield from self._variable(parent, f"{index:04X}", index, 0)
                continue
            if parent is not None and not subs:
                subs = self._compact(parent, index)
            yield from (f"[{index:04X}]", "ParameterName=-", f"ObjectType=0x{kind:X}")
            for sub, section in sorted(subs.items()):
                yield from self._variable(section, f"{index:04X}sub{sub:X}", index, sub)

    def _compact(self, parent: _Section, index: int) -> dict[int, _Section]:
        """The sub-indices of an object that describes them all at once."""
        count = self._number(parent, "CompactSubObj", index, 0)
        if not count or not 0 < count < 0xFF:
            return {}
        line = parent.line_of("compactsubobj")
        number = {"datatype": "0x5", "accesstype": "ro", "defaultvalue": str(count)}
        found = {0: _Section(parent.name, line, {key: (one, line) for key, one in number.items()})}
        own = self._by_name.get(f"{parent.name}value")
        shared = {key: one for key, one in parent.values.items() if key != "objecttype"}
        for sub in range(1, count + 1):
            values = dict(shared)
            if own is not None and own.get(str(sub)):
                values["defaultvalue"] = own.values[str(sub)]
            found[sub] = _Section(parent.name, parent.line, values)
        return found

    def _kind(self, index: int, parent: _Section | None, subs: dict[int, _Section]) -> int:
        """Whether an object is a variable, an array or a record."""
        if parent is None:
            first = min(section.line for section in subs.values())
            self._flaw(first, f"[{index:04X}sub...] has no section [{index:04X}]", index)
            return _RECORD
        text = parent.get("objecttype")
        kind = eds_number(text) if text else (_RECORD if subs else _VAR)
        if kind in {_DOMAIN, _DEFTYPE}:
            kind = _VAR
        if kind == _DEFSTRUCT:
            kind = _RECORD
        if kind not in {_VAR, _ARRAY, _RECORD}:
            line = parent.line_of("objecttype")
            self._flaw(line, f"[{index:04X}] ObjectType = {shown(text)} is no type", index)
            return _RECORD if subs else _VAR
        if kind == _VAR and subs:
            line = parent.line_of("objecttype")
            self._flaw(line, f"[{index:04X}] is a variable, but has sub-indices", index)
            return _RECORD
        return kind

    def _variable(self, section: _Section, name: str, index: int, sub: int) -> Iterator[str]:
        """The lines of one variable; none if its type cannot be read."""
        kind = self._data_type(section, index, sub)
        if kind is None:
            return
        yield from (f"[{name}]", "ParameterName=-", f"ObjectType=0x{_VAR:X}", f"DataType={kind}")
        own = section.get("objecttype")
        if "sub" in section.name and own and eds_number(own) not in _KINDS:
            # a sub-index is a variable, whatever it says
            text = f"[{section.name}] ObjectType = {shown(own)} is no type"
            self._flaws.append(Flaw(section.line_of("objecttype"), text))
        access = section.get("accesstype").lower()
        if access not in _ACCESS:
            self._wrong(section, "AccessType", index, sub, f"must be {', '.join(_ACCESS)}")
            access = "rw"
        yield f"AccessType={access}"
        mapping = self._number(section, "PDOMapping", index, sub)
        if mapping is not None:
            yield f"PDOMapping={mapping}"
        for key in ("LowLimit", "HighLimit", "DefaultValue", "ParameterValue"):
            value = self._value(section, key, kind, index, sub)
            if value:
                yield f"{key}={value}"
        factor = section.get("factor")
        if factor:
            if _usable_factor(factor):
                yield f"Factor={factor}"
            else:
                self._wrong(section, "Factor", index, sub, "must be a finite number, and not 0")
        if section.get("unit"):
            yield f"Unit={section.get('unit')}"

    def _data_type(self, section: _Section, index: int, sub: int) -> int | None:
        if eds_number(section.get("objecttype") or "7") == _DOMAIN and not section.get("datatype"):
            return datatypes.DOMAIN
        kind = self._number(section, "DataType", index, sub)
        if kind is None or kind <= 0:
            if kind is not None or not section.get("datatype"):
                self._wrong(section, "DataType", index, sub, "must be the number of a type")
            return None
        if kind > _LARGEST_STANDARD_TYPE:  # a type of the maker, whose own object says what it is
            own = self._subs.get(kind, {}).get(1) or self._by_name.get(f"{kind:x}sub1")
            known = eds_number(own.get("defaultvalue")) if own else None
            kind = known if known and known <= _LARGEST_STANDARD_TYPE else datatypes.DOMAIN
        return kind

    def _value(self, section: _Section, key: str, kind: int, index: int, sub: int) -> str:
        """A value of the type of its object, as canopen can read it; empty if there is none."""
        text = section.get(key.lower())
        if not text or kind in _BYTES:
            return ""
        if kind in _TEXTS:
            return text if key.endswith("Value") else ""
        if kind in datatypes.FLOAT_TYPES:
            usable = _finite(text) or not key.endswith("Value")
            wrong = "" if usable else "must be a number"
        else:
            number = self._number(section, key, index, sub)
            usable = number is not None and -(1 << 63) <= number < 1 << 64
            wrong = "" if usable or number is None else "is larger than 64 bits"
            text = str(number)
        if wrong:
            self._wrong(section, key, index, sub, wrong)
        return text if usable else ""

    def _number(self, section: _Section, key: str, index: int, sub: int) -> int | None:
        text = section.get(key.lower())
        if not text:
            return None
        number = eds_number(text, self._node)
        if number is None:
            self._wrong(section, key, index, sub, "must be a whole number")
        return number

    def _wrong(self, section: _Section, key: str, index: int, sub: int, expected: str) -> None:
        text = section.get(key.lower())
        given = f" = {shown(text)}" if text else " is missing"
        what = f"[{section.name}] {key}{given}; {expected}"
        self._flaw(section.line_of(key.lower()), what, index, sub)

    def _flaw(self, line: int, text: str, index: int, sub: int | None = None) -> None:
        self._flaws.append(Flaw(line, text, index, sub))


def _finite(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _usable_factor(text: str) -> bool:
    return _finite(text) and float(text) != 0.0 and math.isfinite(1.0 / float(text))
