"""Whether a joint's closed loop is stable, decided by its poles.

python-control builds the closed loop, with Pade approximations of its delays. Importing it takes
more than a second, because it brings plotting and statistics; therefore only a design that has not
been made before imports this module (`kept_designs`).
"""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import numpy.typing as npt

from pam_control.feedback.linear_joint import LoopStructure, LoopTiming
from pam_control.feedback.margins import LoopCase
from pam_control.feedback.pid import PidGains
from pam_model.views.linearised_joint import OperatingPoint

PADE_ORDER = 4
POSITION = control.ss([], [], [], [[1.0, 0.0]])
"""Of a position and an acceleration."""


def is_stable(case: LoopCase, timing: LoopTiming, gains: PidGains) -> bool:
    """Whether all closed-loop poles lie in the left half plane."""
    pid = control.ss([[0.0]], [[1.0]], [[gains.integral]], [[gains.proportional]])
    if gains.integral == 0.0:
        pid = control.ss([], [], [], [[gains.proportional]])
    if gains.motion > 0.0:
        pid = control.parallel(control.series(POSITION, pid), _observed_derivative(timing, gains))
    else:
        if gains.derivative != 0.0:
            Tf = max(gains.derivative_filter, 1e-4)
            slope = control.ss([[-1.0 / Tf]], [[1.0]], [[-1.0 / Tf**2]], [[1.0 / Tf]])
            led = _gain([[1.0]]) + gains.lead * slope if gains.lead > 0.0 else _gain([[1.0]])
            pid = control.parallel(pid, gains.derivative * control.series(slope, led))
        pid = control.series(POSITION, pid)
    closed = control.feedback(control.series(_motion(case.point, case.loop, timing), pid), 1)
    return bool(np.all(closed.poles().real < 0.0))


def state_space(point: OperatingPoint, loop: LoopStructure, timing: LoopTiming) -> Any:
    """The system from w to q as a `control.StateSpace`, the delay as a Pade approximation."""
    return control.series(_motion(point, loop, timing), POSITION)


def _observed_derivative(timing: LoopTiming, gains: PidGains) -> Any:
    """From position and acceleration to the derivative's part: `motion_observer`, continuous."""
    pole = gains.motion
    late = control.ss(control.tf([1.0], [timing.period + timing.pressure_lag, 1.0]))
    speed, acceleration = gains.derivative, gains.derivative * gains.lead
    observer = control.ss(
        [[-3.0 * pole, 1.0, 0.0], [-3.0 * pole**2, 0.0, 1.0], [-(pole**3), 0.0, 0.0]],
        [[3.0 * pole, 0.0], [3.0 * pole**2, 1.0], [pole**3, 0.0]],
        [[0.0, speed, acceleration]],
        [[0.0, acceleration]],
    )
    return control.series(control.append(_gain([[1.0]]), late), observer)


def _motion(point: OperatingPoint, loop: LoopStructure, timing: LoopTiming) -> Any:
    """The system from w to position and acceleration, as measurements show them."""
    if timing.regulated:
        return _regulated_motion(point, loop, timing)
    k = loop.pressure_gain
    muscles = len(point.torque_slopes)
    size, none = 2 + muscles, [0.0] * muscles
    accelerations = point.accelerations(-point.spring, -point.damping, *point.torque_slopes)
    joint = control.ss(
        [
            [0.0, 1.0, *none],
            accelerations,
            *([0.0, -c, *none] for c in point.motion_pressure),
        ],
        np.eye(size)[:, 2:],
        np.eye(size),
        np.zeros((size, muscles)),
    )
    delay = control.ss(control.tf(*control.pade(timing.delay, PADE_ORDER)))
    lag = control.ss(control.tf([1.0], [max(timing.residual_lag, 1e-6), 1.0]))
    valve = control.series(delay, lag)
    valves = control.append(*[valve] * muscles)
    filtered = control.ss(control.tf([1.0], [max(timing.velocity_filter, 1e-6), 1.0]))
    pressures = control.append(*[_late(timing.pressure_delay)] * muscles)
    position = _late(timing.position_delay)
    measured = control.append(position, control.series(position, filtered), pressures)
    velocity = 1.0 if loop.measured_velocity else 0.0
    # ui = k gi w + k hi q + ci qd - k pi: positive feedback of these gains on (q, qd, pa, pb, ...).
    gains = np.hstack(
        (
            [
                [k * h, velocity * c]
                for h, c in zip(loop.position_feedback, point.motion_pressure, strict=True)
            ],
            -k * np.eye(muscles),
        )
    )
    opened = control.series(valves, joint)
    returned = control.series(measured, _gain(gains))
    closed = control.feedback(opened, returned, sign=1)
    into = _gain([[k * g] for g in loop.input])
    out = _gain([np.eye(size)[0], accelerations])
    return _held_back(control.series(into, closed, out), timing)


def _held_back(motion: Any, timing: LoopTiming) -> Any:
    """Position and acceleration as late as the position is measured."""
    late = _late(timing.position_delay)
    return control.series(motion, control.append(late, late))


def _late(delay: float) -> Any:
    if delay == 0.0:
        return _gain([[1.0]])
    return control.ss(control.tf(*control.pade(delay, PADE_ORDER)))


def _gain(matrix: npt.ArrayLike) -> Any:
    return control.ss([], [], [], np.asarray(matrix, dtype=float))


def _regulated_motion(point: OperatingPoint, loop: LoopStructure, timing: LoopTiming) -> Any:
    free, push = point.accelerations(-point.spring, -point.damping), point.accelerations(1.0)
    joint = control.ss([[0.0, 1.0], free], [[0.0], push], [[1.0, 0.0], free], [[0.0], push])
    delay = control.ss(control.tf(*control.pade(timing.delay, PADE_ORDER)))
    tau = max(timing.valve_time_constant, 1e-6)
    lag = control.ss(control.tf([1.0], [tau * tau, 2.0 * timing.valve_damping * tau, 1.0]))
    opened = control.series(delay, lag, joint)
    opened = _held_back(opened, timing)
    returned, into = (
        sum(n * each for n, each in zip(point.torque_slopes, of_muscles, strict=True))
        for of_muscles in (loop.position_feedback, loop.input)
    )
    closed = control.feedback(opened, _gain([[returned, 0.0]]), sign=1)
    return control.series(_gain([[into]]), closed)
