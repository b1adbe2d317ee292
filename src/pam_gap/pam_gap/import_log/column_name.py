"""What the name of a column says: its words, its unit, and its number among columns of one kind."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

import numpy as np

from pam_gap.recordings.name_words import TIME_WORDS, words_of
from pam_gap.recordings.recording import COMMANDS, PRESSURES, SUPPLY, Array
from pam_gap.recordings.table_layout import is_absolute, is_pressure_with_zero, unit_spelt
from pam_model.unit_hints import RECORDED

WORDS: Final[Mapping[str, frozenset[str]]] = {
    kind: frozenset(words.split())
    for kind, words in {
        "time": " ".join(TIME_WORDS),
        PRESSURES: "pressure pressures press p pres druck pression pressione presion",
        COMMANDS: "command commands cmd valve u input action ventil commande comando vanne valvola "
        "valvula",
        ".position": "angle position pos q theta phi joint encoder winkel angolo angulo",
        "length": "length len position pos displacement distance stroke laser x",
        ".effort": "force load cell effort torque f",
        SUPPLY: "supply tank source",
    }.items()
}
"""Words that suggest a kind of channel; accents are left out."""
DERIVED: Final = frozenset([
    "mean", "avg", "average", "diff", "difference", "delta", "dp", "dot", "rate", "deriv",
    "derivative", "error", "err", "sum", "total", "ratio", "std", "var", "rms", "velocity", "vel",
    "speed", "acceleration", "acc", "jerk", "current", "temperature", "temp",
])  # fmt: skip
"""Words of what is computed of several channels or is another quantity."""
_UNIT_WORDS: Final = {
    "deg": "deg", "degree": "deg", "degrees": "deg", "mrad": "mrad", "bar": "bar", "kpa": "kPa",
    "mpa": "MPa", "psi": "psi", "mbar": "mbar", "ms": "ms", "us": "us", "ns": "ns", "mm": "mm",
    "cm": "cm", "kn": "kN", "mn": "mN", "percent": "per cent", "pct": "per cent",
}  # fmt: skip
_BRACKET: Final = re.compile(r"(\[[^\]]*\]|\([^()]*(\([^()]*\))?\))\s*$")
_BEHIND: Final = re.compile(r"[A-Za-z]+ ?\([A-Za-z]+\)\s*$")
"""The last word of a name with brackets behind it, as in `p1 bar(a)`."""
_ABSOLUTE: Final = frozenset(["abs", "absolute"])
_COUNTS: Final = frozenset(
    ["raw", "adc", "counts", "count", "ticks", "lsb", "digits", "encoder", "enc", "pwm", "duty"]
)
"""Words of a column that holds steps of a converter or an encoder, if it holds whole numbers."""
_VOLTS: Final = re.compile(r"[\s_.-](mA|mV|V|[Vv]olts?)$")
"""The unit of a raw signal at the end of a name, as in `valve1_V`."""
_NUMBER: Final = r"\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?"
_MULTIPLE: Final = re.compile(
    rf"[x×*]?\s*{_NUMBER}\s*[x×*]?\s*([^\W\d_]+|°|%)|([^\W\d_]+|°|%)\s*[x×*/]\s*{_NUMBER}"
)
"""A multiple of a unit, as `0.1 ms` or `kPa x10`."""
_TENS: Final = re.compile(r"(?<![A-Za-z\d.])(?:10+|0\.0*1)([A-Za-z]+)")
"""A multiple in a name, as in `time_10us`."""
_OTHER_LETTER: Final = str.maketrans("aAbB", "bBaA")
_LONGEST_UNIT: Final = 5
"""Characters of an unknown unit; a longer word in brackets is a remark."""
_OTHER: Final = "another unit"
"""The unit of a column that has one which no channel has."""


class ColumnName:
    """What the name of a column says, found once for all channels.

    Attributes
    ----------
    name : str
        The column.
    words : frozenset of str
        The words and numbers in it.
    unit : str
        The unit in brackets, in a word, or below the name; empty where none is stated.
    place : int or None
        Its number, from 1, if the columns are numbered from 0 or by letters: 1 and 2 of `valve.0`
        and `valve.1`, or of `p_a` and `p_b`.
    absolute : bool
        Whether the unit is that of an absolute pressure.
    """

    def __init__(self, name: str, below: str, columns: Mapping[str, Array]) -> None:
        self.name = name
        self.place = _place(name, columns)
        parts = name.split(".")
        own = [part for part in parts[:-1] if not part.isdigit()]  # a run has a number of its own
        listed = words_of(".".join([*own, parts[-1]]))
        self.words = frozenset(listed)
        bracket = _BEHIND.search(name)
        if bracket is None or not is_pressure_with_zero(bracket[0]):
            bracket = _BRACKET.search(name)
        if bracket and _is_index(name, bracket, columns):
            bracket = None
        in_bracket = _bracketed(bracket[0].strip()) if bracket else ""
        if bracket and in_bracket:  # the number in cm² is none of the column
            numbers = set(filter(str.isdigit, words_of(bracket[0])))
            self.words -= numbers - set(words_of(name[: bracket.start()]))
        whole = [word.lower() for word in re.findall(r"[A-Za-z]+", name)]  # kPa is one word
        parts = [*listed, *whole]
        in_words = next(filter(None, map(_unit_of_word, reversed(parts))), "")
        if _VOLTS.search(name) or any(map(_unit_of_word, _TENS.findall(name.lower()))):
            in_words = _OTHER
        self.unit = in_bracket or in_words or unit_spelt(below) or ""
        stated = [bracket[0] if bracket else below, *whole]
        self.absolute = not _ABSOLUTE.isdisjoint(listed) or any(map(is_absolute, stated))
        if not self.unit and self.words & _COUNTS and _are_whole(columns[name]):
            self.unit = _OTHER

    def is_of(self, expected: str) -> bool:
        """Whether the stated unit, if any, is one of a quantity."""
        known = dict(RECORDED.get(expected, ()))
        return not self.unit or self.unit in known or self.unit == expected.split(maxsplit=1)[0]


def _unit_of_word(word: str) -> str:
    """The unit that a word of a name is, as `kpa` or `psia`; empty for another word."""
    return _UNIT_WORDS.get(word) or (unit_spelt(word) if is_pressure_with_zero(word) else "") or ""


def with_another_unit(columns: Mapping[str, Array], units: Mapping[str, str]) -> list[str]:
    """The columns with the unit of no channel, or with steps of a converter or an encoder."""
    known = {name for own in RECORDED.values() for name, _ in own}
    known |= {unit.split(maxsplit=1)[0] for unit in RECORDED} | {""}
    return [n for n in columns if ColumnName(n, units.get(n, ""), columns).unit not in known]


def _bracketed(text: str) -> str:
    """The unit in the brackets behind a name; empty for a remark or a number."""
    if spelt := unit_spelt(text):
        return spelt
    inside = text[1:-1].strip()
    multiple = _MULTIPLE.fullmatch(inside)
    if multiple and unit_spelt(multiple[1] or multiple[2]):
        return _OTHER
    is_short = text[0] == "[" and len(inside) <= _LONGEST_UNIT
    looks_like_a_unit = is_short or "/" in inside or inside.endswith("V")
    return _OTHER if looks_like_a_unit and inside and not inside.isdigit() else ""


def _is_index(name: str, bracket: re.Match[str], columns: Mapping[str, Array]) -> bool:
    """Whether a 1 in brackets, which may be a unit, counts columns, as in `p[0]` and `p[1]`."""
    others = (name[: bracket.start()] + bracket[0].replace("1", other) for other in "02")
    return bracket[0].strip()[1:-1] == "1" and any(other in columns for other in others)


def _place(name: str, columns: Mapping[str, Array]) -> int | None:
    stem = re.sub(r"\s*[\[(][^\])]*[^\W\d][^\])]*[\])]\s*$", "", name)  # without the unit
    found = list(re.finditer(r"\d+", stem))
    if not found:
        letter = re.search(r"(?<![^\W_])[aAbB](?=[\W_]*$)", stem)
        if letter is None:
            return None
        begin, end = letter.span()
        other = f"{name[:begin]}{letter[0].translate(_OTHER_LETTER)}{name[end:]}"
        return 1 + (letter[0] in "bB") if other in columns else None
    begin, end = found[-1].span()
    zero = f"{name[:begin]}{'0' * (end - begin)}{name[end:]}"
    return int(found[-1][0]) + 1 if zero in columns else None


def _are_whole(values: Array) -> bool:
    finite = values[np.isfinite(values)]
    return bool(np.all(finite == np.round(finite)))
