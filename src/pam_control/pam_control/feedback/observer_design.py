"""Gains and bandwidth of a loop with a disturbance observer, for a range of unknowns.

If pressures and position are compared at the same time, and if the model is right, an observer
changes nothing in the loop: whatever the controller commands appears in both. What it adds to the
loop is the effect of what is not known. With the measured position late by dq, the pressures by dp,
the true joint A' instead of the modelled A, and Q(s) = L/(s + L)/(Tf s + 1)^2

    loop gain = drive/spring (PID exp(-dq s) - Q (A' exp(-dp s) - A exp(-dq s)))

The same unknown delay that the design assumes for the commands is assumed for the position alone
and for the pressures alone, and a limb that is heavier than written is assumed as well. At every
operating point, all of these loops must be stable and keep a part of the margins.

Within these constraints the design minimises the error per disturbance torque. The integral is slow
then, because the observer carries the load.

Sources: linear_joint for drive and spring; K. J. Astrom and T. Hagglund, Advanced PID Control, ISA
2006, chapter 7 for the constraints.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt

from pam_control.feedback.gain_design import (
    INFEASIBLE,
    UNKNOWN_INERTIA,
    WORSE_THAN_ANY,
    DesignTask,
    stated_loop,
    unknown_loops,
)
from pam_control.feedback.linear_joint import Complex, response_parts
from pam_control.feedback.loop_shape import encloses_nothing, least_phase_margin
from pam_control.feedback.margins import ControlDesignError, derivative_response
from pam_control.feedback.pid import PidGains

OMEGA = np.geomspace(0.05, 500.0, 200)  # rad/s
INTEGRAL_TIME = 1.0  # s
UNKNOWN_PHASE_MARGIN = math.radians(35.0)  # with one of the unknowns
UNKNOWN_SENSITIVITY = 2.0
BOUNDS = ((-2.0, 1.0), (-3.0, 0.5), (0.7, 2.3))  # exponents of ten: P, D, observer

Real = npt.NDArray[np.float64]


class ObserverCost:
    """Error per disturbance of a PID with an observer, with penalties for the constraints.

    Parameters
    ----------
    task : DesignTask
        The joint's loops and the requirements, which hold without other unknowns than the delay of
        the commands. Its filter is Tf, of the PID's derivative and of the observer.
    """

    def __init__(self, task: DesignTask) -> None:
        self._task = task
        s = self._s = 1j * OMEGA
        behind, in_time = np.exp(-task.unknown_delay * s), np.ones_like(s)
        unit = task.gains(0.0, 0.0, 1.0)
        rows: list[tuple[Complex, Complex, Complex, Complex]] = []
        stated: list[tuple[Complex, Complex, Complex, Complex]] = []
        for case in task.cases:
            point = case.point
            heavy = point.heavier(UNKNOWN_INERTIA)
            model, more = point.dynamic_stiffness(s), heavy.inertia_beyond(point, s)
            loops = [*stated_loop(task, case, OMEGA), *unknown_loops(task, case, OMEGA)]
            seen = ((in_time, 0.0), (in_time, 0.0), (behind, 0.0), (in_time, more))
            for (plant, position, derivative), (late_p, changed) in zip(loops, seen, strict=True):
                mismatch = (model + changed) * late_p - model * position
                rows.append((plant, position, derivative, mismatch))
            drive, spring, late = response_parts(point, case.loop, task.timing, OMEGA)
            # an outside torque is no acceleration by the muscles
            unseen = np.full(s.shape, -point.accelerations(1.0)[0], dtype=np.complex128)
            pushed = derivative_response(unit, task.timing, OMEGA, 0.0, unseen)
            stated.append((drive * late, spring, loops[0][2], pushed))
        self._plant, self._position, self._derivative, self._mismatch = (
            np.array(part) for part in zip(*rows, strict=True)
        )
        self._drive, self._spring, self._led, self._pushed = (
            np.array(part) for part in zip(*stated, strict=True)
        )
        self._scale = float(np.median(np.abs(self._spring[:, 0])))
        hertz = OMEGA / (2.0 * math.pi)
        low, high = np.searchsorted(hertz, task.band)
        self._in_band = slice(int(low), int(high))

    def gains(self, exponents: Real) -> PidGains:
        """The gains at a point of the search, which is given as three exponents of ten."""
        p, d, observer = (10.0 ** float(exponent) for exponent in exponents)
        kp, kd = self._scale * p, self._scale * d
        gains = self._task.gains(kp, kp / INTEGRAL_TIME, kd)
        return dataclasses.replace(gains, observer=observer)

    def __call__(self, exponents: Real) -> float:
        """Cost at a point of the search."""
        return self.of(self.gains(exponents))

    def of(self, gains: PidGains) -> float:
        """Largest RMS error per torque in the band, times the joint's stiffness [-]."""
        excess, stable = self._excess(gains)
        if not stable:
            return WORSE_THAN_ANY + excess
        band = self._in_band
        drive, observed = self._drive[:, band], self._observer(gains)[band]
        fed = self._undelayed(gains)[band] + gains.derivative * self._led[:, band]
        left = 1.0 - drive * (observed + gains.derivative * self._pushed[:, band])
        error = np.abs(left / (self._spring[:, band] + drive * fed))
        return self._scale * math.sqrt(float((error**2).mean(axis=1).max())) + 1e3 * excess

    def stable(self, gains: PidGains) -> bool:
        """Whether all loops are stable."""
        return self._excess(gains)[1]

    def _undelayed(self, gains: PidGains) -> Complex:
        """The proportional and the integral part."""
        result: Complex = np.asarray(gains.proportional + gains.integral / self._s)
        return result

    def _observer(self, gains: PidGains) -> Complex:
        smooth = (gains.derivative_filter * self._s + 1.0) ** 2
        result: Complex = np.asarray(gains.observer / (self._s + gains.observer) / smooth)
        return result

    def _excess(self, gains: PidGains) -> tuple[float, bool]:
        """By how much the constraints are violated, and whether all loops are stable."""
        opened = self._plant * (
            self._undelayed(gains) * self._position
            + gains.derivative * self._derivative
            - self._observer(gains) * self._mismatch
        )
        excess = 0.0
        for rows, margin, sensitivity in (
            (slice(0, None, 4), self._task.phase_margin, self._task.sensitivity),
            *((slice(n, None, 4), UNKNOWN_PHASE_MARGIN, UNKNOWN_SENSITIVITY) for n in (1, 2, 3)),
        ):
            part = opened[rows]
            re, im = np.ascontiguousarray(part.real), np.ascontiguousarray(part.imag)
            distance = (1.0 + re) ** 2 + im * im
            excess += max(1.0 / math.sqrt(float(distance.min())) - sensitivity, 0.0)
            excess += max(margin - least_phase_margin(re, im, re * re + im * im), 0.0)
        returned = np.ascontiguousarray(1.0 + opened.real)
        return excess, encloses_nothing(returned, np.ascontiguousarray(opened.imag))


def design_with_observer(joint: str, task: DesignTask) -> PidGains:
    """The gains and the observer's bandwidth with the least error per disturbance.

    Parameters
    ----------
    joint : str
        Name for messages.
    task : DesignTask
        Its loops and the requirements.

    Raises
    ------
    ControlDesignError
        When no gains satisfy the constraints.
    """
    cost = ObserverCost(task)
    from scipy.optimize import differential_evolution  # noqa: PLC0415  (slow to import)

    best = differential_evolution(
        cost, bounds=BOUNDS, seed=1, popsize=10, maxiter=40, tol=1e-3, polish=False
    )
    if best.fun > INFEASIBLE:
        raise ControlDesignError(f"{joint}: no gains with a disturbance observer keep the margins")
    return cost.gains(best.x)
