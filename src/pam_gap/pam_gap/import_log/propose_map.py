"""Proposes which column of a log is which channel of a rig, and in which unit, to be checked.

A column is judged by the words of its name (the muscle or joint, "pressure", "angle", a unit), by
its number among columns of one kind, and by the size of its values. The proposal is a draft of a
map file: the user confirms or mends it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import yaml

from pam_gap.recordings.column_map import unit_of
from pam_gap.recordings.import_rosbag import ESTIMATES, GROUND_TRUTH
from pam_gap.recordings.recording import COMMANDS, JOINTS, MUSCLES, PRESSURES, SUPPLY, Array
from pam_model.rig import Rig
from pam_model.unit_hints import RECORDED, units_that_fit

_WORDS: Final[Mapping[str, tuple[str, ...]]] = {
    "time": ("time", "t", "stamp", "timestamp", "seconds", "sec"),
    PRESSURES: ("pressure", "pressures", "press", "p", "pres", "druck"),
    COMMANDS: (
        "command",
        "commands",
        "cmd",
        "valve",
        "u",
        "input",
        "action",
        "setpoint",
        "desired",
    ),
    ".position": ("angle", "position", "pos", "q", "theta", "phi", "joint", "encoder"),
    ".effort": ("force", "load", "cell", "effort", "torque", "f"),
    SUPPLY: ("supply", "tank", "source"),
}
"""Words that speak for a kind of channel."""
_UNIT_WORDS: Final = {
    "deg": "deg", "degree": "deg", "degrees": "deg", "mrad": "mrad", "bar": "bar", "kpa": "kPa",
    "mpa": "MPa", "psi": "psi", "mbar": "mbar", "ms": "ms", "us": "us", "ns": "ns", "mm": "mm",
    "cm": "cm", "kn": "kN", "mn": "mN", "percent": "per cent",
}  # fmt: skip
_KIND, _OWNER, _NUMBER = 2.0, 3.0, 1.5
"""What a word of the kind, a word of the muscle or joint, and the right number count."""
_OWN_NAME: Final = 100.0
"""What the name of this suite counts, less one for each that is better."""
_LEAST_OWN: Final = 90.0


@dataclass(frozen=True, slots=True)
class Proposed:
    """A column that is proposed for a channel.

    Attributes
    ----------
    channel, column : str
        Which column for which channel.
    unit : str
        Its unit; empty for that of the rig contract.
    """

    channel: str
    column: str
    unit: str = ""


def wanted_channels(rig: Rig) -> list[str]:
    """The channels of a recording of this rig: what every diagnosis needs first."""
    muscles = [muscle for joint in rig.joints for muscle in joint.muscles]
    return [
        *(f"{PRESSURES}{muscle}" for muscle in muscles),
        *(f"{JOINTS}{joint.name}.position" for joint in rig.joints),
        *(f"{COMMANDS}{muscle}" for muscle in muscles),
        *(f"{MUSCLES}{muscle}.effort" for muscle in muscles),
        SUPPLY,
    ]


def words_of(name: str) -> list[str]:
    """The words and numbers in a name: `elbowFlexor_p1[kPa]` has elbow, flexor, p, 1, kpa."""
    apart = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    return [word.lower() for word in re.findall(r"[A-Za-z]+|\d+", apart)]


def _kind(channel: str) -> str:
    if channel == SUPPLY or channel.startswith((PRESSURES, COMMANDS)):
        return SUPPLY if channel == SUPPLY else channel.partition(".")[0] + "."
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


def _score(channel: str, place: int, column: str) -> float:
    """How well the name of a column fits a channel; 0 without a word of its kind."""
    for rank, name in enumerate(_own_names(channel)):
        if column == name or (name.startswith("/") and column.endswith(name)):
            return _OWN_NAME - rank
    words = words_of(column)
    kind = _KIND * sum(word in _WORDS[_kind(channel)] for word in set(words))
    if not kind:
        return 0.0
    owner = channel.partition(".")[2].partition(".")[0]
    named = _OWNER * sum(word in words for word in words_of(owner))
    numbers = [int(word) for word in words if word.isdigit()]
    others = sum(
        word in _WORDS[other] for word in set(words) for other in _WORDS if other != _kind(channel)
    )
    return kind + named + _NUMBER * (place in numbers) - 0.5 * others


def _unit(channel: str, column: str, values: Array, rig: Rig) -> str:
    """The unit that the name states, or that the size of the values suggests; empty for SI."""
    expected = "s" if channel == "time" else unit_of(channel) or "-"
    known = dict(RECORDED.get(expected, ()))
    for word in words_of(column):
        if _UNIT_WORDS.get(word) in known:
            return _UNIT_WORDS[word]
    largest = float(np.nanmax(np.abs(values), initial=0.0))
    supply = rig.supply_pressure - rig.gas.ambient_pressure
    limits = {
        "Pa gauge": (0.1 * supply, 1.1 * supply), "rad": (0.0, 6.3), "-": (0.05, 1.05),
        "Pa absolute": (0.5 * rig.supply_pressure, 1.5 * rig.supply_pressure),
    }  # fmt: skip
    if expected not in limits or limits[expected][0] <= largest <= limits[expected][1]:
        return ""
    fitting = units_that_fit(largest, expected, *limits[expected], RECORDED)
    return fitting[0][0] if fitting else ""


def propose(columns: Mapping[str, Array], rig: Rig, *, is_bag: bool = False) -> list[Proposed]:
    """The columns that fit the channels of a rig best, each used once.

    Parameters
    ----------
    columns : mapping of str to ndarray
        The columns of the log.
    rig : Rig
        The rig that was recorded.
    is_bag : bool
        Whether the log has stamps of its own, so that no time is sought.
    """
    channels = ([] if is_bag else ["time"]) + wanted_channels(rig)
    columns = _measured(columns)
    places: dict[str, int] = {}
    scored: list[tuple[float, str, str]] = []
    for channel in channels:
        kind = "time" if channel == "time" else _kind(channel)
        place = places[kind] = places.get(kind, 0) + 1
        for column in columns:
            score = _time_score(column) if kind == "time" else _score(channel, place, column)
            scored.append((score, channel, column))
    best = max((score for score, _, _ in scored), default=0.0)
    # In a bag of the suite, what has another name is something else.
    least = _LEAST_OWN if is_bag and best >= _LEAST_OWN else 0.0
    found: dict[str, str] = {}
    for score, channel, column in sorted(scored, key=lambda s: -s[0]):
        if score > least and channel not in found and column not in found.values():
            found[channel] = column
    return [
        Proposed(
            channel, found[channel], _unit(channel, found[channel], columns[found[channel]], rig)
        )
        for channel in channels
        if channel in found
    ]


def _time_score(column: str) -> float:
    return _KIND * sum(word in _WORDS["time"] for word in words_of(column))


def map_text(proposed: list[Proposed], rate: float = 0.0) -> str:
    """The map file of a proposal."""

    def entry(one: Proposed) -> Any:
        return {"column": one.column, "unit": one.unit} if one.unit else one.column

    content: dict[str, Any] = {}
    for one in proposed:
        if one.channel == "time":
            content["time"] = entry(one)
    if rate:
        content["rate"] = rate
    content["channels"] = {p.channel: entry(p) for p in proposed if p.channel != "time"}
    text: str = yaml.safe_dump(content, sort_keys=False, allow_unicode=True)
    return text
