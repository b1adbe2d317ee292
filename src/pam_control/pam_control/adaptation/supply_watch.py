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
from typing import Any, Final

from pam_control.limited import limited

SURPRISE: Final = 3.0  # standard deviations of the promised flow
UNKNOWN: Final = 0.15  # of the pressure, standard deviation after a surprise
CORRELATED: Final = 0.06  # s, for which two samples of a filtered flow are about the same
LOWEST: Final = -0.6
TRIFLE: Final = 0.03  # of the pressure
SURE: Final = 2.0  # standard deviations
FOLLOWS: Final = 0.2  # s; a faster change of the flows is a push, as the position loop has answered
FADES: Final = 10.0  # s of filling; what lasts is left to the fits of the valves
P_ACTS, P_FOUND, P_VARIANCE = range(3)
N_SAG: Final = 3
"""Sag of the supply that is used, 0 or negative, and the one that was found, of its pressure [-];
variance of the latter."""
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


def learn_sag(p: Any, missing: float, slope: float, variance: float, since: float) -> None:
    """Take a sample of a valve that fills.

    Parameters
    ----------
    p : row
        `P_ACTS` and its like.
    missing : float
        Flow beyond the promised one, of the full flow [-].
    slope : float
        Change of the promised flow by the sag that is used [-].
    variance : float
        Of the promised flow.
    since : float
        Time since the last sample of this valve [s].
    """
    p[P_FOUND] *= math.exp(-since / FADES)
    innovation = missing - slope * (p[P_FOUND] - p[P_ACTS])
    if innovation * innovation > SURPRISE**2 * variance:
        p[P_VARIANCE] = UNKNOWN**2
    spread = variance * CORRELATED / since
    gain = p[P_VARIANCE] * slope / (slope * slope * p[P_VARIANCE] + spread)
    p[P_FOUND] = limited(p[P_FOUND] + gain * innovation, LOWEST, 0.0)
    p[P_VARIANCE] *= 1.0 - gain * slope
    sure = -p[P_FOUND] > max(TRIFLE, SURE * math.sqrt(p[P_VARIANCE]))
    goal = p[P_FOUND] if sure else 0.0
    p[P_ACTS] += since / (FOLLOWS + since) * (goal - p[P_ACTS])


def forget_sag(p: Any) -> None:
    """The supply is as it should be."""
    p[P_ACTS] = p[P_FOUND] = p[P_VARIANCE] = 0.0
