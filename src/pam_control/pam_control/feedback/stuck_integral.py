"""Takes back what the integral gathers while a joint at rest sticks by friction.

A joint with dry friction comes to rest beside its target. The integral of the feedback grows then
until the joint breaks away, or until the next motion begins. There, the torque that friction
needs in the new direction comes from the feedforward, if the friction is known; what the integral
has gathered comes on top and throws the joint past its reference.

Therefore what was gathered in this way is given back while the reference leaves its place, over a
travel in which friction changes its side. It is at most the known friction: a load that was put on
meanwhile stays with the integral. A joint that moves while its reference rests does not stick.

Source: B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, "A survey of models, analysis tools
and compensation methods for the control of machines with friction", Automatica 30 (1994)
1083-1138, section 4.2 (integral control and sticking); the rule is made here.
"""

from __future__ import annotations

import math
from typing import Final

from pam_control.references.spline import JointReference

STICKS: Final = 1.5e-3  # rad, in which the position of a joint that sticks stays
TRAVEL: Final = 4e-3  # rad of the reference, in which the torque is given back


class StuckIntegral:
    """What the integral of one joint has gathered while the joint stuck."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Nothing was gathered."""
        self._gathered = 0.0
        self._place = self._target = self._integral = math.nan

    def update(
        self, reference: JointReference, position: float, integral: float, friction: float
    ) -> float:
        """Take a cycle; return what the integral has to give back now [N m].

        Parameters
        ----------
        reference : JointReference
            Where the joint should be.
        position : float
            Measured [rad].
        integral : float
            Of the feedback [N m].
        friction : float
            Dry friction that is known and fed forward [N m].
        """
        change, self._integral = integral - self._integral, integral
        moved, self._target = abs(reference.position - self._target), reference.position
        if reference.velocity == 0.0 and reference.acceleration == 0.0:
            if not abs(position - self._place) <= STICKS:
                self._place, self._gathered = position, 0.0
            elif math.isfinite(change):
                self._gathered += change
            return 0.0
        self._place = math.nan
        if self._gathered == 0.0 or not math.isfinite(moved):
            return 0.0
        self._gathered = max(-friction, min(friction, self._gathered))
        back = self._gathered * -math.expm1(-moved / TRAVEL)
        self._gathered -= back
        self._integral -= back
        return back
