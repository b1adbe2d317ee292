"""Shifts a loop so that its cycles begin shortly after what they wait for has arrived.

Boards, driver and controller have clocks of their own. Without this, a measurement waits for half a
cycle on average, and for a whole one at worst, in the driver and again in the controller. The shift
in one cycle is small, so that the time between two cycles stays almost constant. Of several boards,
the newest measurement counts: a loop that followed the oldest would stop where one board's arrives,
and take it now a cycle early and now a cycle late.
"""

from __future__ import annotations

from typing import Final

from pam_ros.periodic import Loop

WAIT: Final = 0.00025
"""How long after the arrival a cycle should begin, as an allowance for jitter [s]."""
_GAIN: Final = 0.05
_MOST: Final = 0.02  # of a period, in one cycle
_STEADY: Final = 0.1  # of a period, from one cycle to the next; inputs of another rate move faster


class PhaseFollower:
    """Keeps the phase of one loop.

    Parameters
    ----------
    loop : Loop
        The loop, which calls `follow` in its own thread.
    """

    def __init__(self, loop: Loop) -> None:
        self._loop = loop
        self._late = 0.0

    def follow(self, age: float) -> None:
        """Take the age of the newest input at the begin of a cycle [s].

        Ignored are an old one, and one whose phase is far from that in the cycle before: the inputs
        then have another rate, to which the loop must not be pulled.
        """
        period = self._loop.period
        if not 0.0 <= age < 2.0 * period:
            return
        late = (age - WAIT + 0.5 * period) % period - 0.5 * period
        moved, self._late = abs(late - self._late), late
        if min(moved, period - moved) > _STEADY * period:
            return
        most = _MOST * period
        self._loop.shift(-min(max(_GAIN * late, -most), most))
