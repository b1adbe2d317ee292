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

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pam_control.feedback.linear_joint import Complex, LoopTiming, frequency_response
from pam_control.feedback.loop_shape import encloses_nothing, least_phase_margin
from pam_control.feedback.margins import ControlDesignError, LoopCase, derivative_response
from pam_control.feedback.pid import PidGains

PRESSURE_PHASE_MARGIN = math.radians(60.0)
TRACKING_BAND = (0.1, 2.0)  # Hz
OMEGA = np.geomspace(0.05, 500.0, 320)  # rad/s
INFEASIBLE = 1e2  # a cost above it violates a constraint
WORSE_THAN_ANY = 1e6
LONGEST_INTEGRAL_TIME = 1.0  # s; with a longer one a joint sags under an unknown load
EXPONENT_BOUNDS = ((-2.5, 1.5), (-1.5, 3.0), (-4.0, 0.5))

UNKNOWN_INERTIA = 1.5  # times the written one
UNKNOWN_MARGINS = (
    (math.radians(40.0), 1.8),
    (math.radians(40.0), 1.8),
    (math.radians(27.0), 2.5),
)
"""Phase margin [rad] and sensitivity [-] with an observed motion: with the unknown delay in the
position, in the pressures, and with a heavier limb. With filtered derivatives the last one is
2.8 at the example's elbow."""

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
    # the part of the transport delay that is assumed, which may just as well be in one of the
    # measurements alone [s]
    unknown_delay: float = 0.0
    has_observer: bool = False  # whether a disturbance observer is designed with the gains
    # time constant of the lead on the derivative, which the designed gains have [s]
    lead: float = 0.0
    # bandwidth of the motion observer, from which the derivatives come [rad/s]; 0: they are
    # filtered
    motion: float = 0.0

    def gains(self, proportional: float, integral: float, derivative: float) -> PidGains:
        """Gains with the filter, the lead and the observed motion of the task."""
        return PidGains(
            proportional, integral, derivative, self.derivative_filter, lead=self.lead,
            motion=self.motion,
        )  # fmt: skip


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


def unknown_loops(
    task: DesignTask, case: LoopCase, omega: Real
) -> list[tuple[Complex, Complex | float, Complex]]:
    """Loops of an operating point that a design has to keep stable.

    With an observed motion, they are the loop with the unknown delay in the commands; in the
    position alone; in the pressures alone; and that of a heavier limb. A filtered derivative sees
    the position only, so that the first one stands for all.

    Returns
    -------
    list of (plant, position, derivative)
        Response to the law's output; measured position, and derivative with its lead, each per true
        position.
    """
    unit, s = task.gains(0.0, 0.0, 1.0), 1j * omega
    plant = frequency_response(case.point, case.loop, task.timing, omega)
    loops: list[tuple[Complex, Complex | float, Complex]] = [
        (plant, np.ones_like(s), derivative_response(unit, task.timing, omega))
    ]
    if task.motion == 0.0:
        return loops
    sooner = dataclasses.replace(
        task.timing, transport_delay=task.timing.transport_delay - task.unknown_delay
    )
    heavy = case.point.heavier(UNKNOWN_INERTIA)
    late, in_time = np.exp(-task.unknown_delay * s), np.ones_like(s)
    for true, timing, position, pressure in (
        (case.point, sooner, late, in_time),
        (case.point, sooner, in_time, late),
        (heavy, task.timing, in_time, in_time),
    ):
        muscles = true.dynamic_stiffness(s) * pressure
        modelled = case.point.heavier(0.0).dynamic_stiffness(s) * position
        explained = case.point.accelerations(1.0)[0] * (muscles - modelled)
        plant = frequency_response(true, case.loop, timing, omega)
        derivative = derivative_response(unit, timing, omega, position, explained)
        loops.append((plant, position, derivative))
    return loops


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
        loops = [loop for case in task.cases for loop in unknown_loops(task, case, OMEGA)]
        plant, proportional, derivative = (np.array(part) for part in zip(*loops, strict=True))
        kinds = len(loops) // len(task.cases)
        self._task = task
        self._stated = slice(0, None, kinds)
        self._requirements = [
            (slice(kind, None, kinds), margin, sensitivity)
            for kind, (margin, sensitivity) in enumerate(
                ((task.phase_margin, task.sensitivity), *UNKNOWN_MARGINS)[:kinds]
            )
        ]
        self._scale = 1.0 / float(np.median(np.abs(plant[self._stated, 0])))
        self._parts = [
            (np.ascontiguousarray(part.real), np.ascontiguousarray(part.imag))
            for part in (
                plant * proportional,
                plant * proportional / (1j * OMEGA),
                plant * derivative,
            )
        ]
        hertz = OMEGA / (2.0 * math.pi)
        low, high = np.searchsorted(hertz, task.band)
        self._in_band = slice(int(low), int(high))

    def gains(self, exponents: Real) -> PidGains:
        """The gains at a point of the search, which is given as three exponents of ten."""
        return self._task.gains(*(self._scale * 10.0 ** float(each) for each in exponents))

    def __call__(self, exponents: Real) -> float:
        """Cost at a point of the search."""
        return self.of(self.gains(exponents))

    def of(self, gains: PidGains) -> float:
        """Largest RMS of |S| over the tracking band [-]; above INFEASIBLE a constraint is violated.

        Parameters
        ----------
        gains : PidGains
            Gains with the derivative filter, the lead and the observed motion of the task.
        """
        three = gains.proportional, gains.integral, gains.derivative
        opened_re, opened_im = (
            three[0] * self._parts[0][part]
            + three[1] * self._parts[1][part]
            + three[2] * self._parts[2][part]
            for part in (0, 1)
        )
        returned_re = 1.0 + opened_re
        squared_im = opened_im * opened_im
        squared_distance = returned_re * returned_re + squared_im
        squared_size = opened_re * opened_re + squared_im
        excess = max(1.0 - gains.integral * LONGEST_INTEGRAL_TIME / gains.proportional, 0.0)
        for rows, least, most in self._requirements:
            nearest = 1.0 / math.sqrt(float(squared_distance[rows].min()))
            margin = least_phase_margin(opened_re[rows], opened_im[rows], squared_size[rows])
            excess += max(nearest - most, 0.0) + max(least - margin, 0.0)
        if not encloses_nothing(returned_re, opened_im):
            return WORSE_THAN_ANY + excess
        squared_sensitivity = 1.0 / squared_distance[self._stated, self._in_band]
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
