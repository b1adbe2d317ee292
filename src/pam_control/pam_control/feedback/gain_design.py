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
from collections.abc import Sequence
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
COARSE = OMEGA[::2]
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
position, in the pressures, and with a heavier limb."""

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


Loops = list[tuple[Complex, Complex, Complex]]
"""Response to a law's output; measured position, and derivative with its lead, each per true
position."""


def stated_loop(task: DesignTask, case: LoopCase, omega: Real) -> Loops:
    """The loop of an operating point, with the unknown delay in the commands."""
    plant = frequency_response(case.point, case.loop, task.timing, omega)
    unit = task.gains(0.0, 0.0, 1.0)
    one = np.ones(omega.shape, dtype=np.complex128)
    return [(plant, one, derivative_response(unit, task.timing, omega))]


def unknown_loops(task: DesignTask, case: LoopCase, omega: Real) -> Loops:
    """Loops of an operating point that differ from the stated one, for an observed motion.

    They are those with the unknown delay in the position alone and in the pressures alone, and that
    of a heavier limb. A filtered derivative sees the position only, so that the stated loop stands
    for them.
    """
    unit, s = task.gains(0.0, 0.0, 1.0), 1j * omega
    sooner = dataclasses.replace(
        task.timing, transport_delay=task.timing.transport_delay - task.unknown_delay
    )
    late_pressures = dataclasses.replace(sooner, pressure_delay=task.unknown_delay)
    late, in_time = np.exp(-task.unknown_delay * s), np.ones_like(s)
    loops: Loops = []
    for true, timing, position, pressure in (
        (case.point, sooner, late, in_time),
        (case.point, late_pressures, in_time, late),
        (case.point.heavier(UNKNOWN_INERTIA), task.timing, in_time, in_time),
    ):
        muscles = true.dynamic_stiffness(s) * pressure
        modelled = case.point.heavier(0.0).dynamic_stiffness(s) * position
        explained = case.point.accelerations(1.0)[0] * (muscles - modelled)
        plant = frequency_response(true, case.loop, timing, omega)
        derivative = derivative_response(unit, timing, omega, position, explained)
        loops.append((plant, position, derivative))
    return loops


class LoopGains:
    """Loop gains of many loops as sums over the three gains.

    The design evaluates them some thousand times. Therefore they are real arrays of shape (loops,
    frequencies), and no trigonometric function is called.

    Parameters
    ----------
    loops : list of loops
        Of each operating point, in one order.
    omega : (n,) array
        [rad/s].
    limits : sequence of (float, float)
        Least phase margin [rad] and largest sensitivity [-] of each of them.
    """

    def __init__(
        self, loops: list[Loops], omega: Real, limits: Sequence[tuple[float, float]]
    ) -> None:
        rows = [loop for of_point in loops for loop in of_point]
        plant, position, derivative = (np.array(part) for part in zip(*rows, strict=True))
        seen = plant * position
        parts = seen, seen / (1j * omega), plant * derivative
        self._re = [np.ascontiguousarray(part.real) for part in parts]
        self._im = [np.ascontiguousarray(part.imag) for part in parts]
        self._limits = [(slice(k, None, len(limits)), *limit) for k, limit in enumerate(limits)]
        self.size = float(np.median(np.abs(plant[:, 0])))

    def excess(self, gains: PidGains) -> tuple[float, bool, Real]:
        """By how much limits are violated; whether all are stable; |1 + L|^2."""
        three = gains.proportional, gains.integral, gains.derivative
        re, im = (
            three[0] * each[0] + three[1] * each[1] + three[2] * each[2]
            for each in (self._re, self._im)
        )
        returned, squared_im = 1.0 + re, im * im
        squared_distance = returned * returned + squared_im
        squared_size = re * re + squared_im
        excess = 0.0
        for rows, least, most in self._limits:
            nearest = 1.0 / math.sqrt(float(squared_distance[rows].min()))
            margin = least_phase_margin(re[rows], im[rows], squared_size[rows])
            excess += max(nearest - most, 0.0) + max(least - margin, 0.0)
        return excess, encloses_nothing(returned, im), squared_distance


class PidCost:
    """Cost function of the design: tracking error of a PID, with penalties for the constraints.

    Parameters
    ----------
    task : DesignTask
        The joint's loops and the requirements.
    """

    def __init__(self, task: DesignTask) -> None:
        self._task = task
        limits = (task.phase_margin, task.sensitivity)
        self._stated = LoopGains([stated_loop(task, c, OMEGA) for c in task.cases], OMEGA, [limits])
        self._unknown = []
        if task.motion > 0.0:
            loops = [unknown_loops(task, case, COARSE) for case in task.cases]
            self._unknown.append(LoopGains(loops, COARSE, UNKNOWN_MARGINS))
        self._scale = 1.0 / self._stated.size
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
        excess, stable, squared_distance = self._stated.excess(gains)
        for unknown in self._unknown if stable else ():
            more, stable, _ = unknown.excess(gains)
            excess += more
        excess += max(1.0 - gains.integral * LONGEST_INTEGRAL_TIME / gains.proportional, 0.0)
        if not stable:
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
