"""Speed and acceleration of a joint, from its position and from the torque of its muscles.

A filtered derivative of an encoder's steps is late by its filter, and a faster filter turns each
step into a stroke of the valves. The torque of the muscles, by the measured pressures, gives the
acceleration before the position shows it, and without steps. With the step h of the measurements,
the acceleration m that the rig file's model finds from pressures and position, and d, the
acceleration that it does not explain:

    predicted: v- = v + h (m + d), q- = q + h v + h^2/2 (m + d)
    corrected: q = q- + a r, v = v- + b r/h, d = d + 2 c r/h^2, with the rest r = y - q-
    a = 1 - z^3, b = 3/2 (1 - z^2)(1 - z), c = 1/2 (1 - z)^3, with z = exp(-bandwidth h)

The three poles of the error are at z. A constant torque that the model lacks leaves no error of the
speed, and a rising one an error of 3/bandwidth^2 times its rate over the inertia. What the model
lacks at frequencies above the bandwidth is not seen.

Source: E. Brookner, Tracking and Kalman Filtering Made Easy, Wiley 1998, section 1.2 (critically
damped g-h-k filter), with the model's acceleration as an input.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pam_control.feedback.linear_joint import Complex, Frequencies, LoopTiming


def correction_gains(bandwidth: float, step: float) -> tuple[float, float, float]:
    """By which position, speed and acceleration follow a rest: a [-], b/h [1/s], 2 c/h^2 [1/s^2].

    Parameters
    ----------
    bandwidth : float
        [rad/s].
    step : float
        Time between two measurements, h [s].
    """
    z = math.exp(-bandwidth * step)
    left = 1.0 - z
    return 1.0 - z**3, 1.5 * (1.0 - z * z) * left / step, (left / step) ** 2 * left


def observe_motion(
    row: Any, at: int, position: float, speed: float, explained: float, step: float,
    bandwidth: float,
) -> None:  # fmt: skip
    """Take a measured position.

    Parameters
    ----------
    row, at : row, int
        Position [rad], speed [rad/s] and the acceleration that the model does not explain
        [rad/s^2], from this place on. Not a number: nothing has been observed yet.
    position : float
        Measured [rad].
    speed : float
        With which the observer begins [rad/s].
    explained : float
        Acceleration by the model, of the measurements before [rad/s^2]; NaN if it is not known.
    step : float
        Time since the measurement before [s]; 0 if this one is not new.
    bandwidth : float
        [rad/s].
    """
    if math.isnan(explained):
        row[at], row[at + 1], row[at + 2] = math.nan, speed, 0.0
        return
    if math.isnan(row[at]):
        # a joint that is taken over rests: the acceleration of the model is not there
        row[at], row[at + 1], row[at + 2] = position, speed, -explained
        return
    if step <= 0.0:
        return
    follow, turn, bend = correction_gains(bandwidth, step)
    acceleration = explained + row[at + 2]
    predicted = row[at] + step * (row[at + 1] + 0.5 * step * acceleration)
    rest = position - predicted
    row[at] = predicted + follow * rest
    row[at + 1] += step * acceleration + turn * rest
    row[at + 2] += bend * rest


class SeenMotion(NamedTuple):
    """Speed and acceleration that an observer sees, per true position."""

    speed: Complex  # [1/s]
    acceleration: Complex  # [1/s^2]


def seen_motion(
    bandwidth: float,
    timing: LoopTiming,
    omega: Frequencies,
    position: Complex | float,
    explained: Complex,
) -> SeenMotion:
    """The frequency response of the observer.

    Parameters
    ----------
    bandwidth : float
        [rad/s].
    timing : LoopTiming
        With the period of the measurements and the lag of the pressure sensors.
    omega : (n,) array
        [rad/s].
    position : (n,) array or float
        Measured position per true position [-].
    explained : (n,) array
        Acceleration by the model per true position, without the lag of the sensors [1/s^2].
    """
    h, one = timing.period, np.eye(3)
    ahead = np.array([[1.0, h, 0.5 * h * h], [0.0, 1.0, h], [0.0, 0.0, 1.0]])
    follows = np.array(correction_gains(bandwidth, h))
    left = one - np.outer(follows, one[0])
    s = 1j * omega
    late = np.exp(-h * s)
    before = late * explained / (timing.pressure_lag * s + 1.0)
    driven = np.outer(before, left @ ahead[:, 2] - left @ one[2])
    driven = driven + np.outer(position * np.ones_like(s), follows)
    states = np.linalg.solve(one - late[:, None, None] * (left @ ahead), driven[:, :, None])
    return SeenMotion(states[:, 1, 0], states[:, 2, 0] + before)
