"""Lead compensation of a valve's lag: u -> (tau s + 1)/(alpha tau s + 1) u.

The spool then follows the wanted opening with the lag alpha tau. The filter is integrated by
backward Euler: the lagged opening l follows from (u - l)/(alpha tau) = (l - l_before)/step, and the
command is l + tau l'.
"""

from __future__ import annotations

import math


class ValveLead:
    """The compensator of one valve.

    Parameters
    ----------
    time_constant : float
        Lag of the valve, tau [s].
    """

    def __init__(self, time_constant: float) -> None:
        self._time_constant = time_constant
        self.reset()

    def reset(self) -> None:
        """Begin with a valve at rest."""
        self._lagged = math.nan

    def command(self, opening: float, ratio: float, step: float) -> float:
        """The command [-] for a wanted opening [-].

        Parameters
        ----------
        opening : float
            Wanted [-].
        ratio : float
            Part of the lag that remains, alpha [-]; 1: no compensation.
        step : float
            Time since the last call [s].
        """
        lag = ratio * self._time_constant
        if lag <= 0.0 or ratio >= 1.0:
            return opening
        if math.isnan(self._lagged):
            self._lagged = opening
        self._lagged += step / (lag + step) * (opening - self._lagged)
        return self._lagged + (opening - self._lagged) / ratio
