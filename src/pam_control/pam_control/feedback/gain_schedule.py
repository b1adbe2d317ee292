"""Gains of a joint as a function of its stiffness.

The stiffness of the muscles is the larger part of the spring that the feedback works against: one
set of gains for the whole range would be limited by its stiffest point in the proportional part and
by its softest point in the integral part. Between two designed stiffnesses every gain is linear;
outside them it is constant. The margins are checked at the designed stiffnesses and between them
(`loop_design`).

Source: W. J. Rugh and J. S. Shamma, "Research on gain scheduling", Automatica 36 (2000) 1401-1425,
section 3 (linear designs at operating points, interpolation, check between them).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pam_control.feedback.pid import G_FILTER, G_LEAD, G_MOTION, N_GAINS, PidGains


@dataclass(frozen=True, slots=True)
class GainSchedule:
    """Gains at increasing stiffnesses."""

    # (n,), increasing; of the model, at which the gains were designed [N m/rad]
    stiffnesses: tuple[float, ...]
    gains: tuple[PidGains, ...]  # (n,). They share their filter.

    @classmethod
    def constant(cls, gains: PidGains) -> GainSchedule:
        """The same gains at every stiffness."""
        return cls((0.0,), (gains,))

    def at(self, stiffness: float) -> PidGains:
        """The gains at a stiffness [N m/rad]; those of the nearest end outside the range."""
        found = [0.0] * N_GAINS
        gains_at(self.row, 0, len(self.stiffnesses), stiffness, found, 0)
        return PidGains(*found)

    @property
    def row(self) -> list[float]:
        """Each stiffness, followed by its gains."""
        pairs = zip(self.stiffnesses, self.gains, strict=True)
        return [number for place, gains in pairs for number in (place, *gains.row)]

    def changed(self, change: Callable[[PidGains], PidGains]) -> GainSchedule:
        """The schedule with all of its gains changed in the same way."""
        return GainSchedule(self.stiffnesses, tuple(map(change, self.gains)))

    def replaced(self, given: Mapping[str, float]) -> GainSchedule:
        """The schedule with some gains by name the same at every stiffness."""
        return self.changed(lambda gains: dataclasses.replace(gains, **given))


def gains_at(row: Any, at: int, count: float, stiffness: float, found: Any, to: int) -> None:
    """Write the gains at a stiffness [N m/rad]; those of the nearest end outside the range.

    Parameters
    ----------
    row, at : row, int
        Holds `GainSchedule.row` from a place on.
    count : float
        Number of the stiffnesses.
    stiffness : float
        Not a number: it is not known yet.
    found, to : row, int
        Where the gains are written.
    """
    size, share = 1 + N_GAINS, 1.0
    low = high = (
        at + size * (int(count) - 1) if stiffness >= row[at + size * (int(count) - 1)] else at
    )
    for index in range(1, int(count)):
        place = at + size * index
        if stiffness < row[place]:
            before = row[place - size]
            share = (stiffness - before) / (row[place] - before)
            low = high = place - size
            if share > 0.0:
                high = place
            break
    for number in range(N_GAINS):
        first, second = row[low + 1 + number], row[high + 1 + number]
        if low == high or number in (G_FILTER, G_LEAD, G_MOTION):
            found[to + number] = first
        else:
            found[to + number] = (1.0 - share) * first + share * second
