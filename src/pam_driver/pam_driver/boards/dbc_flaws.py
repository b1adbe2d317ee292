"""What is wrong in a DBC file that cantools reads: contradictions, and absurd numbers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from pam_driver.boards.dbc_statements import DbcStatement
from pam_ros.foreign_text import shown

# ISO 15765-2 carries up to 4095 bytes in several frames; cantools needs for ever for a typing
# mistake of some more digits.
_LONGEST: Final = 4096
_LENGTH: Final = re.compile(r"\bBO_\s+\d+\s+(\w+)\s*:\s*(\d+)")
_BITS: Final = re.compile(r"\bSG_\s+(\w+)[^:]*:\s*(\d+)\s*\|\s*(\d+)")
_SELECTORS: Final = re.compile(r"(\d+)\s*-\s*(\d+)")
_STANDARD, _EXTENDED, _FLAG = 0x7FF, 0x1FFF_FFFF, 1 << 31
"""The largest identifiers of 11 and 29 bits, and what is added to the latter in a DBC file."""
_TYPE: Final = re.compile(r"\s*SIG_VALTYPE_\s+\d+\s+\w+\s*:?\s*(\d+)\s*;")
_BITS_OF_TYPE: Final = {"1": 32, "2": 64}


@dataclass(frozen=True, slots=True)
class DbcFlaw:
    """Something that is wrong in a line.

    It makes a signal of some messages doubtful, all their signals if `signal` is empty. If it
    `begins` a message or signal, the name may not be what the maker meant.
    """

    line: int
    text: str
    messages: frozenset[str] = frozenset()
    signal: str = ""
    begins: bool = False

    def concerns(self, message: object, signal: object) -> bool:
        """Whether it makes a signal doubtful."""
        return message in self.messages and self.signal in {"", signal}

    def __str__(self) -> str:
        return f"line {self.line}: {self.text}"


def contradictions(
    statements: Iterable[DbcStatement], lines: dict[tuple[str, str], int]
) -> Iterator[DbcFlaw]:
    """What contradicts something else; `lines` gets where each message and signal begins."""
    statements = list(statements)
    yield from _twice(statements, lines)
    yield from _other_lengths(statements)


def _twice(
    statements: Iterable[DbcStatement], lines: dict[tuple[str, str], int]
) -> Iterator[DbcFlaw]:
    """Messages and signals that are described twice; `lines` gets where each begins."""
    frames: dict[int, DbcStatement] = {}
    for one in statements:
        if one.kind == "BO_" and one.frame is not None:
            other = frames.setdefault(one.frame, one)
            if other.message != one.message:
                text = f"identifier {one.frame} is that of message {shown(other.message)} in line "
                both = frozenset({one.message, other.message})
                yield DbcFlaw(one.line, f"{text}{other.line}", both)
        if one.kind not in {"BO_", "SG_"} or (one.kind == "SG_" and not one.signal):
            continue
        first = lines.setdefault((one.message, one.signal), one.line)
        if first != one.line:
            what = "signal" if one.signal else "message"
            name = f"{one.message}.{one.signal}" if one.signal else one.message
            text = f"{what} {shown(name)} is there twice, first in line {first}"
            yield DbcFlaw(one.line, text, frozenset({one.message}), one.signal)


def _other_lengths(statements: Iterable[DbcStatement]) -> Iterator[DbcFlaw]:
    """Signals whose number of bits is not that of their type."""
    known: dict[tuple[int | None, str], tuple[DbcStatement, str]] = {}
    for one in statements:
        if one.kind == "SG_" and (found := _BITS.search(one.text)):
            known[one.frame, one.signal] = one, found[3]
    for one in statements:
        place = one.frame, one.signal
        stated = _TYPE.match(one.text) if one.kind == "SIG_VALTYPE_" else None
        if stated is None or place not in known or stated[1].strip("0") == "":
            continue
        signal, bits = known[place]
        wanted = _BITS_OF_TYPE.get(stated[1])
        if wanted is None:
            text = (
                f"the type of signal {shown(one.signal)} is {shown(stated[1])}; expected 0, 1 or 2"
            )
        elif bits != str(wanted):
            text = (
                f"signal {shown(one.signal)} is a float of {wanted} bits, but has {bits} bits in "
                f"line {signal.line}"
            )
        else:
            continue
        yield DbcFlaw(one.line, text, frozenset({signal.message}), one.signal)


def absurd(statement: DbcStatement) -> str:
    """What is wrong with the size of something; empty if nothing is."""
    if statement.kind == "BO_":
        number = statement.frame
        if number is not None and _STANDARD < number <= _EXTENDED:
            return (
                f"identifier {number} has more than 11 bits; one of 29 bits is written with "
                f"{_FLAG} added, as {number + _FLAG}"
            )
        for name, length in _LENGTH.findall(statement.text):
            if _exceeds(length, _LONGEST):
                return f"message {name} has {shown(length)[1:-1]} bytes, which no frame has"
    if statement.kind == "SG_":
        for name, *numbers in _BITS.findall(statement.text):
            for bits in numbers:
                if _exceeds(bits, 8 * _LONGEST):
                    return f"signal {name} has {shown(bits)[1:-1]} bits or begins there"
    if statement.kind == "SG_MUL_VAL_":
        for low, high in _SELECTORS.findall(statement.text):
            if _exceeds(high, 1 << 63) or int(high) - int(low) > 0xFFFF:
                return f"too many values of a selector: {shown(f'{low}-{high}')}"
    return ""


def _exceeds(digits: str, limit: int) -> bool:
    """Whether a number is above a limit; it may have more digits than Python converts."""
    return len(digits.lstrip("0")) > len(str(limit)) or int(digits) > limit
