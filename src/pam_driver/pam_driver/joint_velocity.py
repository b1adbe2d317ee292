"""Velocity from angle samples: backward difference through a first-order low pass.

The filter is discretised exactly for the interval of each sample, so that lost frames and jitter
of the stamps do not change its bandwidth.
"""

from __future__ import annotations

import math


class JointVelocity:
    """Differentiates one joint's angle.

    Parameters
    ----------
    bandwidth : float
        -3 dB frequency of the low pass [Hz].
    longest_gap : float
        The filter restarts after a longer gap between samples [s].
    """

    def __init__(self, bandwidth: float, longest_gap: float) -> None:
        self.value = math.nan
        self._rate = 2.0 * math.pi * bandwidth
        self._longest_gap = longest_gap
        self._position = math.nan
        self._time = -math.inf

    def update(self, position: float, time: float) -> float:
        """Velocity [rad/s] after a sample; 0 after the first.

        Parameters
        ----------
        position : float
            [rad].
        time : float
            Time of the measurement, monotonic [s]; a sample that is not newer changes nothing.
        """
        interval = time - self._time
        if interval <= 0.0:
            return self.value
        if interval > self._longest_gap:
            self.value = 0.0
        else:
            difference = (position - self._position) / interval
            weight = 1.0 - math.exp(-self._rate * interval)
            self.value += weight * (difference - self.value)
        self._position = position
        self._time = time
        return self.value

    def reset(self) -> None:
        """Restart the filter; the velocity is NaN until the next sample."""
        self.value = math.nan
        self._time = -math.inf
