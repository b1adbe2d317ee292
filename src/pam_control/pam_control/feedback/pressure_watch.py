"""Watches a pressure loop for chatter and lowers its gain.

A loop whose valve, tube or sensor is slower than told, or whose sensor sees a smaller volume than
told (as behind a tube), oscillates many times faster than the joint can follow. Then the pressure
error changes its sign again and again with peaks far above the noise. Half waves that do not fade
are counted; six in a row lower the gain. The gain stays low until the joint is taken over anew,
because the cause is still there.
"""

from __future__ import annotations

import math
from typing import Any, Final

from pam_control.rows.loop_rows import (
    N_THRESHOLD,
    V_BEFORE,
    V_COUNT,
    V_FACTOR,
    V_LASTED,
    V_PEAK,
    V_SIGN,
    V_SLOW,
)

HALF_WAVES: Final = 6
LONGEST: Final = 0.06  # s, of a half wave
SLOW: Final = 0.05  # s; what changes more slowly is no chatter
LEAST_SHARE: Final = 0.005  # of the muscle's maximum pressure; smaller half waves are noise
FADING: Final = 0.7  # a half wave below this share of the one before means that it fades
STEP_DOWN: Final = 0.6
LEAST_FACTOR: Final = 0.1


def begin_watch(v: Any) -> None:
    """Forget what was seen; the gain is that of the design."""
    v[V_FACTOR] = 1.0
    v[V_SLOW] = math.nan
    begin_count(v)


def begin_count(v: Any) -> None:
    """Forget the half waves."""
    v[V_SIGN], v[V_PEAK], v[V_BEFORE] = 0.0, 0.0, 0.0
    v[V_LASTED], v[V_COUNT] = 0.0, 0.0


def watch_pressure(n: Any, v: Any, error: float, step: float) -> float:
    """Take a pressure error [Pa] after `step` [s]; return the factor of the gain."""
    if math.isnan(v[V_SLOW]):
        v[V_SLOW] = error
    v[V_SLOW] += step / (SLOW + step) * (error - v[V_SLOW])
    fast = error - v[V_SLOW]
    if fast * v[V_SIGN] <= 0.0:
        lasts = v[V_PEAK] >= max(n[N_THRESHOLD], FADING * v[V_BEFORE])
        v[V_COUNT] = v[V_COUNT] + 1.0 if lasts and v[V_LASTED] <= LONGEST else 0.0
        v[V_BEFORE], v[V_PEAK], v[V_LASTED] = v[V_PEAK], 0.0, 0.0
        v[V_SIGN] = math.copysign(1.0, fast)
    v[V_PEAK] = max(v[V_PEAK], abs(fast))
    v[V_LASTED] += step
    if v[V_COUNT] >= HALF_WAVES:
        v[V_FACTOR] = max(STEP_DOWN * v[V_FACTOR], LEAST_FACTOR)
        begin_count(v)
    return float(v[V_FACTOR])
