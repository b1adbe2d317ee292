"""Momentum observer: the torque on a joint that its model does not explain.

The measured pressures give the torque of the muscles. What of it does not appear as motion, gravity
or friction of the model is lost to something else: a payload, a contact, friction, hysteresis, a
muscle that is weaker than written. With the momentum p = J qd and the bandwidth L

    lost = L/(s + L) (torque of the muscles - B qd - gravity - ...) - L s/(s + L) p

so that no acceleration is needed. The speed and all torques pass a filter, and the result passes
the same filter again, because the steps of an encoder would make the valves chatter. The control
law adds `lost` to the torque that it asks for.

Pressures and position are compared at the same time: the pressures are held back by the delay of
the position that the rig file tells, and the motion is filtered like the pressures if their sensors
are known to lag. Since the torque is computed from measured pressures and not from commands, a
delay of the commands does not reach the observer.

Source: A. De Luca and R. Mattone, "Actuator failure detection and isolation using generalized
momenta", ICRA 2003 (residual of the generalised momentum).
"""

from __future__ import annotations

import math
from typing import Any

from pam_control.limited import limited
from pam_control.rows.plan_rows import (
    Y_LOST,
    Y_MOTION,
    Y_MUSCLES,
    Y_OBSERVED,
    Y_SMOOTH_LOST,
    Y_SPEED,
)


def begin_observer(y: Any, lost: float, limit: float) -> float:
    """Begin with a joint at rest that loses this torque [N m]; return the part in the limit."""
    y[Y_MUSCLES] = y[Y_MOTION] = y[Y_SPEED] = math.nan
    y[Y_OBSERVED] = 0.0
    y[Y_LOST] = y[Y_SMOOTH_LOST] = max(-limit, min(limit, lost))
    return float(y[Y_LOST])


def observed_loss(
    y: Any, step: float, muscles: float, motion: float, speed: float, inertia: float,
    damping: float, lag: float, bandwidth: float, speed_filter: float, limit: float,
) -> float:  # fmt: skip
    """Take a new sample and return the lost torque [N m].

    Parameters
    ----------
    y : row
        State of the plan (`plan_rows`).
    step : float
        Time since the last sample [s]; 0 if there is no new one.
    muscles : float
        Torque of the muscles at the measured pressures [N m].
    motion : float
        Torque that the model needs at this position, without inertia and damping [N m].
    speed : float
        Measured speed, filtered [rad/s].
    inertia, damping : float
        J [kg m^2], B [N m s/rad].
    lag : float
        Known lag of the pressure sensors, by which the motion is filtered as well [s].
    bandwidth : float
        L [rad/s].
    speed_filter : float
        Time constant of the filter that the measured speed has passed [s].
    limit : float
        Largest absolute value of the result [N m].
    """
    if math.isnan(y[Y_MUSCLES]):
        y[Y_MUSCLES], y[Y_MOTION], y[Y_SPEED] = muscles, motion, speed
        y[Y_OBSERVED] = y[Y_LOST] + inertia * bandwidth * speed
    if step <= 0.0:
        return float(y[Y_LOST])
    # the torques pass the filter that the speed has passed
    y[Y_MUSCLES] += step / (speed_filter + step) * (muscles - y[Y_MUSCLES])
    late = speed_filter + lag
    y[Y_MOTION] += step / (late + step) * (motion - y[Y_MOTION])
    y[Y_SPEED] += step / (lag + step) * (speed - y[Y_SPEED])
    momentum = inertia * bandwidth * y[Y_SPEED]
    unexplained = y[Y_MUSCLES] - y[Y_MOTION] - damping * y[Y_SPEED]
    share = bandwidth * step / (1.0 + bandwidth * step)
    y[Y_OBSERVED] += share * (unexplained + momentum - y[Y_OBSERVED])
    found = y[Y_OBSERVED] - momentum
    y[Y_SMOOTH_LOST] += step / (speed_filter + step) * (found - y[Y_SMOOTH_LOST])
    y[Y_LOST] = limited(y[Y_SMOOTH_LOST], -limit, limit)
    return float(y[Y_LOST])
