"""Stability margins of a joint's position loop at one operating point.

The margins are those of the exact frequency response, including the transport delay. The response
is sampled on a grid. Around each crossing and each minimum it is sampled again on finer and finer
grids, so the result contains no interpolation. Stability is decided by the closed-loop poles
(`closed_loop`).

Source: K. J. Astrom and R. M. Murray, Feedback Systems, Princeton 2008, section 9.3 (gain, phase
and modulus margin). If there are several crossings, the one nearest to instability counts, as in
python-control's `stability_margins`.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pam_control.feedback.gain_schedule import GainSchedule
from pam_control.feedback.linear_joint import (
    Complex,
    Frequencies,
    LoopStructure,
    LoopTiming,
    frequency_response,
)
from pam_control.feedback.motion_observer import seen_motion
from pam_control.feedback.pid import PidGains
from pam_model.errors import PamError
from pam_model.views.linearised_joint import OperatingPoint

LEAST_PHASE_MARGIN = math.radians(30.0)
GRID = np.geomspace(0.05, 500.0, 400)  # rad/s
ZOOMS, ZOOM_POINTS = 3, 33  # each zoom makes an interval of the grid 32 times narrower

Response = Callable[[Frequencies], Complex]
"""Maps angular frequencies [rad/s] to the complex loop gain."""


class ControlDesignError(PamError):
    """There are no safe gains; the message names joint, operating point and margins."""


@dataclass(frozen=True, slots=True)
class LoopCase:
    """One operating point, and how the control law is connected there."""

    point: OperatingPoint  # the equilibrium
    loop: LoopStructure  # the connection
    # stiffness by which the gains are scheduled there [N m/rad]: the asked one, which gravity or
    # the pressures may not allow. 0 for a law whose gains are not scheduled
    scheduled: float = 0.0


class LoopMargins(NamedTuple):
    """Margins of one loop gain, in the order and units of the last fields of `Margins`."""

    phase_margin: float
    gain_margin: float
    modulus_margin: float
    crossover: float


@dataclass(frozen=True, slots=True)
class Margins:
    """Margins of one loop at one operating point."""

    # position, stiffness: the operating point [rad], [N m/rad]
    position: float
    stiffness: float
    stable: bool  # all closed-loop poles in the left half plane
    # the margin nearest to 0 of all gain crossings [rad]; infinite without a crossing
    phase_margin: float
    # the factor nearest to 1 of all phase crossings [-]; infinite without a crossing
    gain_margin: float
    # least distance of the loop from -1 [-], the inverse of the sensitivity peak
    modulus_margin: float
    crossover: float  # highest frequency with a loop gain of one [rad/s]; 0 if there is none

    def __str__(self) -> str:
        """Give operating point and margins in one line with units."""
        return (
            f"at {self.position:+.2f} rad, {self.stiffness:.1f} N m/rad: "
            f"{'stable' if self.stable else 'UNSTABLE'}, "
            f"phase margin {math.degrees(self.phase_margin):.1f} deg, "
            f"gain margin {self.gain_margin:.2f}, modulus margin {self.modulus_margin:.2f}, "
            f"crossover {self.crossover:.1f} rad/s"
        )


def pid_response(
    gains: PidGains,
    timing: LoopTiming,
    omega: Frequencies,
    position: Complex | float = 1.0,
    explained: Complex | None = None,
) -> Complex:
    """Frequency response of the PID, per true position.

    Parameters
    ----------
    gains : PidGains
        The gains.
    timing : LoopTiming
        The period of the measurements, and the lag of the pressure sensors.
    omega : (n,) array
        [rad/s].
    position : (n,) array or float, optional
        Measured position per true position [-].
    explained : (n,) array, optional
        Acceleration by the model per true position [1/s^2]; by default the true one.
    """
    led = gains.derivative * derivative_response(gains, timing, omega, position, explained)
    fed = (gains.proportional + gains.integral / (1j * omega)) * position + led
    return np.asarray(fed, dtype=np.complex128)


def derivative_response(
    gains: PidGains,
    timing: LoopTiming,
    omega: Frequencies,
    position: Complex | float = 1.0,
    explained: Complex | None = None,
) -> Complex:
    """The derivative with its lead, for a gain of one; the arguments are those of the PID."""
    s = 1j * omega
    if gains.motion > 0.0:
        explained = s * s if explained is None else explained
        seen = seen_motion(gains.motion, timing, omega, position, explained)
        return seen.speed + gains.lead * seen.acceleration
    slope = s / (gains.derivative_filter * s + 1.0)
    return np.asarray(slope * (1.0 + gains.lead * slope) * position, dtype=np.complex128)


def loop_margins(respond: Response, grid: Frequencies = GRID) -> LoopMargins:
    """Margins of a loop gain given as a function.

    Parameters
    ----------
    respond : callable
        The loop gain L at an array of angular frequencies [rad/s].
    grid : (n,) array, optional
        Increasing angular frequencies [rad/s], so close that at most one crossing lies between
        two neighbours.
    """
    opened = respond(grid)
    size = np.abs(opened)
    imaginary = opened.imag
    gain_crossings = np.nonzero((size[:-1] > 1.0) != (size[1:] > 1.0))[0]
    phase_crossings = np.nonzero(
        ((imaginary[:-1] > 0.0) != (imaginary[1:] > 0.0))
        & (np.minimum(opened.real[:-1], opened.real[1:]) <= 0.0)
    )[0]
    phase_margin = gain_margin = math.inf
    crossover = 0.0
    for index in gain_crossings:
        crossover, value = _crossing(respond, grid[index : index + 2], lambda L: np.abs(L) - 1.0)
        phase_margin = min(phase_margin, cmath.phase(-value), key=abs)
    for index in phase_crossings:
        _, value = _crossing(respond, grid[index : index + 2], lambda L: L.imag)
        if value.real < 0.0 and abs(math.log(-value.real)) < abs(math.log(gain_margin)):
            gain_margin = -1.0 / value.real
    return LoopMargins(phase_margin, gain_margin, _least_distance(respond, grid, opened), crossover)


def _crossing(
    respond: Response, ends: Frequencies, signed: Callable[[Complex], Frequencies]
) -> tuple[float, complex]:
    """Frequency [rad/s] and loop gain where `signed` changes its sign between two frequencies."""
    low, high = float(ends[0]), float(ends[1])
    for _ in range(ZOOMS):
        omega = np.linspace(low, high, ZOOM_POINTS)
        values = signed(respond(omega)) > 0.0
        first = int(np.nonzero(values[:-1] != values[1:])[0][0])
        low, high = float(omega[first]), float(omega[first + 1])
    middle = 0.5 * (low + high)
    return middle, complex(respond(np.array([middle]))[0])


def _least_distance(respond: Response, grid: Frequencies, opened: Complex) -> float:
    """Least distance of the loop gain from -1."""
    place = int(np.argmin(np.abs(1.0 + opened)))
    low, high = float(grid[max(place - 1, 0)]), float(grid[min(place + 1, len(grid) - 1)])
    for _ in range(ZOOMS):
        omega = np.linspace(low, high, ZOOM_POINTS)
        distance = np.abs(1.0 + respond(omega))
        place = int(np.argmin(distance))
        low = float(omega[max(place - 1, 0)])
        high = float(omega[min(place + 1, ZOOM_POINTS - 1)])
    return float(distance[place])


def margins(case: LoopCase, timing: LoopTiming, gains: PidGains, stable: bool) -> Margins:
    """Margins of one joint's loop with these gains at one operating point.

    `stable` is the answer of `closed_loop.is_stable` for the same arguments.
    """

    def respond(omega: Frequencies) -> Complex:
        joint = frequency_response(case.point, case.loop, timing, omega)
        return pid_response(gains, timing, omega) * joint

    return Margins(case.point.position, case.point.stiffness, stable, *loop_margins(respond))


def checked_margins(
    joint: str,
    cases: Sequence[LoopCase],
    timing: LoopTiming,
    gains: GainSchedule,
    stable: Sequence[bool],
) -> list[Margins]:
    """Margins at every operating point, the one with the least phase margin first.

    `stable` has one answer of `closed_loop.is_stable` for each of the cases.

    Raises
    ------
    ControlDesignError
        When a loop is unstable or has less than 30 degrees of phase margin.
    """
    found = sorted(
        (
            margins(case, timing, gains.at(case.scheduled), s)
            for case, s in zip(cases, stable, strict=True)
        ),
        key=lambda each: (each.stable, each.phase_margin),
    )
    worst = found[0]
    if not worst.stable or worst.phase_margin < LEAST_PHASE_MARGIN:
        used = gains.at(worst.stiffness)
        raise ControlDesignError(
            f"{joint}: these gains are not safe, {worst}; needed: stable with at least "
            f"{math.degrees(LEAST_PHASE_MARGIN):.0f} deg (proportional {used.proportional:.3g}, "
            f"integral {used.integral:.3g}, derivative {used.derivative:.3g}, loop delay "
            f"{timing.delay * 1e3:.1f} ms)"
        )
    return found
