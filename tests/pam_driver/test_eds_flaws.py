"""One flaw in a good EDS file, of every sort and at every place, is told with its line.

Where the robot depends on it, it is an error; everywhere else the device can be used.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import pytest

from pam_driver.boards.canopen.device import CanopenDevice
from pam_driver.boards.canopen.dictionary import profile_path
from pam_driver.boards.canopen.reader import CanopenDeviceReader
from pam_driver.boards.protocol import WiredBoard
from pam_driver.boards.wiring import RigWiring
from pam_driver.tools.check_rig import check_rig
from pam_model.rig import Bus, load_rig
from support.canopen_device import ELBOW_CANOPEN

GOOD: Final = profile_path("cia406_encoder").read_text()
Lines = list[str]
Flaw = Callable[[Lines], tuple[Lines, int] | None]
"""From the lines of a section to those with a flaw, and the place of the flaw among them."""


def key_with(key: str, value: str) -> Flaw:
    """Another value under a key."""

    def change(lines: Lines) -> tuple[Lines, int] | None:
        for at, line in enumerate(lines):
            if line.startswith(f"{key}="):
                return [*lines[:at], f"{key}={value}", *lines[at + 1 :]], at
        return None

    return change


def without(key: str) -> Flaw:
    """A section in which a key is missing, told with the line of the section."""

    def change(lines: Lines) -> tuple[Lines, int] | None:
        left = [line for line in lines if not line.startswith(f"{key}=")]
        return None if len(left) == len(lines) else (left, 0)

    return change


def with_line(text: str, *, of_variable: bool = False) -> Flaw:
    """A further line; one of a variable where there is one."""

    def change(lines: Lines) -> tuple[Lines, int] | None:
        if of_variable and not any(line.startswith("DataType=") for line in lines):
            return None
        return [*lines, text], len(lines)

    return change


def doubled_with(key: str, value: str) -> Flaw:
    """A key that is there twice, with two values."""

    def change(lines: Lines) -> tuple[Lines, int] | None:
        has = any(line.startswith(f"{key}=") for line in lines)
        return ([*lines, f"{key}={value}"], len(lines)) if has else None

    return change


FLAWS: Final[dict[str, Flaw]] = {
    "text that wrapped": with_line("of the axis, see the manual"),
    "key without =": with_line("PDOMapping 1"),
    "type that is a word": key_with("DataType", "UNSIGNED32"),
    "type that is empty": key_with("DataType", ""),
    "type that is missing": without("DataType"),
    "type of 0": key_with("DataType", "0"),
    "type twice": doubled_with("DataType", "0x0002"),
    "access unknown": key_with("AccessType", "read"),
    "access missing": without("AccessType"),
    "access twice": doubled_with("AccessType", "wo"),
    "mapping that is a word": key_with("PDOMapping", "yes"),
    "default that is a word": key_with("DefaultValue", "see manual"),
    "default of 400 digits": key_with("DefaultValue", "9" * 400),
    "default twice": doubled_with("DefaultValue", "77"),
    "object type that is a word": key_with("ObjectType", "VAR"),
    "object type unknown": key_with("ObjectType", "0x55"),
    "limit that is a word": with_line("LowLimit=none", of_variable=True),
    "factor of 1e-320": with_line("Factor=1e-320", of_variable=True),
    "factor of 400 digits": with_line(f"Factor={'9' * 400}", of_variable=True),
    "factor with a comma": with_line("Factor=0,5", of_variable=True),
    "factor of 0": with_line("Factor=0", of_variable=True),
    "header without its end": lambda lines: ([lines[0][:-1], *lines[1:]], 0),
    "header with a rest": lambda lines: ([f"{lines[0]} old", *lines[1:]], 0),
    "section twice": lambda lines: ([*lines, lines[0]], len(lines)),
}
HARMLESS: Final[dict[str, Callable[[str], str]]] = {
    "keys in lower case": lambda text: re.sub(r"(?m)^\w+=", lambda m: m[0].lower(), text),
    "keys in upper case": lambda text: re.sub(r"(?m)^\w+=", lambda m: m[0].upper(), text),
    "sections in upper case": lambda text: re.sub(r"\[\w+\]", lambda m: m[0].upper(), text),
    "blanks around =": lambda text: text.replace("=", "  = "),
    "indented": lambda text: text.replace("\n", "\n    "),
    "Windows line ends": lambda text: text.replace("\n", "\r\n"),
    "comments": lambda text: text.replace("\n", " ; checked\n"),
    "no names": lambda text: re.sub(r"(?m)^ParameterName=.*\n", "", text),
    "empty names": lambda text: re.sub(r"(?m)^ParameterName=.*", "ParameterName=", text),
    "wrong counts": lambda text: re.sub(r"(?m)^SubNumber=.*", "SubNumber=77", text),
    "unknown keys": lambda text: re.sub(r"(?m)^(ObjectType=.*)", r"\1\nColour=blue", text),
    "no DeviceInfo": lambda text: text[text.index("[1000]") :],
    "every key twice": lambda text: re.sub(r"(?m)^(\w+=.*)", r"\1\n\1", text),
    "every section twice": lambda text: f"{text}\n{text}",
    "sections with 0x": lambda text: re.sub(r"\[([0-9A-F]{4})", r"[0x\1", text),
    "end of a file of DOS": lambda text: f"{text}\x1a",
    "octal numbers": lambda text: text.replace("DataType=0x0007", "DataType=007"),
}
OPTIONAL: Final = ("[1000]", "[1018]", "[1018sub1]", "[1018sub2]")
"""What only makes the identity of the device checked."""
LIKE_OTHERS: Final = re.compile(r"\[1801|\[1A0[01]sub[4-8]")
"""Sections that the driver reads as it reads those of PDO 1 and of its first three entries."""
ENCODINGS: Final = ("utf-8", "utf-8-sig", "cp1252", "gbk", "utf-16")


@pytest.fixture(scope="module")
def encoder() -> WiredBoard:
    return RigWiring(load_rig(ELBOW_CANOPEN)).boards["encoder"]


def read(encoder: WiredBoard, path: Path, data: str | bytes) -> CanopenDeviceReader:
    """The device of the rig with another EDS file."""
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    settings = {key: value for key, value in encoder.settings.items() if key != "profile"}
    return CanopenDeviceReader(replace(encoder, settings={**settings, "eds": str(path)}))


def sections() -> list[Lines]:
    return [part.rstrip("\n").split("\n") for part in re.split(r"(?m)^(?=\[)", GOOD) if part]


def joined(parts: list[Lines]) -> str:
    return "".join("\n".join(part) + "\n\n" for part in parts)


@pytest.fixture(scope="module")
def good(encoder: WiredBoard, tmp_path_factory: pytest.TempPathFactory) -> CanopenDevice:
    reader = read(encoder, tmp_path_factory.mktemp("good") / "dev.eds", joined(sections()))
    assert reader.device is not None
    assert not reader.problems
    assert not reader.doubts
    return reader.device


@pytest.fixture(scope="module")
def needed(
    encoder: WiredBoard, good: CanopenDevice, tmp_path_factory: pytest.TempPathFactory
) -> frozenset[int]:
    """The sections without which the device is another one, or cannot be used."""
    path = tmp_path_factory.mktemp("needed") / "dev.eds"
    parts = sections()
    found = set()
    for number in range(len(parts)):
        reader = read(encoder, path, joined([*parts[:number], *parts[number + 1 :]]))
        if reader.device != good:
            found.add(number)
    names = {parts[number][0] for number in found}
    assert {"[6004]", "[1017]", "[1800]", "[1800sub1]", "[1A00sub0]", "[1A00sub1]"} <= names
    assert "[1003sub1]" not in names
    assert "[6001]" not in names
    optional = {number for number in found if parts[number][0] in OPTIONAL}
    return frozenset(found - optional)


@pytest.mark.parametrize("flaw", FLAWS)
def test_a_flaw_is_told_with_its_line_where_it_matters_and_survived_elsewhere(
    flaw: str, encoder: WiredBoard, good: CanopenDevice, needed: frozenset[int], tmp_path: Path
) -> None:
    parts = sections()
    told = 0
    for number, part in enumerate(parts):
        if LIKE_OTHERS.match(part[0]):
            continue
        changed = FLAWS[flaw](part)
        if changed is None or (flaw == "header without its end" and not part[0].startswith("[")):
            continue
        lines, at = changed
        before = sum(len(one) + 1 for one in parts[:number])
        place = f"dev.eds: line {before + at + 1}: "
        reader = read(
            encoder, tmp_path / "dev.eds", joined([*parts[:number], lines, *parts[number + 1 :]])
        )
        shown = (part[0], reader.problems, reader.doubts)
        if number in needed and re.match(r"\[[0-9A-F]{4}", part[0]):
            if reader.device == good:  # a key that the driver does not read there
                continue
            assert any(place in line for line in reader.problems), shown
            told += 1
        else:
            assert not reader.problems, shown
            assert reader.device == good or part[0] in OPTIONAL, shown
            assert any(place in line for line in reader.doubts) or not _is_read(part, flaw), shown
    assert told > 3 or flaw in RARE


RARE: Final = {"limit that is a word", "default that is a word", "default of 400 digits"}


def _is_read(part: Lines, flaw: str) -> bool:
    """Whether the driver reads the flawed key in such a section: not those of other sections."""
    is_text = "DataType=0x0009" in part  # every value is right
    return ("header" in flaw) or (
        not is_text and re.match(r"\[[0-9A-F]{4}(sub|\])", part[0]) is not None
    )


@pytest.mark.parametrize("change", HARMLESS)
def test_what_loses_nothing_changes_nothing(
    change: str, encoder: WiredBoard, good: CanopenDevice, tmp_path: Path
) -> None:
    reader = read(encoder, tmp_path / "dev.eds", HARMLESS[change](GOOD))
    assert not reader.problems
    assert reader.device == good


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_every_usual_encoding_is_read(
    encoding: str, encoder: WiredBoard, good: CanopenDevice, tmp_path: Path
) -> None:
    name = (
        "绝对编码器"
        if encoding in {"gbk", "utf-8", "utf-8-sig", "utf-16"}
        else "Drehgeber für 360°"
    )
    text = GOOD.replace("Position value", name)
    reader = read(encoder, tmp_path / "dev.eds", text.encode(encoding))
    assert not reader.problems
    assert not reader.doubts
    assert reader.device == good


@pytest.mark.parametrize(
    ("before", "after", "doubt"),
    [
        ("Granularity=8", "Granularity=many", "granularity = 'many' is no number"),
        ("ProductNumber=0", "ProductNumber=", "productnumber = '' is no number"),
        ("VendorNumber=0", "VendorNumber=0012", "vendornumber = 0012 means 10 (octal)"),
        ("[1000]", "[Comments]\nLines=3\nLine1=x\n[1000]", "Lines = '3', but there are 1"),
        ("[1000]", "[DummyUsage]\nDummy0001=0\n[1000]", "[DummyUsage] has no Dummy0002, "),
        ("[1000]", "[2022sub0]\nDataType=5\nAccessType=ro\n[1000]", "has no section [2022]"),
    ],
)
def test_a_flaw_in_what_nobody_uses_is_a_caution(
    before: str, after: str, doubt: str, encoder: WiredBoard, good: CanopenDevice, tmp_path: Path
) -> None:
    text = GOOD.replace(before, after)
    flawed = after.split("\n")[1 if "Comments" in after else 0]
    line = 1 + text.split("\n").index(flawed)
    reader = read(encoder, tmp_path / "dev.eds", text)
    assert not reader.problems
    assert reader.device == good
    assert any(f"dev.eds: line {line}: " in told and doubt in told for told in reader.doubts)


def test_the_check_of_a_rig_and_the_driver_tell_a_flaw_that_nobody_needs(tmp_path: Path) -> None:
    path = tmp_path / "dev.eds"
    path.write_text(GOOD.replace("ProductNumber=0", "ProductNumber="))
    rig = load_rig(ELBOW_CANOPEN)
    boards = {name: dict(section) for name, section in rig.boards.items()}
    boards["encoder"].pop("profile")
    boards["encoder"]["eds"] = str(path)
    rig = replace(rig, boards=boards)
    (doubt,) = RigWiring(rig).doubts
    assert doubt.startswith("boards.encoder.eds = dev.eds: line 12: [DeviceInfo] productnumber")
    assert doubt in check_rig(rig, Bus(), 500.0).cautions
