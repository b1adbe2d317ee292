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
from typing import Any, Final

from pam_control.plan_memory import newest
from pam_control.rows.watch_rows import (
    B_BEFORE,
    B_COUNT,
    B_EXCESS,
    B_FOUND,
    B_LARGEST_ERROR,
    B_LARGEST_SPEED,
    B_LOST_SINCE,
    B_PEAK,
    B_REFERENCE_SIGN,
    B_SIGN,
    B_SINCE,
    B_TURNED,
)

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


NOTHING, LOST, OSCILLATES, FAST = range(4)
"""What may be found: nothing, a tracking error that lasts, an oscillation, a speed too large."""


def begin_tracking(b: Any) -> None:
    """Forget what was seen of the error."""
    b[B_LOST_SINCE] = math.inf


def is_lost(b: Any, time: float, error: float, longest: float) -> bool:
    """Take a tracking error [rad]; return whether it is too large for `longest` [s]."""
    if not abs(error) > b[B_LARGEST_ERROR]:
        b[B_LOST_SINCE] = math.inf
        return False
    b[B_LOST_SINCE] = min(b[B_LOST_SINCE], time)
    return bool(time - b[B_LOST_SINCE] >= longest)


def begin_oscillation(b: Any, ends: Any) -> None:
    """Forget what was seen of the speed; `ends` are those of the reference's peaks."""
    b[B_SIGN], b[B_SINCE], b[B_PEAK], b[B_BEFORE] = 0.0, -math.inf, 0.0, math.inf
    b[B_COUNT], b[B_EXCESS], b[B_REFERENCE_SIGN], b[B_TURNED] = 0.0, 0.0, 0.0, 0.0
    ends[0], ends[1] = 0, 0


def watch_oscillation(
    b: Any, peaks: Any, ends: Any, time: float, reference_speed: float, speed: float
) -> int:
    """Take a measurement; return what is found of it.

    Parameters
    ----------
    b, peaks, ends : row, rows, (int, int)
        Of the joint (`watch_rows`), and of the latest peaks of the reference's speed: time, speed.
    time : float
        [s].
    reference_speed, speed : float
        Of the reference and of the joint [rad/s].
    """
    error = reference_speed - speed
    peak_speed = reference_peak(peaks, ends, time, abs(reference_speed))
    threshold = max(LEAST_SHARE * b[B_LARGEST_SPEED], REFERENCE_SHARE * peak_speed)
    if reference_speed != 0.0:
        if reference_speed * b[B_REFERENCE_SIGN] < 0.0:
            b[B_TURNED] = 1.0
        b[B_REFERENCE_SIGN] = math.copysign(1.0, reference_speed)
    if error * b[B_SIGN] < 0.0 or b[B_SIGN] == 0.0:
        end_half_period(b, time, threshold, peak_speed)
        b[B_SIGN] = math.copysign(1.0, error)
    b[B_PEAK] = max(b[B_PEAK], abs(error))
    b[B_EXCESS] = max(b[B_EXCESS], excess_of(reference_speed, speed))
    if b[B_EXCESS] >= threshold and oscillates(b, time, threshold, peak_speed):
        return OSCILLATES
    return FAST if is_fast(b, speed, ALARM_RATIO * peak_speed) else NOTHING


def reference_peak(peaks: Any, ends: Any, time: float, speed: float) -> float:
    """Take the size of the reference's speed; return the largest one lately [rad/s]."""
    while ends[1] > 0 and peaks[newest(peaks, ends)][1] <= speed:
        ends[1] -= 1
    ends[1] += 1
    row = peaks[newest(peaks, ends)]
    row[0], row[1] = time, speed
    while peaks[ends[0]][0] < time - REFERENCE_MEMORY:
        ends[0] = (ends[0] + 1) % len(peaks)
        ends[1] -= 1
    return float(peaks[ends[0]][1])


def oscillates(b: Any, time: float, threshold: float, peak_speed: float) -> bool:
    """Whether enough half periods were seen."""
    # the half period that is going on counts once it is as large as the one before
    going_on = (
        counts(b, time, threshold)
        and not is_forced(b, peak_speed)
        and b[B_PEAK] >= FADING * b[B_BEFORE]
    )
    violent = b[B_COUNT] > 0.0 and b[B_PEAK] >= max(
        GROWING * max(b[B_BEFORE], threshold), VIOLENT_SHARE * b[B_LARGEST_SPEED]
    )
    seen = b[B_COUNT] + (1.0 if going_on else 0.0)
    return bool(seen >= HALF_PERIODS or (going_on and violent))


def is_fast(b: Any, speed: float, allowed: float) -> bool:
    """Whether a speed [rad/s] is too large, and larger than `allowed` [rad/s]."""
    size = abs(speed)
    return bool(size > ALARM_SHARE * b[B_LARGEST_SPEED] and size > allowed)


def is_violent(b: Any) -> bool:
    """Whether the speed error is so large that nothing but soft gains may be tried."""
    return bool(b[B_PEAK] >= VIOLENT_SHARE * b[B_LARGEST_SPEED])


def counts(b: Any, time: float, threshold: float) -> bool:
    """Whether this half period counts."""
    return bool(b[B_PEAK] >= threshold and SHORTEST <= time - b[B_SINCE] <= LONGEST)


def is_forced(b: Any, peak_speed: float) -> bool:
    """Whether this half period follows from a reference that turned round."""
    return bool(b[B_TURNED] > 0.0 and b[B_PEAK] < FORCED_SHARE * peak_speed)


def end_half_period(b: Any, time: float, threshold: float, peak_speed: float) -> None:
    """Begin the next half period."""
    if not counts(b, time, threshold):
        b[B_COUNT], b[B_EXCESS] = 0.0, 0.0
    elif not is_forced(b, peak_speed):
        if b[B_COUNT] > 0.0 and b[B_PEAK] < FADING * b[B_BEFORE]:
            b[B_COUNT], b[B_EXCESS] = 1.0, 0.0
        else:
            b[B_COUNT] += 1.0
    b[B_BEFORE], b[B_PEAK] = b[B_PEAK], 0.0
    b[B_SINCE], b[B_TURNED] = time, 0.0


def excess_of(reference_speed: float, speed: float) -> float:
    """How much faster than its reference a joint moves, or how fast against it [rad/s].

    A joint that sticks is slower than its reference and has none, however large the speed error.
    """
    if speed * reference_speed < 0.0:
        return abs(speed)
    return max(abs(speed) - abs(reference_speed), 0.0)


def what_was_found(b: Any, time: float, error: float, speed: float) -> str:
    """What is wrong with the joint of a row in this cycle, in words.

    Parameters
    ----------
    b : row
        Of a joint with which something is wrong.
    time, error, speed : float
        Of the cycle [s], [rad], [rad/s].
    """
    found = b[B_FOUND]
    if found == LOST:
        return (
            f"tracking error {error:+.2f} rad for {time - b[B_LOST_SINCE]:.2f} s, limit "
            f"{b[B_LARGEST_ERROR]:g} rad (max_tracking_error)"
        )
    if found == OSCILLATES:
        peak = max(b[B_PEAK], b[B_BEFORE])
        return f"the joint oscillates (speed error {peak:.2g} rad/s)"
    return f"the joint moves at {abs(speed):.2g} rad/s"
