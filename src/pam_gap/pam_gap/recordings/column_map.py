"""A map from the columns of any table to the channels of the rig contract, with their units.

The map is a YAML file. For each channel it names the column and, where they differ from the
contract, the unit, a scale, an offset and a sign::

    time: {column: t, unit: ms}          # or rate: 500, in Hz, for tables without a time
    channels:
      pressure_states.elbow_flexor: {column: p1, unit: bar, absolute: true}
      pressure_states.elbow_extensor: {columns: {p_mean: 1, p_difference: -0.5}, unit: bar}
      joint_states.elbow.position: {column: phi, unit: deg, sign: -1, offset: 0.02}
      valve_commands.elbow_flexor: {column: u1, scale: 0.01}
      muscle_states.elbow_flexor.position: {held: 182, unit: mm}

A value becomes sign * scale * column in SI units, plus the offset in SI units. `columns` in place
of `column` is a weighted sum. `held` in place of both is one value for the whole recording, such as
the length at which a muscle is held, which no sensor measures. For an absolute pressure the ambient
one, 101 325 Pa, is subtracted unless `ambient` says otherwise. The columns of a bag are its topics
and fields (`bag_columns`), with stamps of their own, so that its map has neither `time` nor `rate`.
A table of text without a line of names gets them from `names: [t, p1, p2, phi]`, one for each
column.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from pam_gap.recordings.recording import (
    COMMANDS,
    JOINTS,
    MUSCLES,
    PRESSURES,
    SUPPLY,
    Array,
    RawChannel,
    RecordingError,
)
from pam_model.errors import Reasons
from pam_model.plain_yaml import PlainLoader
from pam_model.reading import read_text, reading
from pam_model.rig.types import NUMBERS
from pam_model.unit_hints import RECORDED, conversion_hint
from pam_ros.foreign_text import all_shown, shown

AMBIENT: Final = NUMBERS["gas"]["ambient_pressure"]
STANDARD_AMBIENT = 101325.0  # Pa
_UNITS = (
    ("time", "time", "s"),
    (SUPPLY, SUPPLY, "Pa absolute"),
    (PRESSURES, "", "Pa gauge"),
    (COMMANDS, "", ""),
    (JOINTS, ".position", "rad"),
    (JOINTS, ".effort", "N m"),
    (MUSCLES, ".position", "m"),
    (MUSCLES, ".effort", "N"),
)
"""Beginning and end of the name of a channel, and its unit."""
_KEYS = frozenset(
    {"column", "columns", "held", "unit", "scale", "offset", "sign", "absolute", "ambient"}
)


LARGEST_MAP: Final = 1 << 20
"""Size limit of a map file [bytes]."""


@dataclass(frozen=True, slots=True)
class MappedColumn:
    """One column of a table as a channel: value = factor * column + offset, in SI units."""

    # The column; the first of a weighted sum. Empty for a value that is held, the offset.
    column: str
    # factor, offset: factor to the unit of the channel, and what is added in that unit
    factor: float = 1.0
    offset: float = 0.0
    weight: float = 1.0  # weight of the column
    # further columns of a weighted sum, with their weights
    more: tuple[tuple[str, float], ...] = ()

    @property
    def columns(self) -> tuple[str, ...]:
        """All columns of which the channel is made."""
        return (self.column, *(name for name, _ in self.more)) if self.column else ()

    def values(self, columns: Mapping[str, Array]) -> Array:
        """The channel's values; the columns must exist."""
        total: Array = self.weight * columns[self.column]
        for name, weight in self.more:
            total = total + weight * columns[name]
        result: Array = self.factor * total + self.offset
        return result


@dataclass(frozen=True, slots=True)
class ColumnMap:
    """The channels of a table."""

    source: Path  # the map file
    channels: Mapping[str, MappedColumn]  # channel of the rig contract -> column
    time: MappedColumn | None  # column of the time [s]; None for a table with a constant rate
    rate: float = 0.0  # rate [Hz] of a table without a time; 0 for a bag, which has stamps
    names: tuple[str, ...] = ()  # of all columns of a table without a line of names

    def apply(self, path: Path, columns: Mapping[str, Array]) -> dict[str, Array]:
        """Time and channels of a table with these columns, in which `refuse_missing` finds all.

        Raises
        ------
        RecordingError
            When the columns of a sum have no time in common, or columns differ in length.
        """
        measured = {name: entry for name, entry in self.channels.items() if entry.column}
        result = {name: entry.values(columns) for name, entry in measured.items()}
        for name, entry in measured.items():
            apart = entry.more and not np.isfinite(result[name]).any()
            if apart and all(np.isfinite(columns[one]).any() for one in entry.columns):
                raise RecordingError(
                    f"{self.source}: {name}: {all_shown(entry.columns)} have no time in common in "
                    f"{path}; expected columns of a sum that are recorded at the same times"
                )
        count = min((values.size for values in result.values()), default=0)
        if self.time is not None:
            result["time"] = self.time.values(columns)
        else:
            result["time"] = np.arange(count) / self.rate
        sizes = {name: values.size for name, values in result.items()}
        if len(set(sizes.values())) > 1:
            told = ", ".join(f"{name} {size}" for name, size in sizes.items())
            raise RecordingError(f"{path}: the columns differ in length ({told})")
        for name in self.channels.keys() - measured.keys():
            result[name] = np.full(result["time"].size, self.channels[name].offset)
        return {name: result[name] for name in (*self.channels, "time")}

    @property
    def columns(self) -> frozenset[str]:
        """Every column that the map names."""
        entries = [*self.channels.values(), *([] if self.time is None else [self.time])]
        return frozenset(name for entry in entries for name in entry.columns)

    def refuse_missing(self, path: Path, there: Collection[str]) -> None:
        """Refuse a table without a column of the map, and a map without a time for a table.

        Raises
        ------
        RecordingError
            The message names the columns, and those of the table.
        """
        reasons = Reasons(RecordingError)
        with reasons.gathered():
            if self.time is None and not self.rate:
                raise RecordingError(f"{self.source}: expected either `time` or `rate` [Hz]")
        with reasons.gathered():
            self._refuse_columns_not_in(path, there)
        reasons.refuse()

    def _refuse_columns_not_in(self, path: Path, there: Collection[str]) -> None:
        missing = sorted(self.columns - set(there))
        if missing:
            raise RecordingError(
                f"{path}: no column {all_shown(missing)}, which {self.source} names; it has "
                f"{all_shown(there) or 'none'}"
            )

    def apply_to_bag(self, path: Path, columns: Mapping[str, RawChannel]) -> dict[str, RawChannel]:
        """The channels of a bag with these columns.

        The columns of a weighted sum must be of one topic, so that they share their stamps.

        Raises
        ------
        RecordingError
            When a column is missing, the map states a time, or stamps differ.
        """
        reasons = Reasons(RecordingError)
        with reasons.gathered():
            self._refuse_columns_not_in(path, columns)
        with reasons.gathered():
            if self.time is not None or self.rate or self.names:
                raise RecordingError(
                    f"{self.source}: `names`, `time` and `rate` are for tables; {path} has names "
                    "and stamps"
                )
        reasons.refuse()
        result = {}
        for channel, entry in self.channels.items():
            if not entry.column:
                continue
            time = columns[entry.column].time
            if any(not np.array_equal(columns[name].time, time) for name in entry.columns):
                raise RecordingError(
                    f"{self.source}: {channel}: the columns of a sum have different stamps in "
                    f"{path}; expected columns of one topic"
                )
            values = {name: columns[name].value for name in entry.columns}
            result[channel] = RawChannel(time, entry.values(values))
        longest = max(result.values(), key=lambda raw: raw.time.size).time
        for channel in self.channels.keys() - result.keys():
            result[channel] = RawChannel(
                longest, np.full(longest.size, self.channels[channel].offset)
            )
        return result


def unit_of(channel: str) -> str:
    """Unit of a channel; "" for a valve command, which has two; "?" for no channel."""
    for prefix, suffix, unit in _UNITS:
        if channel.startswith(prefix) and channel.endswith(suffix):
            return unit
    return "?"


def _factor(channel: str, unit: str, where: str) -> float:
    """Factor from a given unit to that of the channel."""
    expected = unit_of(channel)
    scales: dict[str, float] = {}
    for own in ("Pa gauge", "-") if not expected else (expected,):
        scales |= {own.split()[0]: 1.0, **dict(RECORDED.get(own, ()))}
    if unit not in scales:
        raise RecordingError(f"{where}: unit {shown(unit)}; expected one of {', '.join(scales)}")
    return scales[unit]


def _number(entry: Mapping[str, Any], key: str, default: float, where: str) -> float:
    value = entry.get(key, default)
    if isinstance(value, str):  # YAML takes 1e-6 for a text; it wants 1.0e-6
        with contextlib.suppress(ValueError):
            value = float(value)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise RecordingError(f"{where}: {key} is {shown(str(value))}; expected a number")
    return float(value)


def _zero_of_absolute(channel: str, entry: Mapping[str, Any], where: str) -> float:
    """The ambient pressure that is to be subtracted [Pa]; 0 unless the column is `absolute`."""
    absolute = entry.get("absolute", False)
    if not isinstance(absolute, bool):
        raise RecordingError(f"{where}: absolute is {shown(str(absolute))}; expected true or false")
    if not absolute:
        if "ambient" in entry:
            raise RecordingError(f"{where}: `ambient` needs `absolute: true`")
        return 0.0
    if not channel.startswith(PRESSURES):
        raise RecordingError(f"{where}: only a {PRESSURES}<muscle> can be `absolute`")
    key, value = AMBIENT, _number(entry, "ambient", STANDARD_AMBIENT, where)
    if not key.low <= value <= key.high:
        hint = conversion_hint(value, key.unit, key.low, key.high)
        raise RecordingError(
            f"{where}: ambient is {value:g}; expected {key.low:g} to {key.high:g} {key.unit}{hint}"
        )
    return value


def _column(channel: str, entry: Any, source: Path) -> MappedColumn:
    where = f"{source}: {channel if unit_of(channel) != '?' else shown(channel)}"
    if isinstance(entry, str):
        return MappedColumn(entry)
    if (
        not isinstance(entry, Mapping)
        or [
            isinstance(entry.get("column"), str),
            isinstance(entry.get("columns"), Mapping),
            "held" in entry,
        ].count(True)
        != 1
    ):
        raise RecordingError(
            f"{where}: expected the name of a column, or a mapping with one of `column`, `columns` "
            "and `held`"
        )
    reasons = Reasons(RecordingError)
    with reasons.gathered():
        _refuse_unknown(entry, _KEYS, where)
    factor, sign, offset, held = 1.0, 1.0, 0.0, 0.0
    with reasons.gathered():
        factor = _number(entry, "scale", 1.0, where)
    with reasons.gathered():
        if "unit" in entry:
            factor *= _factor(channel, str(entry["unit"]), where)
    with reasons.gathered():
        sign = _number(entry, "sign", 1.0, where)
    with reasons.gathered():
        if abs(sign) != 1.0 or factor == 0.0 or not math.isfinite(factor):
            raise RecordingError(
                f"{where}: expected a sign of 1 or -1 and a finite scale other than 0"
            )
    with reasons.gathered():
        offset = _number(entry, "offset", 0.0, where)
    with reasons.gathered():
        if "held" in entry:
            if not channel.endswith(".position"):
                raise RecordingError(f"{where}: only a length or a position can be `held`")
            held = _number(entry, "held", 0.0, where)
        else:
            offset -= _zero_of_absolute(channel, entry, where)
    terms: list[tuple[str, float]] = []
    for name in entry.get("columns", ()):
        with reasons.gathered():
            terms.append((str(name), _number(entry["columns"], name, 1.0, where)))
    with reasons.gathered():
        if "columns" in entry and not entry["columns"]:
            raise RecordingError(f"{where}: `columns` is empty; expected column: weight")
    reasons.refuse()
    if "held" in entry:
        return MappedColumn("", 0.0, sign * factor * held + offset)
    if "column" in entry:
        return MappedColumn(entry["column"], sign * factor, offset)
    (first, weight), *more = terms
    return MappedColumn(first, sign * factor, offset, weight, tuple(more))


def _refuse_unknown(entry: Mapping[Any, Any], known: Collection[str], where: str) -> None:
    unknown = sorted(set(map(str, entry)) - set(known))
    if unknown:
        raise RecordingError(
            f"{where}: unknown key {all_shown(unknown)}; known are {', '.join(sorted(known))}"
        )


def load_column_map(path: str | Path) -> ColumnMap:
    """Read a map file.

    Raises
    ------
    RecordingError
        When it cannot be read, or channels, keys, units or numbers in it are wrong; the message has
        one line for each.
    """
    source = Path(path)
    with reading(source, "a readable map of columns", RecordingError):
        content = yaml.load(read_text(source, LARGEST_MAP), PlainLoader)  # a SafeLoader
        return _map_of(content, source)


def _names(given: Any, source: Path) -> tuple[str, ...]:
    """The names of all columns of a table that has none."""
    are_texts = isinstance(given, list) and all(isinstance(n, str) and n.strip() for n in given)
    if not are_texts or not given or len(set(given)) < len(given):
        raise RecordingError(f"{source}: names: expected a list with one name for each column")
    return tuple(given)


def _map_of(content: Any, source: Path) -> ColumnMap:
    if not isinstance(content, Mapping) or not isinstance(content.get("channels"), Mapping):
        raise RecordingError(f"{source}: no `channels`; expected channel: column")
    reasons = Reasons(RecordingError)
    with reasons.gathered():
        _refuse_unknown(content, ("names", "time", "rate", "channels"), str(source))
    with reasons.gathered():
        if "time" in content and "rate" in content:
            raise RecordingError(f"{source}: expected either `time` or `rate` [Hz]")
    entries = {str(name): entry for name, entry in content["channels"].items()}
    with reasons.gathered():
        if all(isinstance(entry, Mapping) and "held" in entry for entry in entries.values()):
            raise RecordingError(f"{source}: `channels` is empty: no column is mapped")
    strangers = [name for name in entries if unit_of(name) in ("?", "s")]
    with reasons.gathered():
        if strangers:
            raise RecordingError(
                f"{source}: {all_shown(strangers)}: no channel; expected {PRESSURES}<muscle>, "
                f"{COMMANDS}<muscle>, {JOINTS}<joint>.position, {MUSCLES}<muscle>.effort or "
                f"{SUPPLY}"
            )
    channels: dict[str, MappedColumn] = {}
    for name in (name for name in entries if name not in strangers):
        with reasons.gathered():
            channels[name] = _column(name, entries[name], source)
    names, rate, time = tuple[str, ...](), 0.0, None
    with reasons.gathered():
        if "names" in content:
            names = _names(content["names"], source)
    with reasons.gathered():
        if "rate" in content:
            rate = _number(content, "rate", 0.0, str(source))
            if not rate > 0.0:
                raise RecordingError(f"{source}: rate is {rate:g}; expected Hz above 0")
    with reasons.gathered():
        if "time" in content:
            time = _column("time", content["time"], source)
    reasons.refuse()
    return ColumnMap(source, channels, time, rate, names)
