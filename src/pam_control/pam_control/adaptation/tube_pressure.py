"""Pressure of a muscle behind a tube, from the sensor at the valve.

The sensor shows the pressure in the muscle and what the tube loses. At high frequencies the loss is
most of what it shows, so that a loop about the sensor chatters. Therefore the pressure is observed:
it follows from the flow into the muscle, and is drawn to the shown pressure without the loss,

    dP/dt = (flow - moved)/per_rate + (shown - loss - P)/T

so that what a wrong loss adds to the loop is slow.
"""

from __future__ import annotations

import math
from typing import Final

TRUST: Final = 0.1  # s, T


class TubePressure:
    """The observer of one muscle."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin with what the sensor shows."""
        self._inside = math.nan

    def update(self, step: float, shown: float, loss: float, rate: float) -> float:
        """The pressure in the muscle [Pa gauge], never below 0.

        Parameters
        ----------
        step : float
            Time since the last call [s].
        shown : float
            What the sensor shows [Pa gauge].
        loss : float
            In the tube, positive while the muscle is filled [Pa].
        rate : float
            dP/dt that follows from the flow [Pa/s].
        """
        if math.isnan(self._inside):
            self._inside = shown
        self._inside += rate * step
        self._inside += step / (TRUST + step) * (shown - loss - self._inside)
        self._inside = max(self._inside, 0.0)
        return self._inside
