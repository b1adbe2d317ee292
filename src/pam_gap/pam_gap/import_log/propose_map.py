"""Proposes which column of a log is which channel of a rig, and in which unit, to be checked.

A column is judged by the words of its name (the muscle or joint, "pressure", "angle", "measured" or
"desired"), by its unit, by its number among columns of one kind, and by the size of its values. The
proposal is a draft of a map file: the user confirms or corrects it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import yaml

from pam_gap.import_log.column_name import DERIVED, WORDS, ColumnName, words_of
from pam_gap.import_log.time_column import KIND, rest_of_time, time_score, unit_of_time
from pam_gap.prediction.bench_joint import bench_muscles
from pam_gap.recordings.column_map import unit_of
from pam_gap.recordings.import_rosbag import ESTIMATES, GROUND_TRUTH
from pam_gap.recordings.recording import COMMANDS, JOINTS, MUSCLES, PRESSURES, SUPPLY, Array
from pam_gap.recordings.text_table import Table
from pam_model.rig import Rig
from pam_model.unit_hints import RECORDED, units_that_fit
from pam_ros.foreign_text import all_shown, shown

_ASKED: Final = frozenset([
    "command", "commands", "cmd", "des", "desired", "ref", "reference", "target", "setpoint",
    "setp", "sp", "set", "goal", "soll",
])  # fmt: skip
"""Words of what was asked for: a column with one is a command of the valve, or no channel."""
_SEEN: Final = frozenset([
    "obs", "observed", "feedback", "fb", "measured", "meas", "actual", "act", "sensor", "reading",
    "ist",
])  # fmt: skip
"""Words of what was measured, which do not say what it is."""
_CONTRACTION: Final = frozenset(["contraction", "epsilon", "eps", "shortening"])
"""Words of how much shorter a muscle is, over its rest length."""
_SIDES: Final = (
    frozenset(["ago", "agonist", "agon"]),
    frozenset(["ant", "antago", "antagonist", "antag"]),
)
"""What the first and the second muscle of a joint are called without their names."""
_SHORTEST: Final = 3  # letters of a short form of a name
_OWNER, _NUMBER = 3.0, 1.5
"""What a word of the muscle or joint, and the right number, count; a word of the kind is `KIND`."""
_TOLD_BY_UNIT: Final = (PRESSURES, ".position")
"""Kinds of channel that a unit suggests where no word does."""
_OWN_NAME: Final = 100.0
"""What the name of this suite counts, less one for each that is better."""
_LEAST_OWN: Final = 90.0


@dataclass(frozen=True, slots=True)
class Proposed:
    """A column that is proposed for a channel."""

    # channel, column: which column for which channel
    channel: str
    column: str
    unit: str = ""  # its unit; empty for that of the rig contract
    # columns that are added, with their weights, for a time in several columns
    more: tuple[tuple[str, float], ...] = ()
    absolute: bool = False  # whether its unit says that it is an absolute pressure
    alike: tuple[str, ...] = ()  # other columns that fit as well by their names and units
    is_guessed: bool = False  # whether the unit follows from the size of the values alone


def wanted_channels(rig: Rig) -> list[str]:
    """The channels of a recording of this rig: what every diagnosis needs first."""
    muscles = list(rig.muscle_names)
    return [
        *(f"{PRESSURES}{muscle}" for muscle in muscles),
        *(f"{JOINTS}{joint.name}.position" for joint in rig.joints),
        *(f"{MUSCLES}{muscle}.position" for muscle in bench_muscles(rig)),
        *(f"{COMMANDS}{muscle}" for muscle in muscles),
        *(f"{MUSCLES}{muscle}.effort" for muscle in muscles),
        SUPPLY,
    ]


def _kind(channel: str) -> str:
    if channel == SUPPLY or channel.startswith((PRESSURES, COMMANDS)):
        return SUPPLY if channel == SUPPLY else channel.partition(".")[0] + "."
    if channel.startswith(MUSCLES) and channel.endswith(".position"):
        return "length"
    return "." + channel.rpartition(".")[2]


def _own_names(channel: str) -> tuple[str, ...]:
    """What a channel is called in tables and bags of this suite, the best first."""
    owner, _, field = channel.partition(".")[2].partition(".")
    if channel.startswith(COMMANDS):  # what was sent is nearer to the valves than what was asked
        topics = ("/sent_valve_commands", "/valve_commands")
        in_bags = [f"{t}.{f}.{owner}" for t in topics for f in ("position", "effort")]
    elif channel == SUPPLY:
        in_bags = [f"/{SUPPLY}.fluid_pressure"]
    else:
        in_bags = [f"/{channel.partition('.')[0]}.{field or 'effort'}.{owner}"]
    return (channel, *in_bags)


def _measured(columns: Mapping[str, Array]) -> dict[str, Array]:
    """The columns without what a simulated rig knows of itself and what the model node computed."""
    topics = {name: name.partition(".")[0].split("/") for name in columns}
    is_estimated = any(parts[-1] == ESTIMATES for parts in topics.values())
    return {
        name: columns[name]
        for name, parts in topics.items()
        if GROUND_TRUTH not in parts
        and not (is_estimated and parts[0] == "" and parts[-1] == MUSCLES.rstrip("."))
    }


def _expected(channel: str, rig: Rig) -> str:
    """The unit of a channel of this rig; that of a command depends on the kind of its valve."""
    if channel == "time":
        return "s"
    if channel.startswith(COMMANDS):
        kind = rig.muscle(channel.removeprefix(COMMANDS)).valve.kind
        return "-" if kind == "flow" else "Pa gauge"
    return unit_of(channel)


def _owner_score(channel: str, words: frozenset[str], rig: Rig) -> float:
    """How well the words name the muscle or joint of a channel."""
    owner = channel.partition(".")[2].partition(".")[0]
    named = sum(any(_is_short_for(w, word) for w in words) for word in words_of(owner))
    for joint in rig.joints:
        if owner in joint.muscles and words & _SIDES[joint.muscles.index(owner)]:
            named += 1
    return _OWNER * named


def _is_short_for(word: str, owner: str) -> bool:
    """Whether a word is that of a name, or its beginning, as `flex` of `flexor`."""
    return word == owner or (len(word) >= _SHORTEST and owner.startswith(word))


def _kind_score(kind: str, column: ColumnName, expected: str, owner: float) -> float:
    """How well the words name the kind of a channel; 0 where they suggest another kind."""
    words = column.words
    asked = bool(words & _ASKED)
    quantity = words & (WORDS[".position"] | WORDS["time"] | WORDS[".effort"])
    if kind != COMMANDS:
        if asked and not words & (WORDS[COMMANDS] - _ASKED):
            return 0.0  # a set point is no measurement
        seen = kind == PRESSURES and words & _SEEN and (owner or column.unit)
        named = any(words & other for other in WORDS.values())
        by_unit = kind in _TOLD_BY_UNIT and not named and column.unit in dict(RECORDED[expected])
        return KIND * len(words & WORDS[kind]) + (KIND / 2.0 if seen or by_unit else 0.0)
    if asked and quantity - {"t"}:
        return 0.0  # the reference of a joint
    if words & WORDS[PRESSURES] and (expected == "-" or not asked):
        return 0.0  # a pressure is the command of a regulator alone
    return KIND * len(words & (WORDS[COMMANDS] | _ASKED))


def _score(channel: str, place: int, column: ColumnName, rig: Rig) -> float:
    """How well a column fits a channel by its name and unit; 0 where it does not."""
    for rank, name in enumerate(_own_names(channel)):
        if column.name == name or (name.startswith("/") and column.name.endswith(name)):
            return _OWN_NAME - rank
    if not column.is_of(_expected(channel, rig)):
        return 0.0
    return _score_of_words(channel, place, column, rig)


def _score_of_words(channel: str, place: int, column: ColumnName, rig: Rig) -> float:
    """How well the words of a column fit a channel, whatever its unit; 0 where they do not."""
    owner = _owner_score(channel, column.words, rig)
    if _is_derived(channel, column):
        return 0.0
    kind = _kind_score(_kind(channel), column, _expected(channel, rig), owner)
    if not kind:
        return 0.0
    others = sum(
        len(column.words & words) for other, words in WORDS.items() if other != _kind(channel)
    )
    by_word = str(place) in {word.lstrip("0") for word in column.words}
    numbered = _NUMBER * (by_word if column.place is None else column.place == place)
    return kind + owner + numbered - 0.5 * others


def _unit(channel: str, column: ColumnName, values: Array, rig: Rig) -> str:
    """The unit that the name states, or that the size of the values suggests; empty for SI."""
    expected = _expected(channel, rig)
    if column.unit:
        return column.unit if column.unit in dict(RECORDED.get(expected, ())) else ""
    finite = values[np.isfinite(values)]
    if channel == "time":
        return unit_of_time(column, finite)
    largest = float(np.abs(finite).max(initial=0.0))
    supply = rig.supply_pressure - rig.gas.ambient_pressure
    limits = {
        "Pa gauge": (0.1 * supply, 1.1 * supply), "rad": (0.0, 6.3), "-": (0.05, 1.05),
        "m": (0.01, 5.0),
        "Pa absolute": (0.5 * rig.supply_pressure, 1.5 * rig.supply_pressure),
    }  # fmt: skip
    if expected not in limits or limits[expected][0] <= largest <= limits[expected][1]:
        return ""
    fitting = units_that_fit(largest, expected, *limits[expected], RECORDED)
    return fitting[0][0] if fitting else ""


def propose(
    columns: Mapping[str, Array],
    rig: Rig,
    *,
    is_bag: bool = False,
    units: Mapping[str, str] | None = None,
) -> list[Proposed]:
    """The columns that fit the channels of a rig best, each used once.

    Parameters
    ----------
    columns : mapping of str to ndarray
        The columns of the log.
    rig : Rig
        The rig that was recorded.
    is_bag : bool
        Whether the log has stamps of its own, so that no time is sought.
    units : mapping of str to str, optional
        Units that the log states apart from the names, by column.
    """
    channels = ([] if is_bag else ["time"]) + wanted_channels(rig)
    columns = {n: values for n, values in _measured(columns).items() if np.isfinite(values).any()}
    for run in [] if is_bag else _runs(columns):
        found = _best(run, rig, channels, is_bag=False, units=units)
        if all(name in {one.channel for one in found} for name in _needed(channels)):
            return found
    return _best(columns, rig, channels, is_bag=is_bag, units=units)


def _needed(channels: list[str]) -> list[str]:
    """Of the channels, those without which nothing can be diagnosed."""
    return [name for name in channels if name == "time" or name.startswith(PRESSURES)]


def _runs(columns: Mapping[str, Array]) -> list[dict[str, Array]]:
    """The columns of each of several runs in one log, as `runs.0.p` and `runs.1.p` are.

    Columns of different runs do not belong together, although their names say the same.
    """
    runs: dict[tuple[str, ...], dict[str, Array]] = {}
    for name, values in columns.items():
        parts = name.split(".")
        at = next((k + 1 for k, part in enumerate(parts[:-1]) if part.isdigit()), 0)
        if at:
            runs.setdefault(tuple(parts[:at]), {})[name] = values
    return list(runs.values()) if len(runs) > 1 else []


def _best(
    columns: Mapping[str, Array],
    rig: Rig,
    channels: list[str],
    *,
    is_bag: bool,
    units: Mapping[str, str] | None,
) -> list[Proposed]:
    """The columns that fit the channels best, each used once."""
    read = [ColumnName(name, (units or {}).get(name, ""), columns) for name in columns]
    first = next(iter(columns), "")
    places: dict[str, int] = {}
    scored: list[tuple[float, str, ColumnName]] = []
    for channel in channels:
        kind = "time" if channel == "time" else _kind(channel)
        place = places[kind] = places.get(kind, 0) + 1
        for column in read:
            if kind == "time":
                score = time_score(column, columns[column.name], column.name == first)
            else:
                score = _score(channel, place, column, rig)
            if score > 0.0:
                scored.append((score, channel, column))
    best = max((score for score, _, _ in scored), default=0.0)
    # In a bag of the suite, what has another name is something else.
    least = _LEAST_OWN if is_bag and best >= _LEAST_OWN else 0.0
    found: dict[str, ColumnName] = {}
    reached: dict[str, float] = {}
    used: set[str] = set()
    for score, channel, column in sorted(scored, key=lambda s: -s[0]):
        if score > least and channel not in found and column.name not in used:
            found[channel], reached[channel] = column, score
            used.add(column.name)
    alike: dict[str, list[str]] = {}
    for score, channel, column in scored:
        if score == reached.get(channel, 0.0) < _LEAST_OWN and channel != "time":
            alike.setdefault(channel, []).append(column.name)
    return [
        Proposed(
            channel,
            found[channel].name,
            _unit(channel, found[channel], columns[found[channel].name], rig),
            rest_of_time(columns, found[channel].name) if channel == "time" else (),
            found[channel].absolute and channel.startswith(PRESSURES),
            tuple(_others(alike.get(channel, []), found[channel].name, columns)),
            not found[channel].unit,
        )
        for channel in channels
        if channel in found
    ]


def _others(names: list[str], taken: str, columns: Mapping[str, Array]) -> Iterator[str]:
    """The columns that differ from the one that was taken."""
    for name in names:
        if not np.array_equal(columns[name], columns[taken], equal_nan=True):
            yield name


def doubts(proposed: Sequence[Proposed], table: Table, rig: Rig) -> list[str]:
    """What a person has to check of a proposal, or to add to it.

    Parameters
    ----------
    proposed : sequence of Proposed
        What was proposed.
    table : Table
        The columns of the log, with the text that is in them.
    rig : Rig
        The rig that was recorded.
    """
    found = [
        f"{one.channel}: {all_shown(one.alike)} fits as well as {shown(one.column)}"
        for one in proposed
        if one.alike
    ]
    guessed: dict[str, list[str]] = {}
    for one in proposed:
        if one.is_guessed and one.unit:
            guessed.setdefault(one.unit, []).append(one.column)
    found += [f"{all_shown(of)}: taken for {unit} by the size" for unit, of in guessed.items()]
    plain = [p.column for p in proposed if p.is_guessed and not p.unit and _needs_a_unit(p, rig)]
    if plain:
        found.append(f"{all_shown(plain)}: no unit is stated; taken for Pa")
    used = {one.column for one in proposed}
    names = [
        ColumnName(name, table.units.get(name, ""), table.columns)
        for name in table.columns
        if name not in used
    ]
    there, benches = {one.channel for one in proposed}, bench_muscles(rig)
    places: dict[str, int] = {}
    for channel in wanted_channels(rig):
        kind = _kind(channel)
        place = places[kind] = places.get(kind, 0) + 1
        muscle = channel.partition(".")[2].partition(".")[0]
        is_needed = channel.startswith((PRESSURES, COMMANDS, JOINTS)) or (
            channel.startswith(MUSCLES) and muscle in benches
        )
        if channel in there or not is_needed:
            continue
        scores = {name: _score_of_words(channel, place, name, rig) for name in names}
        best = max(scores.values(), default=0.0)
        for name in (each for each, score in scores.items() if score == best > 0.0):
            reason = _why_left_out(channel, name, table, rig)
            if reason:
                found.append(f"{channel}: {shown(name.name)} looks like it, but {reason}")
        if kind == "length":
            rest = rig.muscle(muscle).rest_length
            found += [
                f"{channel}: {shown(name.name)} looks like a contraction; for a share of the rest "
                f"length, write `scale: -{rest:g}, offset: {rest:g}` (`scale: -{0.01 * rest:g}` "
                "for per cent)"
                for name in names
                if name.words & _CONTRACTION
            ]
    return found


def _needs_a_unit(one: Proposed, rig: Rig) -> bool:
    """Whether a column is a pressure under a name that is not one of this suite."""
    own = any(one.column.endswith(name) for name in _own_names(one.channel))
    return not own and _expected(one.channel, rig).startswith("Pa")


def _why_left_out(channel: str, column: ColumnName, table: Table, rig: Rig) -> str:
    """Why a column with the right words is not proposed; empty if it is not known."""
    if not np.isfinite(table.columns[column.name]).any():
        text = table.texts.get(column.name)
        return f"holds {text}" if text else ""
    if column.is_of(_expected(channel, rig)):
        return ""
    return "has another unit; `scale` and `offset` of the map can convert it"


def _is_derived(channel: str, column: ColumnName) -> bool:
    """Whether a word says that a column was computed, or is of another quantity."""
    return bool((column.words & DERIVED) - set(words_of(channel.partition(".")[2])))


def map_text(proposed: list[Proposed], rate: float = 0.0) -> str:
    """The map file of a proposal."""

    def entry(one: Proposed) -> Any:
        if one.more:
            return {"columns": {one.column: 1.0, **dict(one.more)}}
        stated: dict[str, str | bool] = {"unit": one.unit} if one.unit else {}
        stated |= {"absolute": True} if one.absolute else {}
        return {"column": one.column, **stated} if stated else one.column

    content: dict[str, Any] = {}
    for one in proposed:
        if one.channel == "time":
            content["time"] = entry(one)
    if rate:
        content["rate"] = rate
    content["channels"] = {p.channel: entry(p) for p in proposed if p.channel != "time"}
    text: str = yaml.safe_dump(content, sort_keys=False, allow_unicode=True)
    return text
