"""Pressure of a muscle behind a tube, from the sensor at the valve.

The sensor shows the pressure in the muscle and what the tube loses. At high frequencies the loss is
most of what it shows, so that a loop about the sensor chatters. Therefore the pressure is observed:
it follows from the flow into the muscle, and is drawn to the shown pressure without the loss,

    dP/dt = (flow - moved)/per_rate + (shown - loss - P)/T

so that what a wrong loss adds to the loop is slow.
"""

from __future__ import annotations

import math
from typing import Any, Final

from pam_control.rows.loop_rows import V_INSIDE

TRUST: Final = 0.1  # s, T


def pressure_behind_tube(v: Any, step: float, shown: float, loss: float, rate: float) -> float:
    """The pressure in the muscle [Pa gauge], never below 0.

    Parameters
    ----------
    v : row
        State of the loop (`loop_rows`); not a number: begin with what the sensor shows.
    step : float
        Time since the last call [s].
    shown : float
        What the sensor shows [Pa gauge].
    loss : float
        In the tube, positive while the muscle is filled [Pa].
    rate : float
        dP/dt that follows from the flow [Pa/s].
    """
    if math.isnan(v[V_INSIDE]):
        v[V_INSIDE] = shown
    v[V_INSIDE] += rate * step
    v[V_INSIDE] += step / (TRUST + step) * (shown - loss - v[V_INSIDE])
    v[V_INSIDE] = max(v[V_INSIDE], 0.0)
    return float(v[V_INSIDE])
