"""How well the name of a column fits a channel of a rig: by its words, its unit and its number."""

from __future__ import annotations

from typing import Final

from pam_gap.import_log.column_name import DERIVED, WORDS, ColumnName
from pam_gap.import_log.time_column import KIND
from pam_gap.prediction.bench_joint import bench_muscles
from pam_gap.recordings.column_map import unit_of
from pam_gap.recordings.name_words import words_of
from pam_gap.recordings.recording import COMMANDS, JOINTS, MUSCLES, PRESSURES, SUPPLY
from pam_model.rig import Rig
from pam_model.unit_hints import RECORDED

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
_SIDES: Final = (
    frozenset(["ago", "agon", "agonist", "biceps", "flexor", "flex"]),
    frozenset(["ant", "anta", "antag", "antago", "antagonist", "triceps", "extensor", "ext"]),
)
"""What the first and the second muscle of a joint are called without their names."""
_SHORTEST: Final = 3  # letters of a short form of a name
_OWNER, _NUMBER = 3.0, 1.5
"""What a word of the muscle or joint, and the right number, count; a word of the kind is `KIND`."""
_TOLD_BY_UNIT: Final = (PRESSURES, ".position")
"""Kinds of channel that a unit suggests where no word does."""
OWN_NAME: Final = 100.0
"""What the name of this suite counts, less one for each that is better."""


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


def kind_of(channel: str) -> str:
    """The kind of a channel: the key of its words in `WORDS`."""
    if channel == SUPPLY or channel.startswith((PRESSURES, COMMANDS)):
        return SUPPLY if channel == SUPPLY else channel.partition(".")[0] + "."
    if channel.startswith(MUSCLES) and channel.endswith(".position"):
        return "length"
    return "." + channel.rpartition(".")[2]


def own_names(channel: str) -> tuple[str, ...]:
    """What a channel is called in tables and bags of this suite, the best first."""
    owner, _, field = channel.partition(".")[2].partition(".")
    if channel.startswith(COMMANDS):  # what was sent is nearer to the valves than what was asked
        topics = ("/sent_valve_commands", "/valve_commands")
        in_bags = [[t, f, owner] for t in topics for f in ("position", "effort")]
    elif channel == SUPPLY:
        in_bags = [[f"/{SUPPLY}", "fluid_pressure"]]
    else:
        in_bags = [[f"/{channel.partition('.')[0]}", field or "effort", owner]]
    plotted = ["/".join((topic, *reversed(of))) for topic, *of in in_bags]  # by PlotJuggler
    return (channel, *map(".".join, in_bags), *plotted)


def expected_unit(channel: str, rig: Rig) -> str:
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
    own = {word for muscle in rig.muscle_names for word in words_of(muscle)}
    for joint in rig.joints:
        for muscle, side in zip(joint.muscles, _SIDES, strict=False):
            named += muscle == owner and any(
                word in side and not any(_is_short_for(word, name) for name in own)
                for word in words
            )
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


def score_of(channel: str, place: int, column: ColumnName, rig: Rig) -> float:
    """How well a column fits a channel by its name and unit; 0 where it does not."""
    for rank, name in enumerate(own_names(channel)):
        if column.name == name or (name.startswith("/") and column.name.endswith(name)):
            return OWN_NAME - rank
    if not column.is_of(expected_unit(channel, rig)):
        return 0.0
    return score_of_words(channel, place, column, rig)


def score_of_words(channel: str, place: int, column: ColumnName, rig: Rig) -> float:
    """How well the words of a column fit a channel, whatever its unit; 0 where they do not."""
    owner = _owner_score(channel, column.words, rig)
    if _is_derived(channel, column):
        return 0.0
    kind = _kind_score(kind_of(channel), column, expected_unit(channel, rig), owner)
    if not kind:
        return 0.0
    others = sum(
        len(column.words & words) for other, words in WORDS.items() if other != kind_of(channel)
    )
    by_word = str(place) in {word.lstrip("0") for word in column.words}
    numbered = _NUMBER * (by_word if column.place is None else column.place == place)
    return kind + owner + numbered - 0.5 * others


def _is_derived(channel: str, column: ColumnName) -> bool:
    """Whether a word says that a column was computed, or is of another quantity."""
    return bool((column.words & DERIVED) - set(words_of(channel.partition(".")[2])))
