"""Lead compensation of a valve's lag: u -> (tau s + 1)/(alpha tau s + 1) u.

The spool then follows the wanted opening with the lag alpha tau. The filter is integrated by
backward Euler: the lagged opening l follows from (u - l)/(alpha tau) = (l - l_before)/step, and the
command is l + tau l'.
"""

from __future__ import annotations

import math
from typing import Any

from pam_control.rows.loop_rows import N_LAG, V_LAGGED


def lead_command(n: Any, v: Any, opening: float, ratio: float, step: float) -> float:
    """The command [-] for a wanted opening [-].

    Parameters
    ----------
    n, v : rows
        Numbers and state of the loop (`loop_rows`).
    opening : float
        Wanted [-].
    ratio : float
        Part of the lag that remains, alpha [-]; 1: no compensation.
    step : float
        Time since the last call [s].
    """
    lag = ratio * n[N_LAG]
    if lag <= 0.0 or ratio >= 1.0:
        return opening
    if math.isnan(v[V_LAGGED]):
        v[V_LAGGED] = opening
    v[V_LAGGED] += step / (lag + step) * (opening - v[V_LAGGED])
    return float(v[V_LAGGED] + (opening - v[V_LAGGED]) / ratio)
