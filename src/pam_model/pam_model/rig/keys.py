"""How a key of a rig file is declared, and a reader that collects all problems.

A number is declared by a `Key` at the field that holds it (`types`, `people`, `wiring`).
"""

from __future__ import annotations

import math
import re
from array import array
from collections.abc import Collection, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, replace
from difflib import get_close_matches
from functools import cache
from typing import Any, get_type_hints

from pam_model.unit_hints import units_that_fit
from pam_model.within_limits import beyond

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
"""A name in a rig file."""
# YAML 1.1 reads 2e-05, without a point, as text; ROS reads it as a number
_EXPONENT = re.compile(r"[-+]?\d+(\.\d*)?[eE][-+]?\d+")


BETWEEN = "between"
"""Key of a range in place of a number, in a rig file that is to be calibrated."""
FOUND = "; `pam gap calibrate` finds it from a recording"


@dataclass(frozen=True, slots=True)
class Key:
    """A number in a rig file: its unit, bounds, and its default if it is optional.

    A number that is `by_size` may be left out as well: it then follows from the rest of the rig.
    `text` says what it means, in one line. `guess` is where a calibration begins that finds the
    number from a recording; None for a number that no recording determines. One that `is_measured`
    must be written, but a calibration corrects it within its range.
    """

    unit: str
    low: float
    high: float
    default: float | None = None
    by_size: bool = False
    text: str = ""
    guess: float | None = None
    is_measured: bool = False

    @property
    def may_be_range(self) -> bool:
        """Whether a rig file that is to be calibrated may have a range in place of the number."""
        return self.is_measured or self.guess is not None


@cache
def keys_of(part: type[Any]) -> Mapping[str, Key]:
    """The numbers that a data class has in a rig file, by the names of their fields.

    Such a field is annotated with its `Key`; its default is that of the key.
    """
    found = {}
    defaults = {one.name: one.default for one in fields(part) if one.default is not MISSING}
    for name, hint in get_type_hints(part, include_extras=True).items():
        for key in getattr(hint, "__metadata__", ()):
            default = None if key.by_size else defaults.get(name)
            found[name] = replace(key, default=default)
    return found


def _looks_like(value: float, key: Key) -> str:
    """The hint which unit a value out of bounds seems to have; "" if there is none."""
    if key.unit == "K" and key.low <= value + 273.15 <= key.high:
        return "; looks like deg C"
    units = [name for name, _ in units_that_fit(value, key.unit, key.low, key.high)]
    own = key.unit.removesuffix(" gauge").removesuffix(" absolute")
    return f"; looks like {' or '.join(units)}, {own} expected" if units else ""


def _plain(tree: Any) -> Any:
    """A section with lists in place of the arrays that ROS makes of lists of numbers."""
    if isinstance(tree, Mapping):
        return {key: _plain(value) for key, value in tree.items()}
    return list(tree) if isinstance(tree, array) else tree


class Problems:
    """All problems of one file; without a `source`, the lines begin with the key.

    `doubts` are lines about what is odd, although the file can be used.
    """

    def __init__(self, source: str) -> None:
        self.source = source
        self.lines: list[str] = []
        self.doubts: list[str] = []

    def add(self, key: str, text: str) -> None:
        """Add a problem with a key of the file; `text` follows the key."""
        source = f"{self.source}: " if self.source else ""
        self.lines.append(f"{source}{key}{text}")


def _slip(value: object) -> str:
    """What is wrong with a text that looks like a number."""
    if isinstance(value, str) and re.fullmatch(r"[-+]?\d+,\d+", value):
        return f", with a decimal point: {value.replace(',', '.')}"
    if isinstance(value, str) and re.fullmatch(r"[-+]?\d*\.?\d+", value):
        return f", without quotes: {value}"
    return ""


class Section:
    """One mapping of the file, read key by key; keys that were not read are unknown keys."""

    def __init__(self, tree: Any, path: str, problems: Problems) -> None:
        self.path = path
        self.problems = problems
        if not isinstance(tree, Mapping):
            problems.add(path, f" = {tree!r}: must be a mapping of keys")
            tree = {}
        self.tree = tree
        self.asked: list[str] = []

    def key(self, name: str) -> str:
        """The full key of `name` in the file."""
        return f"{self.path}.{name}" if self.path else name

    def add(self, name: str, text: str) -> None:
        """Add a problem with the key `name`; `text` follows the key."""
        self.problems.add(self.key(name), text)

    def doubt(self, name: str, text: str) -> None:
        """Add a doubt about the key `name`; `text` follows the key."""
        self.problems.doubts.append(f"{self.key(name)}{text}")

    def get(self, name: str) -> Any:
        """The value of a key, or None if the key is missing."""
        self.asked.append(name)
        return self.tree.get(name)

    def section(self, name: str) -> Section:
        """The mapping under a key, empty if the key is missing."""
        tree = self.get(name)
        return Section({} if tree is None else tree, self.key(name), self.problems)

    def check(self, name: str, value: Any, key: Key) -> float | None:
        """A value as a number within its bounds; else None, and a problem is added."""
        if isinstance(value, str) and _EXPONENT.fullmatch(value):
            value = float(value)
        unit = "" if key.unit == "-" else f" {key.unit}"
        if isinstance(value, Mapping) and BETWEEN in value:
            self.add(
                name,
                f": a range, where a number{unit and ' in' + unit} is needed"
                f"{FOUND if key.may_be_range else ''}",
            )
            return None
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.add(name, f" = {value!r}: must be a number{unit and ' in' + unit}{_slip(value)}")
            return None
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self.add(name, f" = {number}{unit}: must be a finite number")
            return None
        if not key.low <= number <= key.high:
            told, low, high = beyond(number, key.low, key.high)
            text = f" = {told}{unit}: must be from {low} to {high}{unit}"
            self.add(name, text + _looks_like(number, key))
            return None
        return number

    def number(self, name: str, key: Key, *, optional: bool = False) -> float | None:
        """The number under a key or its default; else None, and a problem is added."""
        value = self.get(name)
        if value is None:
            if key.default is None and not (optional or key.by_size):
                unit = "" if key.unit == "-" else f" in {key.unit}"
                found = "" if key.guess is None else FOUND
                self.add(name, f": missing; a number{unit} is needed{found}")
            return key.default
        return self.check(name, value, key)

    def place(self, name: str, default: int | None = None) -> int | str | None:
        """A board or channel: an integer from 0 on, or a name; else None, with a problem added."""
        value = self.get(name)
        if value is None:
            return default
        if isinstance(value, str) and NAME.fullmatch(value):
            return value
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            self.add(name, f" = {value!r}: must be a whole number from 0 on, or a name")
            return None
        return value

    def named_sections(self) -> dict[str, dict[str, Any]]:
        """Every key as a section whose keys are read elsewhere; a problem for every other value."""
        found: dict[str, dict[str, Any]] = {}
        for name, tree in self.tree.items():
            if not isinstance(name, str) or not NAME.fullmatch(name):
                self.add(str(name), ": is not a name (letters, digits and _, a letter first)")
            elif not isinstance(tree, Mapping) or not isinstance(tree.get("kind"), str):
                self.add(name, f" = {tree!r}: must be a section with the key kind, a text")
            else:
                found[name] = _plain(tree)
        return found

    def flag(self, name: str) -> bool:
        """True or false, by default false; a problem is added for every other value."""
        value = self.get(name)
        if value is not None and not isinstance(value, bool):
            self.add(name, f" = {value!r}: must be true or false")
        return value is True

    def names(self, name: str) -> list[str] | None:
        """A list of names; else None, and a problem is added."""
        value = self.get(name)
        if isinstance(value, str) or not isinstance(value, Sequence):
            what = ": missing" if value is None else f" = {value!r}"
            self.add(name, f"{what}; must be a list of names, as [a, b]")
            return None
        for entry in value:
            if not isinstance(entry, str) or not NAME.fullmatch(entry):
                self.add(name, f": {entry!r} is not a name (letters, digits and _, a letter first)")
                return None
        return [str(entry) for entry in value]

    def finish(self, allowed: Collection[str] = ()) -> None:
        """Add a problem for every key that was not read and is not `allowed`."""
        known = [*self.asked, *allowed]
        for name in self.tree:
            if name not in known:
                close = get_close_matches(str(name), known, 1)
                hint = f"; did you mean {close[0]}?" if close else ""
                is_section = not self.path and isinstance(self.tree[name], Mapping)
                what = ": no joint or muscle has this name" if is_section else ": unknown key"
                self.add(str(name), what + hint)
