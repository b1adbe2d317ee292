"""Watches a pressure loop for chatter and lowers its gain.

A loop whose valve, tube or sensor is slower than told, or whose sensor sees a smaller volume than
told (as behind a tube), oscillates many times faster than the joint can follow. Then the pressure
error changes its sign again and again with peaks far above the noise. Half waves that do not fade
are counted; six in a row lower the gain. The gain stays low until the joint is taken over anew,
because the cause is still there.
"""

from __future__ import annotations

import math
from typing import Final

HALF_WAVES: Final = 6
LONGEST: Final = 0.06  # s, of a half wave
SLOW: Final = 0.05  # s; what changes more slowly is no chatter
LEAST_SHARE: Final = 0.005  # of the muscle's maximum pressure; smaller half waves are noise
FADING: Final = 0.7  # a half wave below this share of the one before means that it fades
STEP_DOWN: Final = 0.6
LEAST_FACTOR: Final = 0.1


class PressureWatch:
    """The half waves of one pressure error.

    Parameters
    ----------
    max_pressure : float
        Of the muscle [Pa].

    Attributes
    ----------
    factor : float
        By which the gain of the loop is to be multiplied [-].
    """

    def __init__(self, max_pressure: float) -> None:
        self._threshold = LEAST_SHARE * max_pressure
        self.reset()

    def reset(self) -> None:
        """Forget what was seen; the gain is that of the design."""
        self.factor = 1.0
        self._slow = math.nan
        self._begin_count()

    def _begin_count(self) -> None:
        self._sign, self._peak, self._before = 0.0, 0.0, 0.0
        self._lasted, self._count = 0.0, 0

    def update(self, error: float, step: float) -> float:
        """Take a pressure error [Pa] after `step` [s]; return the factor of the gain."""
        if math.isnan(self._slow):
            self._slow = error
        self._slow += step / (SLOW + step) * (error - self._slow)
        fast = error - self._slow
        if fast * self._sign <= 0.0:
            self._end_half_wave()
            self._sign = math.copysign(1.0, fast)
        self._peak = max(self._peak, abs(fast))
        self._lasted += step
        if self._count >= HALF_WAVES:
            self.factor = max(STEP_DOWN * self.factor, LEAST_FACTOR)
            self._begin_count()
        return self.factor

    def _end_half_wave(self) -> None:
        lasts = self._peak >= max(self._threshold, FADING * self._before)
        self._count = self._count + 1 if lasts and self._lasted <= LONGEST else 0
        self._before, self._peak, self._lasted = self._peak, 0.0, 0.0
