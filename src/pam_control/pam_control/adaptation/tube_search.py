"""Whether a tube lies between a valve with its sensor and the muscle, seen from flow and pressure.

A flow m through a tube loses pressure, so that a sensor at the valve shows more than the muscle has
while it is filled, and less while it is emptied. With the flow u that the valve promises, and the
flow w that the motion of the muscle takes,

    H(shown) - I(u - w) = a I(max(u, 0)) + b I(min(u, 0)) + q H(loss)
    loss = u |u| S^2/(2 P f^2)

H is a high pass and I the integral of flow over V/(k R T) with the same high pass, so that no
pressure is differentiated. The square-root law of a tube gives the loss, with the shown absolute
pressure P, the pressure S of the supply, and the full flow f from it; q is the square of the
valve's conductance over that of the tube. a and b stand for a valve or a gas volume that is not as
written. A late command or a late sensor makes the shown pressure late; a tube makes it early.
"""

from __future__ import annotations

import math
from typing import Final

from pam_control.adaptation.recursive_fit import RecursiveFit, Suspect

HIGH_PASS: Final = 0.3  # s
EVERY: Final = 0.06  # s between two updates of the fit
DEVIATIONS: Final = (0.3, 0.3, 2.0)
NOISE: Final = 300.0  # Pa
TRIFLE: Final = 1e3  # Pa; a smaller loss is left to the feedback
LEAST: Final = 0.1  # q; as of a tube with three times the conductance of the valve
MOST: Final = 10.0
BETTER: Final = 4.0  # squared errors without a tube over those with one, to believe in it


class TubeSearch:
    """Looks for the tube of one muscle.

    Parameters
    ----------
    full_flow : float
        Of the open valve from the supply [kg/s].
    supply : float
        Its pressure [Pa absolute].
    told : float, optional
        q by the rig file, used until the fit has found a tube [-].

    Attributes
    ----------
    per_square : float
        Loss for q = 1 times the pressure, per square of the flow [Pa^2 s^2/kg^2].
    share : float
        q; 0 if there is no tube that matters [-].
    """

    def __init__(self, full_flow: float, supply: float, told: float = 0.0) -> None:
        self._told = min(told, MOST)
        self.per_square = supply**2 / (2.0 * full_flow**2)
        self._fit = RecursiveFit(DEVIATIONS, NOISE, TRIFLE, Suspect(LEAST, BETTER))
        self.share = self._told
        self.restart()

    def forget(self) -> None:
        """Nothing is known."""
        self._fit.forget()
        self.share = self._told

    def restart(self) -> None:
        """Begin anew with the filters; what was learnt is kept."""
        self._shown = self._lost = math.nan
        self._filled = self._emptied = self._moved = self._since = 0.0

    def update(
        self,
        step: float,
        shown: float,
        rates: tuple[float, float, float],
        lost: float,
        works: bool,
    ) -> None:
        """Take a sample; all values have passed the same filter.

        Parameters
        ----------
        step : float
            Time since the last sample [s].
        shown : float
            Pressure of the sensor [Pa].
        rates : (float, float, float)
            Flow that fills and that empties (negative) the muscle, and flow that its motion takes,
            over V/(k R T) [Pa/s].
        lost : float
            The loss for q = 1 [Pa].
        works : bool
            Whether there is a flow; nothing is learnt or forgotten of a valve that is shut.
        """
        if math.isnan(self._shown):
            self._shown, self._lost = shown, lost
        kept = HIGH_PASS / (HIGH_PASS + step)
        self._shown += (1.0 - kept) * (shown - self._shown)
        self._lost += (1.0 - kept) * (lost - self._lost)
        filling, emptying, moving = rates
        self._filled = kept * (self._filled + step * filling)
        self._emptied = kept * (self._emptied + step * emptying)
        self._moved = kept * (self._moved + step * moving)
        if not works:
            return
        self._since += step
        if self._since < EVERY:
            return
        functions = (self._filled, self._emptied, lost - self._lost)
        unexplained = shown - self._shown - self._filled - self._emptied + self._moved
        self._fit.update(functions, unexplained, self._since)
        found = min(self._fit.weights[-1], MOST)
        self.share = found if found > 0.0 else self._told
        self._since = 0.0
