"""Diagnoses side by side, such as before and after a repair: what changed beyond noise.

The first diagnosis is the one that the others are compared with. Of each value, the difference is
divided by its standard deviation, and a difference of more than 1.96 of them counts as a change
(z-test, 5 %). The standard deviation of a value follows from its 90 % interval: from the half that
faces the other value, since intervals are not symmetric near a bound.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pam_gap.answer.user_units import spoken
from pam_gap.inference.confidence import NORMAL_90
from pam_model.effects import EFFECTS
from pam_model.errors import PamError
from pam_model.reading import read_text, reading

SURE = 1.96
"""Standard deviations from which a difference is more than noise (two-sided, 5 %)."""
FILE = "diagnosis.json"
_NEEDED = ("verdict", "effects", "parameters", "gap")


@dataclass(frozen=True, slots=True)
class Answer:
    """One diagnosis of one joint: where it stands, and the content of diagnosis.json."""

    name: str
    content: Mapping[str, Any]

    @property
    def joint(self) -> str:
        """Name of the joint."""
        return str(self.content.get("joint", ""))


@dataclass(frozen=True, slots=True)
class Difference:
    """Whether a value of a later diagnosis differs from that of the first."""

    z: float  # difference in standard deviations; NaN where it is unknown
    sure: bool  # whether it is more than noise
    words: str  # the same, as text


@dataclass(frozen=True, slots=True)
class Row:
    """One parameter in all diagnoses."""

    # effect, parameter, unit: which one
    effect: str
    parameter: str
    unit: str
    # `value`, `low`, `high` of each diagnosis; None where the effect was not named
    values: tuple[Mapping[str, float] | None, ...]
    differences: tuple[Difference, ...]  # one for each diagnosis after the first


@dataclass(frozen=True, slots=True)
class GapRow:
    """The size of the gap of one channel in all diagnoses, in the unit of the channel."""

    channel: str
    unit: str
    sizes: tuple[Mapping[str, float] | None, ...]
    """`before`, `retuned`, `after` and `limit`, without the part that noise causes."""


@dataclass(frozen=True, slots=True)
class JointComparison:
    """All diagnoses of one joint."""

    joint: str
    answers: tuple[Answer, ...]
    parameters: tuple[Row, ...]
    gaps: tuple[GapRow, ...]
    changes: tuple[str, ...]
    """What changed by more than noise, in sentences."""
    caution: str = ""
    """What to know before reading the rest; empty if nothing."""


def letter(place: int) -> str:
    """The name of a diagnosis in tables and sentences: A for the first one."""
    return chr(ord("A") + place) if place < 26 else str(place + 1)


def _read(path: Path) -> Answer:
    with reading(path, "a diagnosis: no JSON"):
        content = json.loads(read_text(path))
    if not isinstance(content, dict) or any(key not in content for key in _NEEDED):
        raise PamError(
            f"{path}: not a diagnosis; expected the keys {', '.join(_NEEDED)}, as `diagnose` "
            "writes them"
        )
    return Answer(str(path), content)


def read_answers(path: Path) -> list[Answer]:
    """The diagnoses in a file, or in a folder of `diagnose` with one or several joints.

    Raises
    ------
    PamError
        When there is none, or a file is no diagnosis.
    """
    if path.is_file():
        return [_read(path)]
    if (path / FILE).is_file():
        return [_read(path / FILE)]
    files = sorted(path.glob(f"*/{FILE}"))
    if not files:
        raise PamError(f"{path}: no {FILE} in this folder or one below it; expected the --out "
                       "folder of `diagnose`")  # fmt: skip
    return [_read(file) for file in files]


def difference(first: Mapping[str, float], other: Mapping[str, float]) -> tuple[float, bool]:
    """Difference of two values in standard deviations, and whether it is more than noise.

    Parameters
    ----------
    first, other : mapping
        `value`, `low` and `high`: a 90 % interval.
    """
    step = other["value"] - first["value"]
    if step >= 0.0:
        halves = (first["high"] - first["value"], other["value"] - other["low"])
    else:
        halves = (first["value"] - first["low"], other["high"] - other["value"])
    deviation = math.hypot(*halves) / NORMAL_90
    if deviation <= 0.0:
        return math.nan, False
    return step / deviation, abs(step) / deviation > SURE


def _neutral(effect: str, parameter: str) -> float | None:
    """The value at which an effect does nothing; None for a parameter that only shapes it."""
    declared = EFFECTS.get(effect)
    found = declared.parameters.get(parameter.partition(".")[0]) if declared else None
    return None if found is None or found.is_shape else found.neutral


def _deviations(z: float) -> str:
    """A sure difference in words; beyond a hundred, the interval says nothing more."""
    return (
        f"{abs(z):.1f} standard deviations"
        if abs(z) < 100.0
        else "more than 100 standard deviations"
    )


def _untold(words: str) -> Difference:
    return Difference(math.nan, False, words)


def _judged(
    effect: str,
    parameter: str,
    first: Mapping[str, float] | None,
    other: Mapping[str, float] | None,
    answers: tuple[Answer, Answer],
) -> Difference:
    """The difference of one parameter between the first and another diagnosis."""
    if first is not None and other is not None:
        z, sure = difference(first, other)
        if math.isnan(z):
            return _untold("without intervals, a change cannot be judged")
        text = f"{'rose' if z > 0.0 else 'fell'}, {_deviations(z)}"
        return Difference(z, sure, text if sure else f"within noise ({abs(z):.1f})")
    if first is None and other is None:
        return _untold("named in neither")
    return _appeared(effect, parameter, first, other, answers[0 if first is None else 1])


def _appeared(
    effect: str,
    parameter: str,
    first: Mapping[str, float] | None,
    other: Mapping[str, float] | None,
    silent: Answer,
) -> Difference:
    """The difference of an effect that only one diagnosis named; `silent` is the other one."""
    word = "new" if first is None else "gone"
    if effect in silent.content.get("not_shown", ()):
        return _untold(f"{word}, but the other recording could not show it")
    if silent.content["verdict"] in ("unknown", "not_identifiable"):
        return _untold(f"not named by the verdict “{silent.content['verdict']}”")
    neutral, known = _neutral(effect, parameter), other if first is None else first
    if neutral is None or known is None:
        return _untold(word)
    # The diagnosis without the effect has no interval for it; that of the other alone counts.
    none = {"value": neutral, "low": neutral, "high": neutral}
    z, sure = difference(none, known) if first is None else difference(known, none)
    if math.isnan(z):
        return _untold(f"{word}; without intervals, a change cannot be judged")
    text = f"{word}, {_deviations(z)} from no effect"
    return Difference(z, sure, text if sure else f"{word}, within noise ({abs(z):.1f})")


def _rows(answers: tuple[Answer, ...]) -> list[Row]:
    names: dict[tuple[str, str], str] = {}
    for answer in answers:
        for effect, parameters in answer.content["parameters"].items():
            for name, entry in parameters.items():
                names.setdefault((effect, name), str(entry.get("unit", "-")))
    rows = []
    for (effect, name), unit in names.items():
        values = tuple(a.content["parameters"].get(effect, {}).get(name) for a in answers)
        differences = tuple(
            _judged(effect, name, values[0], value, (answers[0], answer))
            for value, answer in zip(values[1:], answers[1:], strict=True)
        )
        rows.append(Row(effect, name, unit, values, differences))
    return rows


def _gaps(answers: tuple[Answer, ...]) -> list[GapRow]:
    sizes = [(a.content.get("materiality") or {}).get("channels", {}) for a in answers]
    channels = dict.fromkeys(channel for one in sizes for channel in one)
    return [
        GapRow(
            channel,
            next(str(one[channel]["unit"]) for one in sizes if channel in one),
            tuple(one.get(channel) for one in sizes),
        )
        for channel in channels
    ]


def _changes(answers: tuple[Answer, ...], rows: Sequence[Row]) -> list[str]:
    said = []
    first = answers[0].content["verdict"]
    for place, answer in enumerate(answers[1:]):
        where = f"{letter(place + 1)}: " if len(answers) > 2 else ""
        verdict = answer.content["verdict"]
        if verdict != first:
            the = "the" if where else "The"
            said.append(f"{where}{the} verdict changed from “{first}” to “{verdict}”.")
        changed: dict[str, dict[str, Difference]] = {}
        for row in rows:
            if row.differences[place].sure:
                changed.setdefault(row.effect, {})[row.parameter] = row.differences[place]
        for effect, found in changed.items():
            name = spoken(effect)
            if (
                len(found) > 1
                and len({change.words.partition(",")[0] for change in found.values()}) == 1
            ):
                surest = max(found.values(), key=lambda change: abs(change.z))
                said.append(f"{where}{name} ({', '.join(map(spoken, found))}): {surest.words}.")
                continue
            said += [
                f"{where}{name}, {spoken(key)}: {change.words}." for key, change in found.items()
            ]
    return said


def _caution(answers: tuple[Answer, ...]) -> str:
    rigs = [answer.content.get("provenance", {}).get("rig", {}) for answer in answers]
    if len({rig["sha256"] for rig in rigs if "sha256" in rig}) < 2:
        return ""
    files = ", ".join(
        f"{letter(place)}: {rig['path']}" for place, rig in enumerate(rigs) if "path" in rig
    )
    return (
        f"The diagnoses used different rig files ({files}). Every value counts from the rig file "
        "of its own diagnosis, so that a change of the file looks like a change of the robot."
    )


def compare(groups: Sequence[Sequence[Answer]]) -> list[JointComparison]:
    """Compare the diagnoses of two or more runs, joint by joint.

    Parameters
    ----------
    groups : sequence of sequence of Answer
        The diagnoses of each run, from `read_answers`; the first run is compared with.

    Raises
    ------
    PamError
        When there are fewer than two runs, or they are of different joints.
    """
    if len(groups) < 2:
        raise PamError("only one diagnosis given; expected two or more to compare")
    names = [sorted(answer.joint for answer in group) for group in groups]
    for group, found in zip(groups[1:], names[1:], strict=True):
        if found != names[0]:
            raise PamError(
                f"{group[0].name}: diagnosis of {', '.join(map(spoken, found))}; expected "
                f"{', '.join(names[0])}, as in {groups[0][0].name}"
            )
    made = []
    for joint in names[0]:
        answers = tuple(next(a for a in group if a.joint == joint) for group in groups)
        rows = _rows(answers)
        made.append(
            JointComparison(
                joint,
                answers,
                tuple(rows),
                tuple(_gaps(answers)),
                tuple(_changes(answers, rows)),
                _caution(answers),
            )
        )
    return made
