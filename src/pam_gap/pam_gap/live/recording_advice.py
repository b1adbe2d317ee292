"""Says while a recording runs what a diagnosis of it would still miss.

What counts is on the page docs/record_for_diagnosis.md: the topics, 40 s without gaps, 200 Hz, two
seconds at rest, and a motion that uses the range of every joint and the pressures of every muscle.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from pam_gap.live.message_intervals import MessageIntervals
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
FROZEN_TIME = 2.0  # s, in which a sensor repeats one value although the rest moves
FROZEN_SHARE = DEFAULT.recording.frozen_push  # of its usual span, that the rest moves meanwhile
CLIPPED_SHARE = DEFAULT.recording.told_share  # of the samples at the largest value
EMPTY_SHARE = 0.1  # of the largest pressure, below which a muscle may be empty
FEWEST_SAMPLES = 200  # of a channel before its share of clipped samples is told

PRESSURES, POSITIONS = "pressure_states", "joint_states"
SENT, COMMANDS = "sent_valve_commands", "valve_commands"


@dataclass(slots=True)
class _Span:
    """Span of what moves a sensor: in all, and since the sensor last changed."""

    low: float = math.inf
    high: float = -math.inf
    recent_low: float = math.inf
    recent_high: float = -math.inf

    def take(self, value: float) -> None:
        self.low, self.high = min(self.low, value), max(self.high, value)
        self.recent_low = min(self.recent_low, value)
        self.recent_high = max(self.recent_high, value)

    def restart(self) -> None:
        self.recent_low, self.recent_high = math.inf, -math.inf

    @property
    def whole(self) -> float:
        return self.high - self.low

    @property
    def recent(self) -> float:
        return self.recent_high - self.recent_low


@dataclass(slots=True)
class _Seen:
    """What a channel has shown: its extremes, its last two seconds, and whether it is stuck."""

    low: float = math.inf
    high: float = -math.inf
    last: deque[tuple[float, float]] = field(default_factory=deque)
    rested: bool = False
    value: float = math.nan
    since: float = math.nan  # when the value last changed
    frozen: float = 0.0  # longest time with one value while the rest moved
    samples: int = 0
    repeats: int = 0  # samples equal to the one before
    at_high: int = 0  # samples at the largest value, and at the smallest
    at_low: int = 0

    def watch(self, time: float, value: float, moved: _Span, least: float = -math.inf) -> None:
        """See whether the sensor is frozen or clipped; `moved` spans what moves it meanwhile.

        A value below `least`, as of an empty muscle, may stay the same.
        """
        self.samples += 1
        if value == self.value:
            self.repeats += 1
            has_moved = moved.recent > FROZEN_SHARE * moved.whole > 0.0
            if time - self.since > FROZEN_TIME and has_moved and value > least:
                self.frozen = max(self.frozen, time - self.since)
        else:
            self.value, self.since = value, time
            moved.restart()
        self.at_high = self.at_high + 1 if value == self.high else self.at_high
        self.at_high = 1 if value > self.high else self.at_high
        self.at_low = self.at_low + 1 if value == self.low else self.at_low
        self.at_low = 1 if value < self.low else self.at_low

    def clipped(self, *, at_low: bool) -> float:
        """Share of the samples at an end of the range of a sensor whose noise shows."""
        inside = self.repeats - max(self.at_high - 1, 0) - max(self.at_low - 1, 0)
        if self.samples < FEWEST_SAMPLES or inside > 0.1 * self.samples:
            return 0.0
        return max(self.at_high, self.at_low if at_low else 0) / self.samples

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


def progress_line(duration: float, missing: Sequence[str]) -> str:
    """What is told while recording.

    Parameters
    ----------
    duration : float
        Recorded so far [s].
    missing : sequence of str
        From `RecordingAdvice.missing`.
    """
    if not missing:
        return f"{duration:.0f} s: nothing is missing any more; Ctrl-C ends the recording"
    return f"{duration:.0f} s, still missing: {'; '.join(missing)}"


class RecordingAdvice:
    """Watches the messages of a recording."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._begin = math.nan
        self._last = math.nan
        self._counts: dict[str, int] = {}
        self._intervals = MessageIntervals(DEFAULT)
        self._pushes = {joint.name: _Span() for joint in rig.joints}
        self._moves = {muscle.name: _Span() for muscle in rig.muscles}
        self._joint_of = {name: joint.name for joint in rig.joints for name in joint.muscles}
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
        stamp: float = 0.0,
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
        stamp : float
            Stamp of the message [s]; 0 if it has none.
        """
        if math.isnan(self._begin):
            self._begin = time
        self._last = time
        self._counts[topic] = self._counts.get(topic, 0) + 1
        if topic in (PRESSURES, POSITIONS, SENT, COMMANDS):
            self._intervals.take(topic, stamp or time)
        if topic == COMMANDS:
            self._commanded = time
        if topic == POSITIONS:
            for name, value in zip(names, position, strict=False):
                if name in self._joints and math.isfinite(value):
                    self._joints[name].watch(time, value, self._pushes[name])
                    self._joints[name].take(time, value, STILL_ANGLE)
                    for muscle in self._rig.joint(name).muscles:
                        self._moves[muscle].take(value)
        elif topic == PRESSURES:
            for name, value in zip(names, effort, strict=False):
                if name in self._muscles and math.isfinite(value):
                    most = self._rig.muscle(name).max_pressure
                    still = STILL_SHARE * most
                    self._muscles[name].watch(time, value, self._moves[name], EMPTY_SHARE * most)
                    self._muscles[name].take(time, value, still)
                    self._push(name)

    def _push(self, muscle: str) -> None:
        """Note the difference of the pressures of a joint, which moves its encoder."""
        joint = self._joint_of.get(muscle)
        if joint is None:
            return
        first, second = (self._muscles[name].value for name in self._rig.joint(joint).muscles)
        if math.isfinite(first - second):
            self._pushes[joint].take(first - second)

    def missing(self) -> list[str]:
        """What is still missing, most important first; empty if the recording is complete."""
        found = self._missing_topics() + self._intervals.faults() + self._stuck()
        useful = self._intervals.useful_time(self.duration)
        if useful < 0.999 * WANTED_DURATION:
            gaps = " without gaps" if useful < 0.99 * self.duration else ""
            found.append(f"length: {useful:.0f} s of {WANTED_DURATION:.0f} s{gaps}")
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

    def _stuck(self) -> list[str]:
        """Sensors that repeat a value while the rest moves, or stand at an end of their range."""
        sensors = [(f"{name}'s position", seen, True) for name, seen in self._joints.items()]
        sensors += [(f"{name}'s pressure", seen, False) for name, seen in self._muscles.items()]
        found = []
        for name, seen, at_low in sensors:
            if seen.frozen > 0.0:
                found.append(
                    f"frozen: {name} stayed the same for {seen.frozen:.0f} s although the robot "
                    "moved; look at the sensor and its cable, and record again"
                )
            share = seen.clipped(at_low=at_low)
            if share > CLIPPED_SHARE:
                found.append(
                    f"clipped: {name} stands at an end of its range for {share:.0%} of the time"
                )
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
