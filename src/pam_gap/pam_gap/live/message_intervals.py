"""The intervals between the messages of a recording: gaps, lost messages, and set-back clocks."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from statistics import median

from pam_gap.recordings.recording import GAP_PERIODS
from pam_gap.rules import Rules

RECENT = 200
"""Intervals of which the median is the period of a topic."""
LOST = 1.5
"""Periods between two messages above which one between them is lost."""


@dataclass(slots=True)
class _Topic:
    last: float = math.nan
    period: float = math.nan  # s
    recent: deque[float] = field(default_factory=lambda: deque(maxlen=RECENT))
    seen: int = 0
    lost: int = 0
    in_gaps: float = 0.0  # s
    longest: float = 0.0  # s
    set_back: int = 0
    spoiled: float = 0.0  # s, in gaps or just after one
    until: float = -math.inf  # up to when the time is counted as spoiled

    def take(self, stamp: float, rules: Rules) -> None:
        """Take the stamp of a message."""
        interval, self.last = stamp - self.last, stamp
        self.seen += 1
        if math.isnan(interval):
            return
        if interval < 0.0:
            self.set_back += 1
            self.until = -math.inf
            return
        self.recent.append(interval)
        if self.seen % 20 == 0 or math.isnan(self.period):
            self.period = median(self.recent)
        if interval > LOST * self.period:
            self.lost += round(interval / max(self.period, 1e-6)) - 1
        if interval <= max(rules.recording.longest_step, GAP_PERIODS * self.period):
            return
        self.in_gaps += interval - self.period
        self.longest = max(self.longest, interval)
        begin, self.until = max(stamp - interval, self.until), stamp + rules.prediction.horizon
        self.spoiled += self.until - begin


class MessageIntervals:
    """Watches when the messages of the topics of a recording were sent.

    Parameters
    ----------
    rules : Rules
        What a diagnosis needs: the longest time between two samples, the time after a gap in which
        predictions still err, and the share of lost time that is told.
    """

    def __init__(self, rules: Rules) -> None:
        self._rules = rules
        self._topics: dict[str, _Topic] = {}

    def take(self, topic: str, stamp: float) -> None:
        """Take the stamp [s] of one message."""
        self._topics.setdefault(topic, _Topic()).take(stamp, self._rules)

    def useful_time(self, duration: float) -> float:
        """Of the duration of the recording [s], what lies in no gap and not just after one [s]."""
        return max(duration - max((t.spoiled for t in self._topics.values()), default=0.0), 0.0)

    def faults(self) -> list[str]:
        """What is wrong with the times of the messages, one line a kind; empty if nothing is."""
        told = self._rules.recording.told_share
        gaps, lost, longest, set_back = [], [], 0.0, []
        for name, topic in self._topics.items():
            whole = max(topic.in_gaps + topic.seen * _number(topic.period), 1e-9)
            in_gaps = topic.in_gaps / whole
            missed = topic.lost / max(topic.lost + topic.seen, 1)
            if in_gaps > told:
                gaps.append(f"{name} ({in_gaps:.0%})")
                longest = max(longest, topic.longest)
            elif missed > told:
                lost.append(f"{name} ({missed:.0%})")
            if topic.set_back:
                set_back.append(f"those of {name} ran backwards {topic.set_back} times")
        found = []
        if gaps:
            found.append(
                f"gaps: a part of the time has no {', '.join(gaps)}, the longest gap lasts "
                f"{longest:.2g} s; the computer or the network is too busy: end other programs, "
                "and record again"
            )
        if lost:
            found.append(f"lost: a part of the messages does not arrive: {', '.join(lost)}")
        if set_back:
            which = ", ".join(set_back).replace("those of", "the stamps of", 1)
            found.append(f"clock: {which}; let the clocks settle (chrony, NTP), and record again")
        return found


def _number(value: float) -> float:
    return 0.0 if math.isnan(value) else value
