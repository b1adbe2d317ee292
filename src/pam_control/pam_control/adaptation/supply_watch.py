"""How much lower the supply's pressure is than it should be, as the flows of all valves show it.

All valves of a robot draw from one supply. When its pressure sags, each valve that fills gets less
than its data and what was learnt of it promise, at once; the fit of a single valve, which remembers
seconds of work, follows too slowly, and knows nothing of a valve that has not filled since. So one
number is found from the flows of all of them.

It is a constant that a Kalman filter finds anew after a surprise: a flow that differs from the
promised one by more than the fit of its valve holds possible. A valve of which little is known yet
is never a surprise, so that its own errors are left to its fit. The supply is only believed to be
lower, and only beyond what noise and trifles explain. What lasts fades, and the fits learn it.

Source: R. E. Kalman, "A new approach to linear filtering and prediction problems", J. Basic Eng. 82
(1960) 35-45. The sensitivity follows from ISO 6358.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from pam_control.limited import limited

SURPRISE: Final = 3.0  # standard deviations of the promised flow
UNKNOWN: Final = 0.15  # of the pressure, standard deviation after a surprise
CORRELATED: Final = 0.06  # s, for which two samples of a filtered flow are about the same
LOWEST: Final = -0.6
TRIFLE: Final = 0.03  # of the pressure
SURE: Final = 2.0  # standard deviations
FOLLOWS: Final = 0.2  # s; a faster change of the flows is a push, as the position loop has answered
FADES: Final = 10.0  # s of filling; what lasts is left to the fits of the valves
LARGEST_SLOPE: Final = 5.0  # of the flow by the pressure, both relative


def flow_slope(ratio: float, critical: float) -> float:
    """Relative change of a flow by that of the pressure before the valve [-].

    Parameters
    ----------
    ratio : float
        Pressure behind the valve over that before it, absolute [-].
    critical : float
        Critical pressure ratio b [-].
    """
    if ratio <= critical:
        return 1.0
    over = ratio - critical
    left = (1.0 - critical) ** 2 - over * over
    return min(1.0 + ratio * over / left, LARGEST_SLOPE) if left > 0.0 else LARGEST_SLOPE


class SupplyWatch:
    """The sag of a supply.

    Attributes
    ----------
    acts : float
        Sag that is used, 0 or negative, of the pressure before the valves [-].
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """The supply is as it should be."""
        self.acts, self._found, self._variance = 0.0, 0.0, 0.0

    @property
    def rest(self) -> float:
        """Sag that was found and is not used [-]."""
        return self._found - self.acts

    def learn(
        self, missing: float, slope: float, variance: Callable[[], float], since: float
    ) -> None:
        """Take a sample of a valve that fills.

        Parameters
        ----------
        missing : float
            Flow beyond that which valve data, fit and the supply as it should be promise, of the
            full flow [-].
        slope : float
            Change of the promised flow by the sag, of the full flow [-].
        variance : callable
            Of the promised flow.
        since : float
            Time since the last sample of this valve [s].
        """
        self._found *= math.exp(-since / FADES)
        innovation, expected = missing - slope * self.rest, variance()
        if innovation * innovation > SURPRISE**2 * expected:
            self._variance = UNKNOWN**2
        spread = expected * CORRELATED / since
        gain = self._variance * slope / (slope * slope * self._variance + spread)
        self._found = limited(self._found + gain * innovation, LOWEST, 0.0)
        self._variance *= 1.0 - gain * slope
        sure = -self._found > max(TRIFLE, SURE * math.sqrt(self._variance))
        goal = self._found if sure else 0.0
        self.acts += since / (FOLLOWS + since) * (goal - self.acts)
