"""Thread friction of a muscle along the lengths it is asked to take.

Pull = h p b^2/(4 pi n^2) z with dz = (1 - sign(dL) z) dL/s_p: rate-independent, so that it can be
run along the reference ahead of time. It starts at z = 0, since nothing tells the state in which
the muscle was left; one stroke of a few s_p in the same direction makes up for that.

Source: P. R. Dahl, "Solid friction damping of mechanical vibrations", AIAA Journal 14(12), 1976.
"""

from __future__ import annotations

import math

from pam_model.effects import effect_value
from pam_model.rig import Muscle


class ThreadHysteresis:
    """The friction state of one muscle along its reference.

    Parameters
    ----------
    area : float
        Saturated friction per pressure, h b^2/(4 pi n^2) [m^2].
    presliding_length : float
        s_p, stroke over which friction builds up [m].
    """

    def __init__(self, area: float, presliding_length: float) -> None:
        self.area = area
        self.presliding_length = presliding_length
        self.state = 0.0

    @classmethod
    def from_muscle(cls, muscle: Muscle) -> ThreadHysteresis:
        """With the effect that the rig file names."""
        amplitude = effect_value(muscle.effects, "hysteresis", "amplitude")
        unit = muscle.thread_length**2 / (4.0 * math.pi * muscle.turns**2)
        return cls(
            amplitude * unit, effect_value(muscle.effects, "hysteresis", "presliding_length")
        )

    def reset(self) -> None:
        """Forget the past."""
        self.state = 0.0

    def move(self, stroke: float) -> None:
        """Lengthen by `stroke` [m]; exact for a monotonic stroke of any size."""
        if stroke != 0.0:
            end = math.copysign(1.0, stroke)
            self.state = end + (self.state - end) * math.exp(-abs(stroke) / self.presliding_length)

    def force(self, pressure: float) -> float:
        """Pull it adds [N] at a gauge pressure [Pa]."""
        return self.area * max(pressure, 0.0) * self.state
