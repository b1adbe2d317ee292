"""A small test motion about a position: a sine that fades in and out.

q(t) = q_0 + A w(t) sin(2 pi f t), with the window w that rises from 0 to 1 within the first period,
falls within the last, and has no jump in its second derivative.
"""

from __future__ import annotations

import math
from typing import Final

from pam_control.references.trajectory import TrajectoryPoint

SECONDS: Final = 4.0  # s, at least
LEAST_PERIODS: Final = 4
POINTS: Final = 16  # per period


def sine_burst(position: float, amplitude: float, frequency: float) -> list[TrajectoryPoint]:
    """Waypoints with velocity and acceleration, from rest at `position` [rad] and back.

    Parameters
    ----------
    position : float
        Where the joint rests [rad].
    amplitude : float
        [rad].
    frequency : float
        [Hz].
    """
    periods = max(LEAST_PERIODS, math.ceil(SECONDS * frequency))
    period, speed = 1.0 / frequency, 2.0 * math.pi * frequency
    duration = periods * period
    points = []
    for index in range(1, periods * POINTS + 1):
        t = index * period / POINTS
        w, dw, ddw = _window(min(t, duration - t) / period, -1.0 if t > 0.5 * duration else 1.0)
        dw, ddw = dw / period, ddw / period**2
        sine, cosine = amplitude * math.sin(speed * t), amplitude * math.cos(speed * t)
        last = index == periods * POINTS
        velocity = dw * sine + w * speed * cosine
        acceleration = ddw * sine + 2.0 * dw * speed * cosine - w * speed**2 * sine
        points.append(
            TrajectoryPoint(
                t,
                [position if last else position + w * sine],
                [0.0 if last else velocity],
                [0.0 if last else acceleration],
            )
        )
    return points


def _window(x: float, sign: float) -> tuple[float, float, float]:
    """The window and its two derivatives at a share of its rise or, with sign -1, of its fall."""
    if x >= 1.0:
        return 1.0, 0.0, 0.0
    x = max(x, 0.0)
    return (
        x**3 * (10.0 - 15.0 * x + 6.0 * x * x),
        sign * 30.0 * x * x * (1.0 - x) ** 2,
        60.0 * x * (1.0 - x) * (1.0 - 2.0 * x),
    )
