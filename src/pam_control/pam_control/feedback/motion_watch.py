"""Watches a joint's loop for an oscillation, and for an error that lasts.

A loop with more delay than its gains bear oscillates with a growing amplitude. The speed error
(reference minus measured speed) then changes its sign twice in each period, and its peaks do not
become smaller. A blow from outside, a jump of the reference, or noise do not look so: they fade, or
their peaks are small compared with the speed of the reference. A joint that sticks by friction when
its reference turns round is slower than the reference, never faster.

A joint that lags behind a fast reference has a speed error that changes its sign as often as the
reference turns round. That is a forced response, not an oscillation: a half period in which the
reference turns round counts only if its peak is much larger than the reference's own speed.

The watch counts half periods: three that do not fade, or two of which the second is much larger. It
needs no model of the joint and no knowledge of the delay.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

HALF_PERIODS: Final = 3  # this many in a row are an oscillation
SHORTEST, LONGEST = 0.01, 0.6  # s, duration of a half period
LEAST_SHARE: Final = 0.07  # of the joint's largest speed; smaller peaks are noise
REFERENCE_SHARE: Final = 0.5  # of the reference's recent peak speed; smaller peaks are its errors
FORCED_SHARE: Final = 1.5
"""Of the reference's recent peak speed; a lag alone makes smaller errors where it turns round. The
error of a response that is late by a phase p is 2 sin(p/2) of the reference: 1.5 at 97 degrees."""
REFERENCE_MEMORY: Final = 1.0  # s
FADING: Final = 0.75  # a peak below this share of the one before means that the motion fades
GROWING: Final = 1.5  # a peak above this multiple of the one before needs no third half period,
VIOLENT_SHARE: Final = 0.25  # if it is above this share of the joint's largest speed as well
ALARM_SHARE: Final = 0.8  # of the joint's largest speed
ALARM_RATIO: Final = 2.0  # of the reference's recent peak speed; a step's overshoot stays below


class OscillationWatch:
    """The half periods of one joint's speed error.

    Parameters
    ----------
    max_velocity : float
        Largest speed of the joint [rad/s].
    """

    def __init__(self, max_velocity: float) -> None:
        self._max_velocity = max_velocity
        self.reset()

    def reset(self) -> None:
        """Forget what was seen."""
        self._sign = 0.0
        self._since = -math.inf
        self._peak = 0.0
        self._before = math.inf  # peak of the half period before
        self._count = 0
        self._excess = 0.0  # largest in the half periods that count
        self._reference_sign = 0.0
        self._turned = False  # the reference turned round in this half period
        self._reference_peaks: deque[tuple[float, float]] = deque()

    @property
    def is_violent(self) -> bool:
        """Whether the speed error is so large that nothing but soft gains may be tried."""
        return self._peak >= VIOLENT_SHARE * self._max_velocity

    def update(self, time: float, reference_speed: float, speed: float) -> str:
        """Take a measurement; return what is wrong, or an empty text.

        Parameters
        ----------
        time : float
            [s].
        reference_speed, speed : float
            Of the reference and of the joint [rad/s].
        """
        error = reference_speed - speed
        peak_speed = self._reference_peak(time, abs(reference_speed))
        threshold = max(LEAST_SHARE * self._max_velocity, REFERENCE_SHARE * peak_speed)
        if reference_speed != 0.0:
            if reference_speed * self._reference_sign < 0.0:
                self._turned = True
            self._reference_sign = math.copysign(1.0, reference_speed)
        if error * self._sign < 0.0 or self._sign == 0.0:
            self._end_half_period(time, threshold, peak_speed)
            self._sign = math.copysign(1.0, error)
        # comparisons, not max(): this runs for each joint in each cycle
        if (size := abs(error)) > self._peak:
            self._peak = size
        if (excess := _excess(reference_speed, speed)) > self._excess:
            self._excess = excess
        if self._excess >= threshold and self._oscillates(time, threshold, peak_speed):
            peak = max(self._peak, self._before)
            return f"the joint oscillates (speed error {peak:.2g} rad/s)"
        if abs(speed) > ALARM_SHARE * self._max_velocity:
            return self.too_fast(speed, ALARM_RATIO * peak_speed)
        return ""

    def _oscillates(self, time: float, threshold: float, peak_speed: float) -> bool:
        # the half period that is going on counts once it is as large as the one before
        going_on = (
            self._counts(time, threshold)
            and not self._is_forced(peak_speed)
            and self._peak >= FADING * self._before
        )
        violent = self._count > 0 and self._peak >= max(
            GROWING * max(self._before, threshold), VIOLENT_SHARE * self._max_velocity
        )
        return self._count + going_on >= HALF_PERIODS or (going_on and violent)

    def too_fast(self, speed: float, allowed: float = 0.0) -> str:
        """What is wrong with a speed [rad/s] that may be `allowed` [rad/s]; empty if nothing is."""
        size = abs(speed)
        if size > ALARM_SHARE * self._max_velocity and size > allowed:
            return f"the joint moves at {size:.2g} rad/s"
        return ""

    def _reference_peak(self, time: float, reference_speed: float) -> float:
        peaks = self._reference_peaks
        while peaks and peaks[-1][1] <= reference_speed:
            peaks.pop()
        peaks.append((time, reference_speed))
        while peaks[0][0] < time - REFERENCE_MEMORY:
            peaks.popleft()
        return peaks[0][1]

    def _counts(self, time: float, threshold: float) -> bool:
        return self._peak >= threshold and SHORTEST <= time - self._since <= LONGEST

    def _is_forced(self, peak_speed: float) -> bool:
        return self._turned and self._peak < FORCED_SHARE * peak_speed

    def _end_half_period(self, time: float, threshold: float, peak_speed: float) -> None:
        if not self._counts(time, threshold):
            self._count, self._excess = 0, 0.0
        elif not self._is_forced(peak_speed):
            if self._count and self._peak < FADING * self._before:
                self._count, self._excess = 1, 0.0
            else:
                self._count += 1
        self._before, self._peak = self._peak, 0.0
        self._since, self._turned = time, False


def _excess(reference_speed: float, speed: float) -> float:
    """How much faster than its reference a joint moves, or how fast against it [rad/s].

    A joint that sticks is slower than its reference and has none, however large the speed error.
    """
    if speed * reference_speed < 0.0:
        return abs(speed)
    excess = abs(speed) - abs(reference_speed)
    return excess if excess > 0.0 else 0.0


class TrackingWatch:
    """How long the tracking error of one joint is above its limit.

    Parameters
    ----------
    limit : float
        [rad].
    """

    def __init__(self, limit: float) -> None:
        self._limit = limit
        self.reset()

    def reset(self) -> None:
        """Forget what was seen."""
        self._since = math.inf

    def update(self, time: float, error: float, longest: float) -> str:
        """Take an error [rad]; return what is wrong if it lasts `longest` [s], or an empty text."""
        if not abs(error) > self._limit:
            self._since = math.inf
            return ""
        self._since = min(self._since, time)
        if time - self._since < longest:
            return ""
        return (
            f"tracking error {error:+.2f} rad for {time - self._since:.2f} s, limit "
            f"{self._limit:g} rad (max_tracking_error)"
        )
