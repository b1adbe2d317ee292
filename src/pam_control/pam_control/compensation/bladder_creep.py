"""Creep of a bladder along the lengths it is asked to take: a Maxwell element.

Pull = c K_3 (L - L_c), dL_c/dt = (L - L_c)/tau_c, K_3 the nominal braid's dF/dL at 3 bar and its
rest length. Linear and slow, it is run along the reference; it starts relaxed.

Source: standard linear solid, e.g. J. D. Ferry, Viscoelastic Properties of Polymers, Wiley 1980.
"""

from __future__ import annotations

import math

from pam_model.effects import effect_value
from pam_model.rig import Muscle

REFERENCE_PRESSURE = 3e5  # Pa, at which the ratio is told


class BladderCreep:
    """The stretch of one bladder that has not relaxed yet.

    Parameters
    ----------
    stiffness : float
        c K_3 [N/m].
    time_constant : float
        tau_c [s].
    """

    def __init__(self, stiffness: float, time_constant: float) -> None:
        self.stiffness = stiffness
        self.time_constant = time_constant
        self.stretch = 0.0

    @classmethod
    def from_muscle(cls, muscle: Muscle) -> BladderCreep:
        """With the effect that the rig file names."""
        ratio = effect_value(muscle.effects, "creep", "ratio")
        unit = 6.0 * muscle.rest_length / (4.0 * math.pi * muscle.turns**2)
        return cls(
            ratio * REFERENCE_PRESSURE * unit,
            effect_value(muscle.effects, "creep", "time_constant"),
        )

    def reset(self) -> None:
        """Relaxed."""
        self.stretch = 0.0

    def move(self, stroke: float, step: float) -> None:
        """Lengthen by `stroke` [m] evenly within `step` [s]; exact."""
        if step <= 0.0:
            self.stretch += stroke
            return
        decay = math.exp(-step / self.time_constant)
        self.stretch = self.stretch * decay + stroke * self.time_constant / step * (1.0 - decay)

    @property
    def force(self) -> float:
        """Pull it adds [N]."""
        return self.stiffness * self.stretch
