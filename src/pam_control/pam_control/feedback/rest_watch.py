"""Watches a joint whose reference rests for swings that are too slow or small for `loop_watch`.

A loop with more delay than its gains bear, or with dry friction and an integral, may swing about
its target with an amplitude of some milliradians, whose speed is far below that of any motion. At
rest nothing else moves the joint, so that a few equal swings tell it: from one turning point to the
next the joint moves by about the same way in about the same time, again and again. Settling after a
motion fades, a blow fades, and pushes by hand are not that regular.

A joint that sticks stays most of the time near its turning points. One that a delay keeps swinging
moves like a sine, which is there for 59 % of the time.

Source: K. J. Astrom and T. Hagglund, Advanced PID Control, ISA 2006, section 10.5 (detection of
oscillating loops by the areas between zero crossings, and stiction by their shape; here by turning
points, because a resting joint's mean is unknown).
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

SWINGS: Final = 4  # this many equal ones in a row are an oscillation
LEAST: Final = 3e-3  # rad, from one turning point to the next; smaller ones are harmless
TURN: Final = 1e-3  # rad back from the farthest place make a turning point
SHORTEST, LONGEST = 0.025, 1.7  # s, duration of a swing: 20 to 0.3 Hz
FADING: Final = 0.75  # a swing below this share of the one before means that the motion fades
UNEVEN: Final = 1.6  # ratio of durations above which two swings are not of one oscillation
SETTLES: Final = 0.3  # s of rest before anything counts
NEAR: Final = 0.2  # of a swing, about a turning point
STUCK: Final = 0.8  # share of the time near the turning points, by which a joint sticks
KEPT: Final = 4.0 * LONGEST  # s


class RestWatch:
    """The turning points of one joint while all references rest."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget what was seen."""
        self._since = math.inf
        self._clear()

    def _clear(self) -> None:
        self._direction = 0.0
        self._farthest = self._turned = math.nan  # position and, of the last turning point, time
        self._reached = 0.0  # when the farthest place was reached
        self._last = math.nan  # position of the last turning point
        self._size, self._duration = 0.0, math.inf  # of the swing before
        self._count = 0
        self._places: deque[tuple[float, float]] = deque()

    def update(self, time: float, position: float, rests: bool) -> str:
        """Take a measured position [rad] at a time [s]; return what is wrong, or an empty text."""
        if not rests:
            self.reset()
            return ""
        self._since = min(self._since, time)
        if time - self._since < SETTLES:
            return ""
        self._places.append((time, position))
        if self._places[0][0] < time - KEPT:
            self._places.popleft()
        if math.isnan(self._farthest):
            self._farthest, self._reached = position, time
        ahead = position - self._farthest
        if self._direction == 0.0:
            if abs(ahead) > TURN:
                self._direction = math.copysign(1.0, ahead)
                self._last, self._turned = self._farthest, self._reached
        elif ahead * self._direction < -TURN:
            self._end_swing()
            self._direction = -self._direction
        else:
            if ahead * self._direction > 0.0:
                self._farthest, self._reached = position, time
            return ""
        if self._direction != 0.0:
            self._farthest, self._reached = position, time
        return self._told() if self._count >= SWINGS else ""

    def _end_swing(self) -> None:
        size, duration = abs(self._farthest - self._last), self._reached - self._turned
        if size < LEAST or not SHORTEST <= duration <= LONGEST:
            self._count = 0
        elif size < FADING * self._size or not 1.0 / UNEVEN < duration / self._duration < UNEVEN:
            self._count = 1
        else:
            self._count += 1
        self._last, self._turned = self._farthest, self._reached
        self._size, self._duration = size, duration

    def _told(self) -> str:
        """What is told of the swings that were seen."""
        begin = self._turned - SWINGS * self._duration
        places = [position for time, position in self._places if begin <= time <= self._turned]
        low, high = min(places), max(places)
        near = NEAR * (high - low)
        share = sum(not low + near < place < high - near for place in places) / len(places)
        cause = (
            "dry friction that sticks, with the integral of the feedback"
            if share > STUCK
            else "a delay that the rig file does not name"
        )
        return (
            f"the joint swings at rest by {1e3 * self._size:.1f} mrad at "
            f"{0.5 / self._duration:.2g} Hz; likely cause: {cause}"
        )
