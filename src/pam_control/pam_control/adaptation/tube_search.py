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
from typing import Any, Final

import numpy as np

from pam_control.adaptation.recursive_fit import (
    WEIGHTS,
    RecursiveFit,
    Suspect,
    take_sample,
)
from pam_model.plant.compiled import for_kernel

HIGH_PASS: Final = 0.3  # s
EVERY: Final = 0.06  # s between two updates of the fit
DEVIATIONS: Final = (0.3, 0.3, 2.0)
NOISE: Final = 300.0  # Pa
TRIFLE: Final = 1e3  # Pa; a smaller loss is left to the feedback
LEAST: Final = 0.1  # q; as of a tube with three times the conductance of the valve
MOST: Final = 10.0
BETTER: Final = 4.0  # squared errors without a tube over those with one, to believe in it


(TUBE_SHOWN, TUBE_LOST, TUBE_FILLED, TUBE_EMPTIED, TUBE_MOVED, TUBE_SINCE, TUBE_TOLD, TUBE_SHARE,
 N_TUBE) = range(9)  # fmt: skip
"""State: slow parts of the shown pressure and of the loss for q = 1 [Pa]; what flows that fill,
that empty and that a motion takes have done lately [Pa]; time since the last update of the fit [s];
q by the rig file, and q as it is used [-]."""


def begin_search(t: Any) -> None:
    """Begin anew with the filters."""
    t[TUBE_SHOWN] = t[TUBE_LOST] = math.nan
    t[TUBE_FILLED] = t[TUBE_EMPTIED] = t[TUBE_MOVED] = t[TUBE_SINCE] = 0.0


def search_tube(
    t: Any, step: float, shown: float, filling: float, emptying: float, moving: float, lost: float,
    works: bool, given: Any, state: Any, rows: Any, products: Any, scratch: Any, functions: Any,
) -> None:  # fmt: skip
    """Take a sample; all values have passed the same filter.

    Parameters
    ----------
    t : row
        State, `TUBE_SHOWN` and its like.
    step : float
        Time since the last sample [s].
    shown : float
        Pressure of the sensor [Pa].
    filling, emptying, moving : float
        Flow that fills and that empties (negative) the muscle, and flow that its motion takes,
        over V/(k R T) [Pa/s].
    lost : float
        The loss for q = 1 [Pa].
    works : bool
        Whether there is a flow; nothing is learnt or forgotten of a valve that is shut.
    given, state, rows, products, scratch, functions : rows
        Of the fit.
    """
    if math.isnan(t[TUBE_SHOWN]):
        t[TUBE_SHOWN], t[TUBE_LOST] = shown, lost
    kept = HIGH_PASS / (HIGH_PASS + step)
    t[TUBE_SHOWN] += (1.0 - kept) * (shown - t[TUBE_SHOWN])
    t[TUBE_LOST] += (1.0 - kept) * (lost - t[TUBE_LOST])
    t[TUBE_FILLED] = kept * (t[TUBE_FILLED] + step * filling)
    t[TUBE_EMPTIED] = kept * (t[TUBE_EMPTIED] + step * emptying)
    t[TUBE_MOVED] = kept * (t[TUBE_MOVED] + step * moving)
    if not works:
        return
    t[TUBE_SINCE] += step
    if t[TUBE_SINCE] < EVERY:
        return
    functions[0], functions[1] = t[TUBE_FILLED], t[TUBE_EMPTIED]
    functions[2] = lost - t[TUBE_LOST]
    value = shown - t[TUBE_SHOWN] - t[TUBE_FILLED] - t[TUBE_EMPTIED] + t[TUBE_MOVED]
    take_sample(value, t[TUBE_SINCE], given, state, rows, products, scratch, functions)
    found = min(rows[WEIGHTS][2], MOST)
    t[TUBE_SHARE] = found if found > 0.0 else t[TUBE_TOLD]
    t[TUBE_SINCE] = 0.0


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
    row : row
        `TUBE_SHOWN` and its like.
    fit : RecursiveFit
        Of the tube.
    """

    def __init__(self, full_flow: float, supply: float, told: float = 0.0) -> None:
        self.per_square = supply**2 / (2.0 * full_flow**2)
        self.fit = RecursiveFit(DEVIATIONS, NOISE, TRIFLE, Suspect(LEAST, BETTER))
        self.row = for_kernel(np.zeros(N_TUBE))
        self.row[TUBE_TOLD] = self.row[TUBE_SHARE] = min(told, MOST)
        begin_search(self.row)

    @property
    def share(self) -> float:
        """The squared conductance of the valve over that of the tube; 0 if none matters [-]."""
        return float(self.row[TUBE_SHARE])

    def forget(self) -> None:
        """Nothing is known."""
        self.fit.forget()
        self.row[TUBE_SHARE] = self.row[TUBE_TOLD]

    def restart(self) -> None:
        """Begin anew with the filters; what was learnt is kept."""
        begin_search(self.row)
