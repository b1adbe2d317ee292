"""Says while a recording runs what a diagnosis of it would still miss.

What counts is on the page docs/record_for_diagnosis.md: the topics, 40 s, 200 Hz, two seconds at
rest, and a motion that uses the range of every joint and the pressures of every muscle.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from pam_gap.rules import DEFAULT
from pam_model.rig import Rig

WANTED_DURATION = 40.0  # s
WANTED_RATE = 200.0  # Hz
REST_TIME = 2.0  # s
RANGE_SHARE = DEFAULT.recording.wanted_range  # of the range of a joint
SWING_SHARE = 0.3  # of the largest pressure of a muscle
STILL_ANGLE = 0.01  # rad
STILL_SHARE = 0.01  # of the largest pressure
SPACING = 0.02  # s, between samples that are kept for the judgement of rest

PRESSURES, POSITIONS = "pressure_states", "joint_states"
SENT, COMMANDS = "sent_valve_commands", "valve_commands"


@dataclass(slots=True)
class _Seen:
    """What a channel has shown: its extremes, and its last two seconds."""

    low: float = math.inf
    high: float = -math.inf
    last: deque[tuple[float, float]] = field(default_factory=deque)
    rested: bool = False

    def take(self, time: float, value: float, still: float) -> None:
        self.low, self.high = min(self.low, value), max(self.high, value)
        if self.last and time - self.last[-1][0] < SPACING:
            return
        self.last.append((time, value))
        while self.last[-1][0] - self.last[0][0] > REST_TIME:
            self.last.popleft()
        values = [kept for _, kept in self.last]
        whole = self.last[-1][0] - self.last[0][0] > 0.9 * REST_TIME
        self.rested = self.rested or (whole and max(values) - min(values) < still)


class RecordingAdvice:
    """Watches the messages of a recording.

    Parameters
    ----------
    rig : Rig
        The robot that is recorded.
    """

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._begin = math.nan
        self._last = math.nan
        self._counts: dict[str, int] = {}
        self._commanded = math.nan  # when the controller last sent a command
        self._joints = {joint.name: _Seen() for joint in rig.joints}
        self._muscles = {muscle.name: _Seen() for muscle in rig.muscles}

    @property
    def duration(self) -> float:
        """Time from the first to the last message [s]."""
        return 0.0 if math.isnan(self._begin) else self._last - self._begin

    def take(
        self,
        topic: str,
        time: float,
        names: Sequence[str] = (),
        position: Sequence[float] = (),
        effort: Sequence[float] = (),
    ) -> None:
        """Take one message.

        Parameters
        ----------
        topic : str
            Its name without a namespace.
        time : float
            When it arrived [s].
        names, position, effort : sequence
            Fields of a sensor_msgs/JointState; may be empty for topics that only count.
        """
        if math.isnan(self._begin):
            self._begin = time
        self._last = time
        self._counts[topic] = self._counts.get(topic, 0) + 1
        if topic == COMMANDS:
            self._commanded = time
        if topic == POSITIONS:
            for name, value in zip(names, position, strict=False):
                if name in self._joints and math.isfinite(value):
                    self._joints[name].take(time, value, STILL_ANGLE)
        elif topic == PRESSURES:
            for name, value in zip(names, effort, strict=False):
                if name in self._muscles and math.isfinite(value):
                    still = STILL_SHARE * self._rig.muscle(name).max_pressure
                    self._muscles[name].take(time, value, still)

    def missing(self) -> list[str]:
        """What is still missing, most important first; empty if the recording is complete."""
        found = self._missing_topics()
        if self.duration < WANTED_DURATION:
            found.append(f"length: {self.duration:.0f} s of {WANTED_DURATION:.0f} s")
        for topic in (PRESSURES, POSITIONS):
            rate = self._counts.get(topic, 0) / max(self.duration, 1.0)
            if self.duration > REST_TIME and 0.0 < rate < 0.95 * WANTED_RATE:
                found.append(f"{topic}: arrives at {rate:.0f} Hz, expected {WANTED_RATE:.0f} Hz")
        if self._last - self._commanded > REST_TIME:
            found.append(
                f"control: no {COMMANDS} after {self._commanded - self._begin:.0f} s; the driver "
                "may have vented, and what follows shows little: look at its log, and record again"
            )
        return found + self._missing_motion()

    def _missing_topics(self) -> list[str]:
        found = [
            f"{topic}: no message yet; is the driver running?"
            for topic in (PRESSURES, POSITIONS)
            if topic not in self._counts
        ]
        if SENT not in self._counts and COMMANDS not in self._counts:
            found.append(f"{SENT} or {COMMANDS}: no message yet; the valves cannot be judged")
        return found

    def _missing_motion(self) -> list[str]:
        found = []
        for joint in self._rig.joints:
            lower, upper = joint.position_limits
            seen = self._joints[joint.name]
            share = max(seen.high - seen.low, 0.0) / (upper - lower)
            if share < RANGE_SHARE:
                found.append(
                    f"excitation: {joint.name} has used {share:.0%} of its range, expected "
                    f"{RANGE_SHARE:.0%}"
                )
            if seen.high >= seen.low and not seen.rested:
                found.append(f"rest: {joint.name} was not at rest for {REST_TIME:g} s yet")
        for muscle in self._rig.muscles:
            seen = self._muscles[muscle.name]
            share = max(seen.high - seen.low, 0.0) / muscle.max_pressure
            if share < SWING_SHARE:
                found.append(
                    f"excitation: {muscle.name} has used {share:.0%} of its pressure, expected "
                    f"{SWING_SHARE:.0%}"
                )
            if seen.high >= seen.low and not seen.rested:
                found.append(f"rest: {muscle.name} was not at rest for {REST_TIME:g} s yet")
        return found
