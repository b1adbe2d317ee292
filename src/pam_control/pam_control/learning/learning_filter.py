"""From the error of a motion to the change of its torque, so that the next error is smaller.

After a repetition with the error e and the added torque w, the next torque is

    w' = Q (w + L e)

Both filters see the whole motion, so they may look ahead. With the response P_i from w to the
position in the closed loop, for every operating point, unknown delay and inertia i, the error of
the part that repeats changes by Q (1 - L P_i) from one repetition to the next. At each frequency, L
makes the largest |1 - L P_i| of all i as small as possible, with a penalty on |L| where all
responses are small: a least-squares inverse would follow the majority, and a loop with high gains
answers very differently near its crossover if it is later or heavier than told. The minimax L is
found by Lawson's iteration, a least-squares fit whose weights grow with the errors.
Q is a low pass without phase. It is as wide as the requirement allows that |Q (1 - L P_i)| is below
1 at all frequencies, and at most CONTRACTION above `SLOW`, for all i: then the learning converges
monotonically for each of these plants.

Sources: D. A. Bristow, M. Tharayil, A. G. Alleyne, "A survey of iterative learning control", IEEE
Control Systems Magazine 26 (2006) 96-114, equations 17 to 20 (monotonic convergence, zero-phase Q);
S. W. Ellacott, J. Williams, "Linear Chebyshev approximation in the complex plane using Lawson's
algorithm", Mathematics of Computation 30 (1976) 35-44.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from pam_control.feedback.linear_joint import Complex, LoopTiming, frequency_response
from pam_control.feedback.margins import ControlDesignError, LoopCase, pid_response
from pam_control.feedback.pid import PidGains

UNKNOWN_DELAYS: Final = (0.0, 0.005, 0.01, 0.015)  # s, in addition to the stated ones
UNKNOWN_INERTIAS: Final = (0.8, 1.0, 1.5)
CONTRACTION: Final = 0.9
SLOW: Final = 3.0  # rad/s; below it the integral of the feedback leaves hardly any error to learn
KEPT: Final = 0.995  # Q at rest: what no repetition confirms fades
REGULARISATION: Final = 0.01  # of the largest squared response
ITERATIONS: Final = 30
GRID: Final = np.geomspace(0.05, 300.0, 250)  # rad/s
CUT_OFFS: Final = np.geomspace(50.0, 3.0, 40)  # rad/s
PADDING: Final = 1.0  # s of rest before and after a motion, for what looks ahead and behind

Array = npt.NDArray[np.float64]


class LearningFilter:
    """The filters L and Q of one joint.

    Parameters
    ----------
    joint : str
        Name for messages.
    cases : sequence of LoopCase
        The loops at the operating points.
    timing : LoopTiming
        The delays, without an unknown one.
    gains : PidGains
        The feedback that is at work.

    Attributes
    ----------
    cut_off : float
        Of Q, which is exp(-(w/cut_off)^2 / 2) [rad/s].
    contraction : float
        Largest factor |Q (1 - L P)| of any plant above the frequency `SLOW` [-].

    Raises
    ------
    ControlDesignError
        When no filter converges for the whole range.
    """

    def __init__(
        self, joint: str, cases: Sequence[LoopCase], timing: LoopTiming, gains: PidGains
    ) -> None:
        self._gains = gains
        family = [
            (_heavier(case, inertia), later(timing, delay))
            for case in cases
            for delay in UNKNOWN_DELAYS
            for inertia in UNKNOWN_INERTIAS
        ]
        responses = np.array([self.closed_response(case, late, GRID) for case, late in family])
        self._inverse = minimax_inverse(responses)
        left: Array = np.abs(1.0 - self._inverse * responses).max(axis=0)
        for cut_off in CUT_OFFS:
            remains = _low_pass(GRID, cut_off) * left
            contraction = float(remains[GRID >= SLOW].max())
            if contraction <= CONTRACTION and float(remains.max()) < 1.0:
                self.cut_off, self.contraction = float(cut_off), contraction
                return
        raise ControlDesignError(
            f"{joint}: no learning filter converges for unknown delays up to "
            f"{1e3 * max(UNKNOWN_DELAYS):g} ms and {max(UNKNOWN_INERTIAS):g} times the inertia"
        )

    def closed_response(self, case: LoopCase, timing: LoopTiming, omega: Array) -> Complex:
        """Response from the added torque to the position, in the closed loop [rad/(N m)]."""
        plant = frequency_response(case.point, case.loop, timing, omega)
        result: Complex = plant / (1.0 + plant * pid_response(self._gains, timing, omega))
        return result

    def next_torque(self, torque: Array, error: Array, period: float) -> Array:
        """The torque of the next repetition [N m].

        Parameters
        ----------
        torque, error : (n,) array
            Added torque [N m] and error [rad] of a repetition.
        period : float
            Time between two samples [s].
        """
        padding = round(PADDING / period)
        count = 2 ** math.ceil(math.log2(error.size + 2 * padding))
        omega = 2.0 * math.pi * np.fft.rfftfreq(count, period)
        omega[0] = omega[1]
        # above the grid, Q lets nothing pass
        inverse = np.interp(omega, GRID, self._inverse)
        extended = (np.pad(each, padding, mode="edge") for each in (torque, error))
        old, seen = (np.fft.rfft(each, count) for each in extended)
        changed = np.fft.irfft(_low_pass(omega, self.cut_off) * (old + inverse * seen), count)
        result: Array = changed[padding : padding + error.size]
        return result


def minimax_inverse(responses: Complex) -> Complex:
    """L with the least largest |1 - L P| of several responses, at each frequency.

    Parameters
    ----------
    responses : (m, n) complex array
        P of m plants at n frequencies [rad/(N m)].

    Returns
    -------
    (n,) complex array
        L [N m/rad].
    """
    squares: Array = np.abs(responses) ** 2
    penalty = REGULARISATION * float(squares.mean(axis=0).max())
    weights: Array = np.full(responses.shape, 1.0 / len(responses))
    for _ in range(ITERATIONS):
        size = (weights * squares).sum(axis=0) + penalty
        inverse: Complex = np.asarray((weights * np.conj(responses)).sum(axis=0) / size)
        weights = weights * np.abs(1.0 - inverse * responses)
        weights /= weights.sum(axis=0)
    return inverse


def _low_pass(omega: Array, cut_off: float) -> Array:
    result: Array = KEPT * np.exp(-0.5 * (omega / cut_off) ** 2)
    return result


def later(timing: LoopTiming, delay: float) -> LoopTiming:
    """The timing with an unknown delay [s]."""
    return dataclasses.replace(timing, transport_delay=timing.transport_delay + delay)


def _heavier(case: LoopCase, factor: float) -> LoopCase:
    return dataclasses.replace(case, point=case.point.heavier(factor))
