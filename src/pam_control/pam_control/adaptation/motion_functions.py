"""What a torque that the model lacks may depend on: functions of the motion of a joint.

1, q, q^3               payload, offsets, muscles that are stronger, weaker or softer than written
qd, qdd                 viscous friction, inertia
z_i, slip elements      friction and hysteresis: dz = (dq/d)(1 - z sign(dq)), for several d
q - low pass of q       creep, with two time constants

A sum of slip elements with different lengths d is a generalised Maxwell-slip model: it approximates
hysteresis that does not depend on the rate, from the dry friction of a bearing to threads that rub
on each other.

Source: F. Al-Bender, V. Lampaert, J. Swevers, "The generalized Maxwell-slip model", IEEE
Transactions on Automatic Control 50 (2005) 1883-1887.
"""

from __future__ import annotations

import math
from typing import Final

SLIP_LENGTHS: Final = (0.0015, 0.006, 0.025, 0.1)  # rad
CREEP_TIMES: Final = (0.15, 1.5)  # s
DEVIATIONS: Final = (0.03, 0.1, 0.1, 0.01, 1e-3, *(0.022,) * 6)
"""What is usual for the weight of each function, per torque that the muscles can give at most."""


class MotionMemory:
    """Slip and creep elements along one motion, measured or planned."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin without friction and relaxed."""
        self._position = math.nan
        self._slips = [0.0] * len(SLIP_LENGTHS)
        self._relaxed = [0.0] * len(CREEP_TIMES)

    def advance(self, position: float, step: float) -> list[float]:
        """Move to a position [rad] within a time [s]; return the values of all elements."""
        if math.isnan(self._position):
            self._position = position
            self._relaxed = [position] * len(CREEP_TIMES)
        moved = position - self._position
        self._position = position
        if moved != 0.0:
            sign, back = math.copysign(1.0, moved), -abs(moved)
            self._slips = [
                sign - (sign - z) * math.exp(back / length)
                for z, length in zip(self._slips, SLIP_LENGTHS)  # noqa: B905  (half the time)
            ]
        self._relaxed = [
            relaxed + step / (time + step) * (position - relaxed)
            for relaxed, time in zip(self._relaxed, CREEP_TIMES)  # noqa: B905
        ]
        return self._slips + [position - relaxed for relaxed in self._relaxed]
