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

from pam_control.feedback.pid import PidGains


@dataclass(frozen=True, slots=True)
class GainSchedule:
    """Gains at increasing stiffnesses.

    Attributes
    ----------
    stiffnesses : tuple of float
        (n,), increasing; of the model, at which the gains were designed [N m/rad].
    gains : tuple of PidGains
        (n,). They share their filter.
    """

    stiffnesses: tuple[float, ...]
    gains: tuple[PidGains, ...]

    @classmethod
    def constant(cls, gains: PidGains) -> GainSchedule:
        """The same gains at every stiffness."""
        return cls((0.0,), (gains,))

    def at(self, stiffness: float) -> PidGains:
        """The gains at a stiffness [N m/rad]; those of the nearest end outside the range."""
        places, gains = self.stiffnesses, self.gains
        for index in range(1, len(places)):
            if stiffness < places[index]:
                share = (stiffness - places[index - 1]) / (places[index] - places[index - 1])
                if share <= 0.0:
                    return gains[index - 1]
                return _between(gains[index - 1], gains[index], share)
        # not a number: the stiffness is not known yet
        return gains[-1] if stiffness >= places[-1] else gains[0]

    def changed(self, change: Callable[[PidGains], PidGains]) -> GainSchedule:
        """The schedule with all of its gains changed in the same way."""
        return GainSchedule(self.stiffnesses, tuple(map(change, self.gains)))

    def replaced(self, given: Mapping[str, float]) -> GainSchedule:
        """The schedule with some gains by name the same at every stiffness."""
        return self.changed(lambda gains: dataclasses.replace(gains, **given))


def _between(low: PidGains, high: PidGains, share: float) -> PidGains:
    rest = 1.0 - share
    return PidGains(
        rest * low.proportional + share * high.proportional,
        rest * low.integral + share * high.integral,
        rest * low.derivative + share * high.derivative,
        low.derivative_filter,
        rest * low.observer + share * high.observer,
        low.lead,
    )
