"""Gain design: the PID with the least tracking error that keeps given stability margins.

All control laws use the same design criterion, so that a comparison of laws is fair. The design
minimises |S|, the error per reference (root mean square over the tracking band, at the worst
operating point). The constraints hold at every operating point: the closed loop is stable, the
phase margin is at least the target and |S| never exceeds the sensitivity limit. The integral time
is at most a second, so that the joint carries an unknown load. The loop is
the linearised joint with its pressure loops, valve lag, sampling and transport delay
(`linear_joint`).

LQR is not used, because the delay and the pressure loops make the state vector long, and its
weights do not determine the margins. A PID has three numbers that a user can read, override and
check.

Source: K. J. Astrom and T. Hagglund, Advanced PID Control, ISA 2006, chapter 7 (design under a
constraint on the sensitivity).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pam_control.feedback.linear_joint import LoopTiming, frequency_response
from pam_control.feedback.loop_shape import encloses_nothing, least_phase_margin
from pam_control.feedback.margins import ControlDesignError, LoopCase
from pam_control.feedback.pid import PidGains

PRESSURE_PHASE_MARGIN = math.radians(60.0)
TRACKING_BAND = (0.1, 2.0)  # Hz
OMEGA = np.geomspace(0.05, 500.0, 320)  # rad/s
INFEASIBLE = 1e2  # a cost above it violates a constraint
WORSE_THAN_ANY = 1e6
LONGEST_INTEGRAL_TIME = 1.0  # s; with a longer one a joint sags under an unknown load
EXPONENT_BOUNDS = ((-2.5, 1.5), (-1.5, 3.0), (-4.0, 0.5))

Real = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class DesignTask:
    """All that determines the gains of one joint; joints with equal tasks get equal gains."""

    cases: tuple[LoopCase, ...]  # the loops at the operating points
    timing: LoopTiming  # the loop's delays
    phase_margin: float  # minimum at any operating point [rad]
    sensitivity: float  # maximum |S| at any frequency and operating point [-]
    derivative_filter: float  # time constant [s]
    band: tuple[float, float] = TRACKING_BAND  # frequency band of the references [Hz]
    # With a disturbance observer: the part of the transport delay that is assumed, which may just
    # as well be in one of the measurements alone [s]. None: without an observer.
    unknown_delay: float | None = None
    # time constant of the lead on the derivative, which the designed gains have [s]
    lead: float = 0.0


def design_pressure_gain(timing: LoopTiming, phase_margin: float = PRESSURE_PHASE_MARGIN) -> float:
    """Gain k [1/s] of the pressure loop k H(s)/s with this phase margin [rad].

    The crossover frequency is k if the valve's residual lag is short compared with 1/k.
    """

    def phase_lag(k: float) -> float:
        return k * timing.delay + math.atan(k * timing.residual_lag)

    low, high = 0.0, 1e4
    while high - low > 1e-6 * high:
        middle = 0.5 * (low + high)
        if 0.5 * math.pi - phase_lag(middle) > phase_margin:
            low = middle
        else:
            high = middle
    return low


class PidCost:
    """Cost function of the design: tracking error of a PID, with penalties for the constraints.

    The design evaluates it some thousand times. Therefore it works on real arrays of shape
    (operating points, frequencies) and calls no trigonometric function.

    Parameters
    ----------
    task : DesignTask
        The joint's loops and the requirements.
    """

    def __init__(self, task: DesignTask) -> None:
        plant = np.array(
            [frequency_response(case.point, case.loop, task.timing, OMEGA) for case in task.cases]
        )
        self._task = task
        self._scale = 1.0 / float(np.median(np.abs(plant[:, 0])))
        self._plant = np.ascontiguousarray(plant.real), np.ascontiguousarray(plant.imag)
        s = 1j * OMEGA
        slope = s / (task.derivative_filter * s + 1.0)
        slope = slope * (1.0 + task.lead * slope)
        self._slope = np.ascontiguousarray(slope.real), np.ascontiguousarray(slope.imag)
        hertz = OMEGA / (2.0 * math.pi)
        low, high = np.searchsorted(hertz, task.band)
        self._in_band = slice(int(low), int(high))

    def gains(self, exponents: Real) -> PidGains:
        """The gains at a point of the search, which is given as three exponents of ten."""
        kp, ki, kd = (self._scale * 10.0 ** float(exponent) for exponent in exponents)
        return PidGains(kp, ki, kd, self._task.derivative_filter, lead=self._task.lead)

    def __call__(self, exponents: Real) -> float:
        """Cost at a point of the search."""
        return self.of(self.gains(exponents))

    def of(self, gains: PidGains) -> float:
        """Largest RMS of |S| over the tracking band [-]; above INFEASIBLE a constraint is violated.

        Parameters
        ----------
        gains : PidGains
            Gains with the derivative filter and the lead of the task.
        """
        (plant_re, plant_im), (slope_re, slope_im) = self._plant, self._slope
        pid_re = gains.proportional + gains.derivative * slope_re
        pid_im = gains.derivative * slope_im - gains.integral / OMEGA
        opened_re = pid_re * plant_re - pid_im * plant_im
        opened_im = pid_re * plant_im + pid_im * plant_re
        returned_re = 1.0 + opened_re
        squared_im = opened_im * opened_im
        squared_distance = returned_re * returned_re + squared_im
        squared_size = opened_re * opened_re + squared_im
        excess = max(1.0 / math.sqrt(float(squared_distance.min())) - self._task.sensitivity, 0.0)
        margin = least_phase_margin(opened_re, opened_im, squared_size)
        excess += max(self._task.phase_margin - margin, 0.0)
        excess += max(1.0 - gains.integral * LONGEST_INTEGRAL_TIME / gains.proportional, 0.0)
        if not encloses_nothing(returned_re, opened_im):
            return WORSE_THAN_ANY + excess
        squared_sensitivity = 1.0 / squared_distance[:, self._in_band]
        error = math.sqrt(float(squared_sensitivity.mean(axis=1).max()))
        return error + 1e3 * excess


def design_pid(joint: str, task: DesignTask) -> PidGains:
    """The PID with the least tracking error that keeps the margins.

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
    cost = PidCost(task)
    from scipy.optimize import differential_evolution  # noqa: PLC0415  (slow to import)

    best = differential_evolution(
        cost,
        bounds=EXPONENT_BOUNDS,
        seed=1,
        popsize=14,
        maxiter=60,
        tol=1e-4,
        polish=False,
    )
    if best.fun > INFEASIBLE:
        timing = task.timing
        raise ControlDesignError(
            f"{joint}: no gains reach {math.degrees(task.phase_margin):.0f} deg of phase margin "
            f"and a sensitivity below {task.sensitivity:g} at every operating point (loop delay "
            f"{timing.delay * 1e3:.1f} ms, pressure loop "
            f"{task.cases[0].loop.pressure_gain:.1f} 1/s)"
        )
    return cost.gains(best.x)
