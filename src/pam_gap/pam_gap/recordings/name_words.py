"""The words in the name of a column, and what they say of its place in a table.

In a long table, each row is one sample of one signal: `time, signal, value`.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

_WORDS: Final[Mapping[str, frozenset[str]]] = {
    kind: frozenset(words.split())
    for kind, words in {
        "time": "time t stamp timestamp ts seconds sec secs elapsed zeit datetime date datum "
        "uhrzeit temps tempo tiempo",
        "rest of a time": "us usec ms msec ns nsec nanosec nanoseconds changed received",
        "unit": "unit units uom einheit unite unidad",
        "value": "value values val payload wert messwert valeur valor valore",
        "name": "signal signals topic name channel field measurement metric series tag variable "
        "sensor entity key path muscle joint actuator message msg kanal messgroesse canal id",
    }.items()
}
TIME_WORDS: Final = _WORDS["time"]
VALUE_WORD: Final = re.compile("|".join(_WORDS["value"]), re.IGNORECASE)
"""What the line of names of a long table contains."""
_MOST_COLUMNS: Final = 64
"""A table with more columns is no long one."""


def words_of(name: str) -> list[str]:
    """The words and numbers in a name: `elbowFlexor_p1[kPa]` has elbow, flexor, p, 1, kpa."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    apart = re.sub(r"([a-z])([A-Z])", r"\1 \2", plain)
    return [word.lower() for word in re.findall(r"[A-Za-z]+|\d+", apart)]


@dataclass(frozen=True, slots=True)
class Roles:
    """What the columns of a long table are, by their names."""

    time: tuple[str, ...]
    keys: tuple[str, ...]  # they name the signal
    values: tuple[str, ...]  # empty in a table with a column for each of several quantities
    unit: tuple[str, ...]
    rest: tuple[str, ...]


def roles_of(names: Sequence[str]) -> Roles | None:
    """What the columns of a table are if it may be a long one; None if it cannot be."""
    if len(names) > _MOST_COLUMNS:
        return None
    found: dict[str, list[str]] = {"time": [], "name": [], "value": [], "unit": [], "": []}
    for name in filter(None, names):
        words = frozenset(words_of(name))
        kinds = ("unit", "time", "rest of a time", "value", "name")
        kind = next((kind for kind in kinds if words & _WORDS[kind]), "")
        found["time" if kind == "rest of a time" else kind].append(name)
    time, keys, values, unit, rest = map(tuple, found.values())
    return Roles(time, keys, values, unit, rest) if time and keys and (values or rest) else None


def is_unit_word(text: str) -> bool:
    """Whether a text says that units stand beside it."""
    return text.lower().strip(" :") in _WORDS["unit"]


def names_a_long_table(cells: Sequence[str]) -> bool:
    """Whether a line has the names of a long table, whose rows may hold more text than numbers."""
    roles = roles_of(cells)
    return roles is not None and bool(roles.values)
