"""Takes back what the integral gathers while a joint at rest sticks by friction.

A joint with dry friction comes to rest beside its target. The integral of the feedback grows then
until the joint breaks away, or until the next motion begins. There, the torque that friction
needs in the new direction comes from the feedforward, if the friction is known; what the integral
has gathered comes on top and throws the joint past its reference.

Therefore what was gathered in this way is given back while the reference leaves its place, over a
travel in which friction changes its side. It is at most the known friction: a load that was put on
meanwhile stays with the integral. A joint that moves while its reference rests does not stick. What
the feedforward has learnt meanwhile, and has taken over from the integral, is not given back: the
joint would lack it. Nor is a change of the integral that comes from other settings.

Source: B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, "A survey of models, analysis tools
and compensation methods for the control of machines with friction", Automatica 30 (1994)
1083-1138, section 4.2 (integral control and sticking); the rule is made here.
"""

from __future__ import annotations

import math
from typing import Any, Final

from pam_control.limited import limited
from pam_control.rows.plan_rows import Y_GATHERED, Y_PLACE, Y_STUCK_INTEGRAL, Y_TARGET

STICKS: Final = 2e-3  # rad, in which a joint that sticks stays: the rig file names no encoder's
# count, and the largest usual one, of 4096 counts, flickers by 1.5 mrad
TRAVEL: Final = 4e-3  # rad of the reference, in which the torque is given back


def begin_sticking(y: Any) -> None:
    """Nothing was gathered."""
    y[Y_GATHERED] = 0.0
    y[Y_PLACE] = y[Y_TARGET] = y[Y_STUCK_INTEGRAL] = math.nan


def keep_handed(y: Any, handed: float) -> None:
    """A feedforward has taken this torque [N m] over: first of all what was gathered."""
    gathered = y[Y_GATHERED]
    y[Y_GATHERED] = gathered - limited(handed, min(gathered, 0.0), max(gathered, 0.0))


def go_on_sticking(y: Any) -> None:
    """The integral was set to go on with other settings, which gathers nothing."""
    y[Y_STUCK_INTEGRAL] = math.nan


def given_back(
    y: Any, reference: Any, at: int, position: float, integral: float, friction: float
) -> float:
    """Take a cycle; return what the integral has to give back now [N m].

    Parameters
    ----------
    y : row
        State of the plan (`plan_rows`).
    reference : row
        Where the joint should be: from `at` on, position, velocity and acceleration.
    at : int
        A place in it.
    position : float
        Measured [rad].
    integral : float
        Of the feedback [N m].
    friction : float
        Dry friction that is known and fed forward [N m].
    """
    change, y[Y_STUCK_INTEGRAL] = integral - y[Y_STUCK_INTEGRAL], integral
    moved, y[Y_TARGET] = abs(reference[at] - y[Y_TARGET]), reference[at]
    if reference[at + 1] == 0.0 and reference[at + 2] == 0.0:
        if not abs(position - y[Y_PLACE]) <= STICKS:
            y[Y_PLACE], y[Y_GATHERED] = position, 0.0
        elif math.isfinite(change):
            y[Y_GATHERED] += change
        return 0.0
    y[Y_PLACE] = math.nan
    if y[Y_GATHERED] == 0.0 or not math.isfinite(moved):
        return 0.0
    y[Y_GATHERED] = max(-friction, min(friction, y[Y_GATHERED]))
    back = y[Y_GATHERED] * -math.expm1(-moved / TRAVEL)
    y[Y_GATHERED] -= back
    y[Y_STUCK_INTEGRAL] -= back
    return float(back)
