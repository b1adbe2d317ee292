"""One parameter of one joint over time: its values, its changes, and both as text."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from pam_gap.answer.user_units import spoken, told, user_unit
from pam_gap.fleet.change_points import SLOPE, Change, SeriesModel, deviations, find_changes

WEEK = 7.0 * 86400.0  # s
LONGEST = 520.0
"""Weeks; nothing is foretold beyond ten years."""


@dataclass(frozen=True, slots=True)
class Point:
    """A value with its 90 % interval at a Unix time [s]."""

    recording: str
    time: float
    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class ParameterSeries:
    """A parameter over time."""

    # robot, joint, effect, parameter, unit: which one
    robot: str
    joint: str
    effect: str
    parameter: str
    unit: str
    points: tuple[Point, ...]  # by time
    course: SeriesModel  # its changes
    limit: float | None = None  # value that a user has named as too much

    @property
    def name(self) -> str:
        """Effect and parameter, as text."""
        return f"{spoken(self.effect)}, {spoken(self.parameter)}"


def make_series(
    names: tuple[str, str, str, str], unit: str, points: Sequence[Point], limit: float | None
) -> ParameterSeries:
    """Order the points and find their changes; `names`: robot, joint, effect, parameter."""
    ordered = tuple(sorted(points, key=lambda p: (p.time, p.recording)))
    low, high = (np.array([getattr(p, key) for p in ordered]) for key in ("low", "high"))
    course = find_changes(
        np.array([p.time for p in ordered]),
        np.array([p.value for p in ordered]),
        deviations(low, high),
    )
    return ParameterSeries(*names, unit, ordered, course, limit)


def day(seconds: float) -> str:
    """A date for people, as "3 March 2026"."""
    date = datetime.fromtimestamp(seconds, UTC)
    return f"{date.day} {date:%B %Y}"


def _span(low: float, high: float, unit: str) -> str:
    """An interval with its unit once, of two numbers of one sign or not."""
    _, factor = user_unit(max(abs(low), abs(high)), unit)
    for digits in (2, 3, 4):
        ends = [told(factor * end, "", digits) for end in (low, high)]
        if ends[0] != ends[1]:
            break
    return " to ".join(ends)


def change_in_words(series: ParameterSeries, change: Change) -> str:
    """A change with its size, interval and date."""
    subject = f"{series.name} ({series.joint})"
    if change.kind == SLOPE:
        weekly = sorted(abs(v) * WEEK for v in (change.low, change.high))
        verb = "has grown" if change.size > 0.0 else "has fallen"
        rate = f"by {told(abs(change.size) * WEEK, series.unit)} a week"
        sure = f"90 % interval {_span(weekly[0], weekly[1], series.unit)}"
        if change.from_start:
            return f"{subject} {verb} {rate} ({sure}) over the whole time."
        return (
            f"{subject} {verb} {rate} ({sure}) since {day(change.time)} "
            f"({day(change.earliest)} to {day(change.latest)})."
        )
    sizes = sorted(abs(v) for v in (change.low, change.high))
    verb = "rose" if change.size > 0.0 else "fell"
    return (
        f"{subject} {verb} by {told(abs(change.size), series.unit)} (90 % interval "
        f"{_span(sizes[0], sizes[1], series.unit)}) between {day(change.earliest)} and "
        f"{day(change.latest)}."
    )


def weeks_left(series: ParameterSeries) -> tuple[float, str] | None:
    """Weeks until the limit, or until the value has doubled, at the present rate; and which.

    None where no slope takes the value further from 0, or it would take longer than ten years.
    """
    course = series.course
    if not any(c.kind == SLOPE for c in course.changes) or course.rate * course.last <= 0.0:
        return None
    weekly, now = abs(course.rate) * WEEK, abs(course.last)
    if series.limit is not None:
        weeks = max(abs(series.limit) - now, 0.0) / weekly
        aim = f"reaches {told(abs(series.limit), series.unit)}"
    else:
        weeks, aim = now / weekly, f"doubles to {told(2.0 * now, series.unit)}"
    return (weeks, aim) if weeks <= LONGEST else None


def in_words(series: ParameterSeries) -> list[str]:
    """All findings about a series, in sentences."""
    if not series.course.enough:
        return [
            f"{series.name} ({series.joint}): only {len(series.points)} recordings; too few to "
            "look for changes."
        ]
    said = [change_in_words(series, change) for change in series.course.changes]
    left = weeks_left(series)
    if left is not None:
        weeks, aim = left
        when = "now" if weeks < 0.5 else f"in about {told(weeks, '')} weeks"
        said.append(f"At this rate it {aim} {when}.")
    if not said:
        level = told(series.course.last, series.unit)
        said.append(f"{series.name} ({series.joint}) stays at {level}: no change was found.")
    return said


def as_json(series: ParameterSeries) -> dict[str, Any]:
    """The mapping that fleet.json holds."""
    left = weeks_left(series)
    return {
        "robot": series.robot,
        "joint": series.joint,
        "effect": series.effect,
        "parameter": series.parameter,
        "unit": series.unit,
        "points": list(series.points),
        "changes": [_change_json(series, change) for change in series.course.changes],
        "spread": series.course.spread,
        "last": series.course.last,
        "rate_per_week": series.course.rate * WEEK,
        "limit": series.limit,
        "weeks_left": None if left is None else left[0],
        "sentences": in_words(series),
    }


def _change_json(series: ParameterSeries, change: Change) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "effect": series.effect,
        "kind": change.kind,
        "time": change.time,
        "date": datetime.fromtimestamp(change.time, UTC).isoformat(timespec="seconds"),
        "earliest": change.earliest,
        "latest": change.latest,
    }
    if change.kind == SLOPE:
        return entry | {
            "rate_per_week": change.size * WEEK,
            "low": change.low * WEEK,
            "high": change.high * WEEK,
        }
    return entry | {"size": change.size, "low": change.low, "high": change.high}


def soonest(series: Sequence[ParameterSeries]) -> list[tuple[ParameterSeries, float, str]]:
    """What will need repair next: series that grow, the one with the least time left first."""
    found = [(s, left) for s in series if (left := weeks_left(s)) is not None]
    return sorted(((s, left[0], left[1]) for s, left in found), key=lambda item: item[1])


def limit_for(effect: str, parameter: str, limits: Mapping[str, float]) -> float | None:
    """The limit that a user named for a parameter, of one side or of both."""
    for name in (f"{effect}.{parameter}", f"{effect}.{parameter.partition('.')[0]}"):
        if name in limits and math.isfinite(limits[name]):
            return limits[name]
    return None
