"""Reads a DBC file with cantools, tolerantly: an error makes only its own line unusable.

cantools refuses a file as a whole. If it does, the file is cut into its statements, every statement
is read with no more than it refers to, and those that can be read make up the file.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Final, NamedTuple

import cantools
from cantools.database import Database

from pam_driver.boards.dbc_flaws import DbcFlaw, absurd, contradictions
from pam_driver.boards.dbc_statements import HEADINGS, MEANING, DbcStatement, read_statements
from pam_driver.boards.frame_errors import DbcError
from pam_driver.boards.maker_file import read_maker_file
from pam_ros.foreign_text import shown

logging.getLogger("cantools").setLevel(logging.ERROR)  # what it warns of is a flaw here
_ATTRIBUTE: Final = re.compile(r'\s*BA_(?:DEF_DEF_|DEF_)?\s*[A-Z_]*\s*"([^"]*)"')
_DEFINITIONS: Final = frozenset({"BA_DEF_", "BA_DEF_DEF_", "BA_DEF_REL_", "BA_DEF_DEF_REL_"})
_FRAME_FORMAT: Final = "VFrameFormat"


class DbcContent(NamedTuple):
    """The messages of a file, the line of each message and signal, and what is wrong."""

    database: Database
    lines: dict[tuple[str, str], int]
    flaws: list[DbcFlaw]


def load_dbc(path: Path, max_bytes: int) -> Database:
    """The messages of a DBC file without a flaw.

    Parameters
    ----------
    max_bytes : int
        Largest size that is read.

    Raises
    ------
    DbcError
        If the file cannot be read, is too large, is no DBC file, or has a message that is longer
        than its frame or has signals that overlap.
    """
    content = read_dbc(path, max_bytes)
    if content.flaws:
        raise DbcError(f"{path}: not a valid DBC file: {content.flaws[0]}")
    try:
        for message in content.database.messages:
            message.refresh(strict=True)
    except Exception as error:
        raise DbcError(f"{path}: not a valid DBC file: {_reason(error)}") from error
    return content.database


def read_dbc(path: Path, max_bytes: int) -> DbcContent:
    """The messages of a DBC file, without those that cannot be read.

    Only `Message.refresh(strict=True)` finds that signals overlap, message by message.

    Parameters
    ----------
    max_bytes : int
        Largest size that is read.

    Raises
    ------
    DbcError
        If the file cannot be read, is too large, or describes no message.
    """
    text = read_maker_file(path, max_bytes, "a board's DBC", DbcError)
    statements = list(read_statements(text))
    if not any(one.kind == "BO_" for one in statements):
        raise DbcError(f"{path}: not a valid DBC file: it describes no message (BO_)")
    lines: dict[tuple[str, str], int] = {}
    flaws = list(contradictions(statements, lines))
    if not any(map(absurd, statements)):
        try:
            return DbcContent(_loaded(text), lines, flaws)
        except Exception:  # cantools raises whatever its parser meets
            pass
    reader = _Reader(statements)
    try:
        database = _loaded(reader.clean())
    except Exception as error:
        raise DbcError(f"{path}: not a valid DBC file: {_reason(error)}") from error
    flaws = sorted([*flaws, *reader.flaws], key=lambda flaw: flaw.line)
    return DbcContent(database, lines, flaws)


def _loaded(text: str) -> Database:
    # without something behind it, cantools passes over a last statement that is cut off
    database = cantools.database.load_string(f"{text}\nBS_:\n", "dbc", strict=False)
    if not isinstance(database, Database):
        raise ValueError("not a CAN database")
    return database


def _reason(error: Exception) -> str:
    return shown(" ".join(str(error).split()) or type(error).__name__)


@dataclass
class _Message:
    """The statements of one message that can be read."""

    head: DbcStatement
    signals: list[DbcStatement] = field(default_factory=list)
    further: list[DbcStatement] = field(default_factory=list)

    def text(self) -> str:
        return "\n".join(one.text for one in (self.head, *self.signals))


class _Reader:
    """Sorts the statements that can be read from those that cannot, which become `flaws`."""

    def __init__(self, statements: Iterable[DbcStatement]) -> None:
        self.flaws: list[DbcFlaw] = []
        self._defined: dict[str, list[DbcStatement]] = {}
        self._messages: dict[int, _Message] = {}
        self._others: list[DbcStatement] = []
        statements = list(statements)
        self._names = {(one.frame, one.signal) for one in statements if one.kind == "SG_"}
        for one in statements:
            if one.kind in _DEFINITIONS:
                self._define(one)
            elif one.kind == "BO_":
                self._begin(one)
        for one in statements:
            if one.kind == "SG_":
                self._add_signal(one)
        for one in statements:
            if one.kind not in {*_DEFINITIONS, *HEADINGS, "BO_", "SG_"}:
                self._add(one)

    def clean(self) -> str:
        """The file without its flaws; a message that cannot be read as a whole is left out."""
        parts = ['VERSION ""', "BS_:", "BU_:"]
        parts += [one.text for found in self._defined.values() for one in found]
        further = []
        for message in self._messages.values():
            attributes = [text for one in message.further for text in self._definition(one)]
            own = [one.text for one in message.further]
            if self._reads(message.head, "\n".join([*attributes, message.text(), *own])):
                parts.append(message.text())
                further += own
        return "\n".join([*parts, *further, *(one.text for one in self._others), ""])

    def _define(self, one: DbcStatement) -> None:
        name = _ATTRIBUTE.match(one.text)
        known = [text.text for text in self._defined.get(name[1] if name else "", ())]
        if self._reads(one, "\n".join(["BS_:", *known, one.text])):
            self._defined.setdefault(name[1] if name else "", []).append(one)

    def _begin(self, one: DbcStatement) -> None:
        if self._reads(one, one.text) and one.frame is not None:
            self._messages.setdefault(one.frame, _Message(one))

    def _add_signal(self, one: DbcStatement) -> None:
        message = None if one.frame is None else self._messages.get(one.frame)
        if message is None:
            text = f"signal {shown(one.signal)} belongs to no message that can be read"
            messages = frozenset({one.message})
            self.flaws.append(DbcFlaw(one.line, text, messages, one.signal))
        elif self._reads(one, f"{message.head.text}\n{one.text}") and all(
            known.signal != one.signal for known in message.signals
        ):
            message.signals.append(one)

    def _add(self, one: DbcStatement) -> None:
        """A statement about a message, or about the whole file."""
        message = None if one.frame is None else self._messages.get(one.frame)
        before = self._definition(one)
        name = _ATTRIBUTE.match(one.text)
        if one.kind == "BA_" and name and not before:
            self._flaw(one, one.line, f"attribute {shown(name[1])} has no definition (BA_DEF_)")
            return
        if message is not None:
            one.message = message.head.message
            before = [*before, message.text()]
        if self._reads(one, "\n".join(["BS_:", *before, one.text])):
            (self._others if message is None else message.further).append(one)

    def _definition(self, one: DbcStatement) -> list[str]:
        """The definition of the attribute that a statement sets."""
        name = _ATTRIBUTE.match(one.text) if one.kind == "BA_" else None
        return [known.text for known in self._defined.get(name[1], ())] if name else []

    def _reads(self, one: DbcStatement, text: str) -> bool:
        """Whether a statement can be read with what it refers to; else it becomes a flaw.

        What follows a statement in lines of their own is left out if it can be read without.
        """
        reason = absurd(one)
        if not reason:
            reason = _why_not(text)
            if reason and "\n" in one.text.strip():
                kept = _first_part(one.text)
                shorter = f"{text.removesuffix(one.text)}{kept}"
                if text.endswith(one.text) and not _why_not(shorter):
                    rest = one.text[len(kept) :]
                    blank = rest[: len(rest) - len(rest.lstrip())]
                    line = one.line + (kept + blank).count("\n")
                    self._flaw(one, line, f"{shown(rest.strip())} is not understood")
                    one.text = kept
                    return True
        if reason:
            self._flaw(one, one.line, reason)
        return not reason

    def _flaw(self, one: DbcStatement, line: int, text: str) -> None:
        matters = one.kind in MEANING or (one.kind == "BA_" and _FRAME_FORMAT in one.text)
        if matters:
            begins = one.kind in {"BO_", "SG_"}
            messages = frozenset({one.message}) if one.message else self._candidates(one)
            self.flaws.append(DbcFlaw(line, text, messages, self._signal(one), begins))
        else:
            self.flaws.append(DbcFlaw(line, text))

    def _signal(self, one: DbcStatement) -> str:
        """The signal that a statement makes doubtful; empty if its name may be cut or misspelt.

        Labels of a signal that does not exist are ignored.
        """
        if one.kind in {"BO_", "SG_"} or one.frame is None:
            return one.signal
        known = (one.frame, one.signal) in self._names
        is_whole = one.text.rstrip().endswith(";")
        return one.signal if known or (one.kind == "VAL_" and is_whole) else ""

    def _candidates(self, one: DbcStatement) -> frozenset[str]:
        """The messages that a statement may be about if its identifier cannot be read."""
        if one.kind in {"BO_", "SG_"} or (one.frame is not None and one.signal):
            return frozenset()
        word = one.text.split()[1:2]
        begun = word[0] if word and word[0].isdecimal() else ""
        return frozenset(
            message.head.message
            for frame, message in self._messages.items()
            if str(frame).startswith(begun)
        )


def _first_part(text: str) -> str:
    """The beginning of a statement up to its semicolon, or its first line."""
    lines = text.split("\n")
    for number, line in enumerate(lines, 1):
        if line.rstrip().endswith(";"):
            return "\n".join(lines[:number])
    return lines[0]


@lru_cache(maxsize=4096)  # of two versions of a file, most statements are the same
def _why_not(text: str) -> str:
    """Why cantools cannot read a text; empty if it can."""
    try:
        _loaded(text)
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        marked = re.search(r'column \d+: "(.*)"', reason)
        if marked:
            return f"{shown(marked[1].rstrip(chr(34)))} is not understood at >>!<<"
        return f"cannot be read: {shown(reason)}"
    return ""
