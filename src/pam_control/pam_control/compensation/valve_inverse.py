"""From the opening a flow valve should have to the spool position that gives it.

Undone, outermost first: an exhaust path that passes less than the supply path, the overlap of the
spool (no flow while |x| < x_o, from there evenly up to full opening at 1), a closed position that
is not at zero. Within ROUNDED of the closed position the jump across the overlap is a straight
line: a valve that crosses its overlap with every noise of a pressure sensor wears and hisses.

Source: dead-zone inverse as in G. Tao, P. V. Kokotovic, Adaptive Control of Systems with Actuator
and Sensor Nonlinearities, Wiley 1996.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pam_model.effects import effect_value
from pam_model.rig import Muscle

ROUNDED = 0.01  # of full opening


@dataclass(frozen=True, slots=True)
class ValveInverse:
    """One valve's imperfections; at their defaults nothing changes.

    Attributes
    ----------
    exhaust_ratio : float
        Exhaust over supply conductance [-].
    overlap : float
        Spool travel without flow, each way [-].
    null_offset : float
        Opening at zero command [-].
    """

    exhaust_ratio: float = 1.0
    overlap: float = 0.0
    null_offset: float = 0.0

    @classmethod
    def from_muscle(cls, muscle: Muscle) -> ValveInverse:
        """With the effects that the rig file names."""
        return cls(
            effect_value(muscle.effects, "exhaust_restriction", "ratio"),
            effect_value(muscle.effects, "valve_dead_zone", "overlap"),
            effect_value(muscle.effects, "valve_null_offset", "offset"),
        )

    def opening(self, nominal: float) -> float:
        """The opening [-] that passes what `nominal` would on a valve with two equal paths."""
        return nominal / self.exhaust_ratio if nominal < 0.0 else nominal

    def spool(self, opening: float) -> float:
        """The spool position [-] with this opening [-]."""
        if self.overlap > 0.0:
            size = abs(opening)
            jump = self.overlap * min(size / ROUNDED, 1.0)
            opening = math.copysign(jump + (1.0 - self.overlap) * size, opening)
        return opening - self.null_offset
