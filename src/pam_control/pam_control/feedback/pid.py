"""PID with a filtered derivative of the error, a lead on it, and back-calculated anti-windup.

Where the motion is observed (`motion_observer`), its derivatives take the place of filtered ones.
The lead makes up for a lag between the output and the torque that it causes: the derivative passes
1 + lead s, filtered as the derivative is.

Source: K. J. Astrom and T. Hagglund, Advanced PID Control, ISA 2006, chapter 3 (parallel form,
derivative filter, tracking time of the integrator); S. Jung and R. C. Dorf, "Analytic PIDA
controller design technique for a third order system", CDC 1996 (the derivative of the derivative).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

from pam_control.limited import limited

SHRINKING_TIME: Final = 2.0  # s, of an integral above its limit

F_INTEGRAL, F_ERROR, F_SLOPE, F_BEND = range(4)
F_PLANNED, F_MOTION = 4, 5
N_FEEDBACK: Final = 8
"""State of a joint's feedback: integral in the unit of the output, last error [rad], its filtered
or observed derivative [rad/s] and the derivative of that [rad/s^2], acceleration of the reference
at the last new measurement [rad/s^2], and from `F_MOTION` on what `observe_motion` observes."""
G_PROPORTIONAL, G_INTEGRAL, G_DERIVATIVE, G_FILTER, G_OBSERVER, G_LEAD, G_MOTION = range(7)
N_GAINS: Final = 7
"""Gains of a joint, in the order of `PidGains`."""


@dataclass(frozen=True, slots=True)
class PidGains:
    """Parallel-form gains of one joint."""

    # proportional, integral, derivative: in the output's unit per rad, per rad s, and times s per
    # rad
    proportional: float
    integral: float
    derivative: float
    derivative_filter: float  # time constant of the derivative's first-order filter [s]
    observer: float = 0.0  # bandwidth of the disturbance observer beside the PID [rad/s]; 0: none
    lead: float = 0.0  # time constant of the lead on the derivative [s]; 0: none
    # bandwidth of the observer that the derivatives come from [rad/s]; 0: they are filtered
    motion: float = 0.0

    @property
    def row(self) -> list[float]:
        """The gains as `G_PROPORTIONAL` and its like."""
        return [
            self.proportional, self.integral, self.derivative, self.derivative_filter,
            self.observer, self.lead, self.motion,
        ]  # fmt: skip


def begin_feedback(row: Any, f: int, integral: float) -> None:
    """Reset the state; for zero error the next output is `integral`."""
    row[f + F_INTEGRAL] = integral
    row[f + F_ERROR] = row[f + F_MOTION] = math.nan
    row[f + F_SLOPE] = row[f + F_BEND] = row[f + F_PLANNED] = 0.0


def continue_feedback(row: Any, f: int, g: int, output: float, error: float) -> None:
    """Set the integral so that the gains give `output` for the present error [rad]."""
    row[f + F_INTEGRAL] = output - row[g + G_PROPORTIONAL] * error - led(row, f, g)


def pid_output(row: Any, f: int, g: int, error: float, step: float) -> float:
    """Output for `error` [rad], `step` [s] after the last one; step 0 means no new sample.

    Parameters
    ----------
    row : row
        State of the joint, in which that of the feedback begins at `f`, and the gains at `g`.
    f, g : int
        `F_INTEGRAL`, `G_PROPORTIONAL` and their like are counted from there.
    error, step : float
        [rad], [s].
    """
    if math.isnan(row[f + F_ERROR]):
        row[f + F_ERROR] = error
    if step > 0.0 and row[g + G_MOTION] == 0.0:
        weight = step / (row[g + G_FILTER] + step)
        change = weight * ((error - row[f + F_ERROR]) / step - row[f + F_SLOPE])
        row[f + F_BEND] += weight * (change / step - row[f + F_BEND])
        row[f + F_SLOPE] += change
    if step > 0.0:
        row[f + F_ERROR] = error
    return float(row[g + G_PROPORTIONAL] * error + row[f + F_INTEGRAL] + led(row, f, g))


def led(row: Any, f: int, g: int) -> float:
    """The derivative's part of the output."""
    return float(row[g + G_DERIVATIVE] * (row[f + F_SLOPE] + row[g + G_LEAD] * row[f + F_BEND]))


def integrate(
    row: Any, f: int, g: int, error: float, step: float, missed: float, limit: float, frozen: bool,
    handed: float = 0.0,
) -> None:  # fmt: skip
    """Advance the integrator.

    Parameters
    ----------
    row, f, g
        As for `pid_output`.
    error : float
        [rad].
    step : float
        [s].
    missed : float
        Reachable minus requested output, in the output's unit; not 0 if the output is clipped.
    limit : float
        Largest absolute value of what the integral carries, in the output's unit. An integral
        above it, as after a change of parameters, shrinks to it slowly, so that the joint does not
        drop.
    frozen : bool
        The integral may only shrink, because an inner loop is saturated, which `missed` does
        not show.
    handed : float
        Part of the integral that a feedforward takes off again: the integral carries the rest.
    """
    carried = row[f + F_INTEGRAL] - handed
    change = row[g + G_INTEGRAL] * error * step
    if missed != 0.0 and row[g + G_INTEGRAL] > 0.0:
        # tracking time of the anti-windup: the integral time constant
        tracking = max(row[g + G_PROPORTIONAL] / row[g + G_INTEGRAL], 2.0 * row[g + G_FILTER])
        change += missed * min(step / tracking, 1.0)
    if frozen and change * carried > 0.0:
        return
    limit = max(limit, abs(carried) * (1.0 - min(step / SHRINKING_TIME, 1.0)))
    row[f + F_INTEGRAL] = handed + limited(carried + change, -limit, limit)


def hand_over(carried: float, torque: float, handed: float, most: float) -> float:
    """What a feedforward takes off an integral, after it has learnt to give a torque [N m].

    Parameters
    ----------
    carried : float
        By the integral until now. It only shrinks towards 0: what the proportional part carried was
        never in it.
    torque : float
        Which another part of the law gives from now on.
    handed, most : float
        What is taken off until now, and its largest absolute value.
    """
    given = 0.0
    if torque * carried > 0.0:
        given = math.copysign(min(abs(carried), abs(torque)), carried)
    return limited(handed + given, -most, most)
