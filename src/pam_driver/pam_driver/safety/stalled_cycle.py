"""Notices that one cycle of a loop goes on and on, which nobody else on this computer can."""

from __future__ import annotations

from typing import Final

from pam_ros.periodic import Loop

TURNS: Final = 3
"""Turns of the watch within one cycle, after which the cycle has stalled."""


class StalledCycleWatch:
    """Counts how often it looks at a loop within one of its cycles.

    Turns are counted and not time, since a process that was halted has not stalled.

    Parameters
    ----------
    period : float
        Time between two looks [s].
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._cycle = self._turns = 0

    def look(self, loop: Loop) -> str:
        """What is wrong with the loop, once for each cycle that stalls; empty if nothing is."""
        cycles = loop.statistics.cycles
        self._turns = self._turns + 1 if cycles == self._cycle else 0
        self._cycle = cycles
        if loop.busy and self._turns == TURNS:
            return f"a cycle has not returned within {TURNS * self._period:g} s"
        return ""
