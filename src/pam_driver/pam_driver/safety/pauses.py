"""Pauses of the computer: nobody looks at the robot, and its valves stay as they were told.

A pause is no fault, but nothing may be concluded from a time in which nobody looked.
"""

from __future__ import annotations

from typing import Final

from pam_driver.safety.pressure_plausibility import LONGEST_GAP

_PERIODS: Final = 3.0
"""At a rate so low that a period is as long as a pause, a longer time is one."""


def longest_gap(period: float) -> float:
    """The longest time between two cycles that is no pause [s].

    Parameters
    ----------
    period : float
        Time between two cycles as it should be [s].
    """
    return max(LONGEST_GAP, _PERIODS * period)
