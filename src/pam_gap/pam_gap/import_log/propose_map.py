"""Proposes which column of a log is which channel of a rig, and in which unit, to be checked.

A column is judged by the words of its name (the muscle or joint, "pressure", "angle", "measured" or
"desired"), by its unit, by its number among columns of one kind, and by the size of its values. The
proposal is a draft of a map file: the user confirms or corrects it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import yaml

from pam_gap.import_log.channel_score import (
    OWN_NAME,
    expected_unit,
    kind_of,
    score_of,
    wanted_channels,
)
from pam_gap.import_log.column_name import ColumnName
from pam_gap.import_log.time_column import rest_of_time, time_score, unit_of_time
from pam_gap.recordings.import_rosbag import ESTIMATES, GROUND_TRUTH
from pam_gap.recordings.recording import MUSCLES, PRESSURES, Array
from pam_model.rig import Rig
from pam_model.unit_hints import RECORDED, units_that_fit

_LEAST_OWN: Final = OWN_NAME - 10.0
"""What a column of a bag of this suite must reach."""


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


def _unit(channel: str, column: ColumnName, values: Array, rig: Rig) -> str:
    """The unit that the name states, or that the size of the values suggests; empty for SI."""
    expected = expected_unit(channel, rig)
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
        kind = "time" if channel == "time" else kind_of(channel)
        place = places[kind] = places.get(kind, 0) + 1
        for column in read:
            if kind == "time":
                score = time_score(column, columns[column.name], column.name == first)
            else:
                score = score_of(channel, place, column, rig)
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
    # the steps of a time are those of one channel, which others may not share
    measured = next((of.name for channel, of in found.items() if channel != "time"), None)
    stamped = np.isfinite(columns[measured]) if measured else ...
    return [
        Proposed(
            channel,
            found[channel].name,
            _unit(
                channel,
                found[channel],
                columns[found[channel].name][stamped if channel == "time" else ...],
                rig,
            ),
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
