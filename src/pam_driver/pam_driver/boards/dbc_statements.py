"""The statements of a DBC file, each with its line and what it refers to."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

_WORDS: Final = (
    "BO_TX_BU_|BO_|SG_MUL_VAL_|SG_|CM_|BA_DEF_DEF_REL_|BA_DEF_DEF_|BA_DEF_REL_|BA_DEF_SGTYPE_"
    "|BA_DEF_|BA_REL_|BA_SGTYPE_|BA_|VAL_TABLE_|VAL_|SIG_VALTYPE_|SIG_GROUP_|SIG_TYPE_REF_"
    "|SIGTYPE_VALTYPE_|SGTYPE_VAL_|SGTYPE_|EV_DATA_|EV_|ENVVAR_DATA_|BU_SG_REL_|BU_EV_REL_"
    "|BU_BO_REL_|BU_|BS_|NS_DESC_|NS_|CAT_DEF_|CAT_|FILTER|VERSION"
)
_BEGIN: Final = re.compile(rf"[ \t]*({_WORDS})(?![A-Za-z0-9_])(.*)")
_MESSAGE: Final = re.compile(r"\s*BO_\s+(\S+)\s+(\w+)")
_SIGNAL: Final = re.compile(r"\s*SG_\s+(\w+)")
_REFERENCE: Final = re.compile(r'\s*\w+\s+(?:"[^"]*"\s*)?(?:SG_\s+|BO_\s+)?(\d+)\b\s*(\w+)?')
HEADINGS: Final = frozenset({"NS_", "NS_DESC_", "BS_", "FILTER"})
MEANING: Final = frozenset({"BO_", "SG_", "VAL_", "SIG_VALTYPE_", "SG_MUL_VAL_"})
"""The statements that say what is in a frame."""


@dataclass
class DbcStatement:
    """A statement of the file: its first word, its lines, and the message that it refers to."""

    kind: str
    line: int
    text: str
    frame: int | None = None
    message: str = ""
    signal: str = ""


def read_statements(text: str) -> Iterator[DbcStatement]:
    """The statements: each begins with a word of its own at the beginning of a line."""
    current: DbcStatement | None = None
    message = DbcStatement("", 0, "")
    listing = False  # the words under NS_
    for number, line in enumerate(text.split("\n"), 1):
        match = _BEGIN.match(line)
        if match is None:
            if current is None:
                current = DbcStatement("", number, line) if line.strip() else None
            else:
                current.text += f"\n{line}"
            continue
        alone = not match[2].strip(" \t:;")
        if alone and (listing or not message.kind or match[1] in HEADINGS):
            listing = match[1] != "BS_"
            continue
        listing = False
        if current is not None:
            yield current
        current = DbcStatement(match[1], number, line)
        if current.kind == "BO_":
            found = _MESSAGE.match(line)
            current.frame = _frame_id(found[1]) if found else None
            current.message = found[2] if found else ""
            message = current
        elif current.kind == "SG_":
            found = _SIGNAL.match(line)
            current.frame, current.message = message.frame, message.message
            current.signal = found[1] if found else ""
        elif found := _REFERENCE.match(line):
            current.frame = _frame_id(found[1])
            current.signal = found[2] or ""
        elif current.kind in MEANING:
            current.signal = next(iter(line.split()[2:3]), "")
    if current is not None:
        yield current


def _frame_id(text: str) -> int | None:
    return int(text) if text.isdecimal() and len(text) < 12 else None
