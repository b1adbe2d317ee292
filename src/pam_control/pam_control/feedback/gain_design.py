"""Gains from the rig: a PID shaped for the least tracking error at given margins.

For every law the same question is answered in the same way, so that comparing laws is fair: which
PID keeps |S|, the error per reference, smallest (root mean square over the tracking band, at the
worst operating point) while at every operating point the closed loop is stable, the phase margin
is at least the target and |S| nowhere exceeds the sensitivity limit. The loop is the linearised
joint with its pressure loops, valve lag, sampling and transport delay (`linear_joint`).

Why not LQR: the loop's delay and the pressure loops make the state long and the weights say
nothing about margins; a PID has three numbers that a user can read, override and check.

Sources: K. J. Astrom and T. Hagglund, Advanced PID Control, ISA 2006, chapter 7 (design under a
constraint on the sensitivity); margins and poles by python-control.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import control
import numpy as np
import numpy.typing as npt
from scipy.optimize import differential_evolution

from pam_control.feedback.linear_joint import (
    Complex,
    LoopStructure,
    LoopTiming,
    OperatingPoint,
    frequency_response,
    state_space,
)
from pam_control.feedback.pid import PidGains
from pam_model.errors import PamError

LEAST_PHASE_MARGIN = math.radians(30.0)
PRESSURE_PHASE_MARGIN = math.radians(60.0)
TRACKING_BAND = (0.1, 2.0)  # Hz
OMEGA = np.geomspace(0.05, 500.0, 320)  # rad/s
WORSE_THAN_ANY = 1e6


class ControlDesignError(PamError):
    """No safe gains: the message names the joint, the operating point and its margins."""


@dataclass(frozen=True, slots=True)
class LoopCase:
    """One operating point and how the law is wired there."""

    point: OperatingPoint
    loop: LoopStructure


@dataclass(frozen=True, slots=True)
class Margins:
    """Of one loop at one operating point.

    Attributes
    ----------
    position, stiffness : float
        The operating point [rad], [N m/rad].
    stable : bool
        All closed-loop poles in the left half plane.
    phase_margin : float
        [rad]; infinite without a gain crossover.
    gain_margin : float
        Factor; infinite without a phase crossover.
    modulus_margin : float
        Least distance of the loop from -1 [-], the inverse of the sensitivity peak.
    crossover : float
        Highest frequency of loop gain one [rad/s], 0 where there is none.
    """

    position: float
    stiffness: float
    stable: bool
    phase_margin: float
    gain_margin: float
    modulus_margin: float
    crossover: float

    def __str__(self) -> str:
        """One line with units."""
        return (
            f"at {self.position:+.2f} rad, {self.stiffness:.1f} N m/rad: "
            f"{'stable' if self.stable else 'UNSTABLE'}, "
            f"phase margin {math.degrees(self.phase_margin):.1f} deg, "
            f"gain margin {self.gain_margin:.2f}, modulus margin {self.modulus_margin:.2f}, "
            f"crossover {self.crossover:.1f} rad/s"
        )


def design_pressure_gain(timing: LoopTiming, phase_margin: float = PRESSURE_PHASE_MARGIN) -> float:
    """Gain k [1/s] of the pressure loop k H(s)/s with this phase margin [rad].

    The loop's crossover is k as long as the valve's residual lag is short against it.
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


def pid_response(gains: PidGains, omega: npt.NDArray[np.float64]) -> Complex:
    """Frequency response of the PID at `omega` [rad/s]."""
    s = 1j * omega
    slope = gains.derivative * s / (gains.derivative_filter * s + 1.0)
    return np.asarray(gains.proportional + gains.integral / s + slope, dtype=np.complex128)


def margins(case: LoopCase, timing: LoopTiming, gains: PidGains) -> Margins:
    """Margins of one loop: delays exact in the margins, Pade in the poles."""
    omega = np.geomspace(0.05, 500.0, 400)
    opened = pid_response(gains, omega) * frequency_response(case.point, case.loop, timing, omega)
    gm, pm, sm, _, wgc, _ = control.stability_margins(control.frd(opened, omega, smooth=True))
    above = np.abs(opened) > 1.0
    last = np.nonzero(above[:-1] & ~above[1:])[0]
    pid = control.ss([[0.0]], [[1.0]], [[gains.integral]], [[gains.proportional]])
    if gains.integral == 0.0:
        pid = control.ss([], [], [], [[gains.proportional]])
    if gains.derivative != 0.0:
        Tf = max(gains.derivative_filter, 1e-4)
        slope = control.ss(
            [[-1.0 / Tf]], [[1.0]], [[-gains.derivative / Tf**2]], [[gains.derivative / Tf]]
        )
        pid = control.parallel(pid, slope)
    closed = control.feedback(control.series(pid, state_space(case.point, case.loop, timing)), 1)
    return Margins(
        position=case.point.position,
        stiffness=case.point.stiffness,
        stable=bool(np.all(closed.poles().real < 0.0)),
        phase_margin=math.radians(float(pm)) if np.isfinite(pm) else math.inf,
        gain_margin=float(gm),
        modulus_margin=float(sm),
        crossover=float(omega[last[-1]]) if last.size else float(wgc if np.isfinite(wgc) else 0.0),
    )


def checked_margins(
    joint: str, cases: Sequence[LoopCase], timing: LoopTiming, gains: PidGains
) -> list[Margins]:
    """Margins at every operating point, the one with the least phase margin first.

    Raises
    ------
    ControlDesignError
        When a loop is unstable or has less than 30 degrees of phase margin.
    """
    found = sorted(
        (margins(case, timing, gains) for case in cases),
        key=lambda each: (each.stable, each.phase_margin),
    )
    worst = found[0]
    if not worst.stable or worst.phase_margin < LEAST_PHASE_MARGIN:
        raise ControlDesignError(
            f"{joint}: these gains are not safe, {worst}; needed: stable with at least "
            f"{math.degrees(LEAST_PHASE_MARGIN):.0f} deg (proportional {gains.proportional:.3g}, "
            f"integral {gains.integral:.3g}, derivative {gains.derivative:.3g}, loop delay "
            f"{timing.delay * 1e3:.1f} ms)"
        )
    return found


def design_pid(
    joint: str,
    cases: Sequence[LoopCase],
    timing: LoopTiming,
    *,
    phase_margin: float,
    sensitivity: float,
    derivative_filter: float,
    band: tuple[float, float] = TRACKING_BAND,
) -> PidGains:
    """The PID of least tracking error within the margins.

    Parameters
    ----------
    joint : str
        For messages.
    cases : sequence of LoopCase
        The operating grid.
    timing : LoopTiming
        The loop's delays.
    phase_margin : float
        Least at any operating point [rad].
    sensitivity : float
        Largest |S| at any frequency and operating point [-].
    derivative_filter : float
        [s].
    band : (float, float), optional
        Of the references to track [Hz].

    Raises
    ------
    ControlDesignError
        When no gains satisfy the constraints.
    """
    plant = np.array([frequency_response(c.point, c.loop, timing, OMEGA) for c in cases])
    s = 1j * OMEGA
    slope = s / (derivative_filter * s + 1.0)
    hertz = OMEGA / (2.0 * math.pi)
    inside = (hertz >= band[0]) & (hertz <= band[1])
    scale = 1.0 / float(np.median(np.abs(plant[:, 0])))

    def gains_of(x: npt.NDArray[np.float64]) -> tuple[float, float, float]:
        kp, ki, kd = (scale * 10.0 ** float(exponent) for exponent in x)
        return kp, ki, kd

    def cost(x: npt.NDArray[np.float64]) -> float:
        kp, ki, kd = gains_of(x)
        opened = (kp + ki / s + kd * slope) * plant
        returned = 1.0 + opened
        distance = np.abs(returned)
        excess = max(float(1.0 / distance.min()) - sensitivity, 0.0)
        excess += max(phase_margin - _least_phase_margin(opened), 0.0)
        # Nyquist: from -90 degrees (the integrator) the phase of 1 + L must end at 0.
        if np.any(np.abs(np.unwrap(np.angle(returned), axis=1)[:, -1]) > 0.5 * math.pi):
            return WORSE_THAN_ANY + excess
        error = float(np.sqrt(np.mean(distance[:, inside] ** -2.0, axis=1)).max())
        return error + 1e3 * excess

    best = differential_evolution(
        cost,
        bounds=[(-2.5, 1.5), (-1.5, 3.0), (-4.0, 0.5)],
        seed=1,
        popsize=14,
        maxiter=60,
        tol=1e-4,
        polish=False,
    )
    if best.fun > 1e2:
        raise ControlDesignError(
            f"{joint}: no gains reach {math.degrees(phase_margin):.0f} deg of phase margin and a "
            f"sensitivity below {sensitivity:g} at every operating point (loop delay "
            f"{timing.delay * 1e3:.1f} ms, pressure loop {cases[0].loop.pressure_gain:.1f} 1/s)"
        )
    return PidGains(*gains_of(best.x), derivative_filter)


def _least_phase_margin(opened: Complex) -> float:
    """Least phase margin [rad] over the rows of a loop gain, by its unit crossings."""
    size = np.abs(opened)
    crossing = (size[:, :-1] > 1.0) != (size[:, 1:] > 1.0)
    if not crossing.any():
        return math.pi
    weight = ((1.0 - size[:, :-1]) / (size[:, 1:] - size[:, :-1] + 1e-300))[crossing]
    before, after = opened[:, :-1][crossing], opened[:, 1:][crossing]
    return float(np.min(np.abs(np.angle(-(before + weight * (after - before))))))
