"""PID with a filtered derivative of the error, a lead on it, and back-calculated anti-windup.

The lead makes up for a lag between the output and the torque that it causes: the derivative passes
1 + lead s, filtered as the derivative is.

Source: K. J. Astrom and T. Hagglund, Advanced PID Control, ISA 2006, chapter 3 (parallel form,
derivative filter, tracking time of the integrator); S. Jung and R. C. Dorf, "Analytic PIDA
controller design technique for a third order system", CDC 1996 (the derivative of the derivative).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pam_control.limited import limited

SHRINKING_TIME = 2.0  # s, of an integral above its limit


@dataclass(frozen=True, slots=True)
class PidGains:
    """Parallel-form gains of one joint.

    Attributes
    ----------
    proportional, integral, derivative : float
        In the output's unit per rad, per rad s, and times s per rad.
    derivative_filter : float
        Time constant of the derivative's first-order filter [s].
    observer : float
        Bandwidth of the disturbance observer beside the PID [rad/s]; 0: none.
    lead : float
        Time constant of the lead on the derivative [s]; 0: none.
    """

    proportional: float
    integral: float
    derivative: float
    derivative_filter: float
    observer: float = 0.0
    lead: float = 0.0

    @property
    def tracking_time(self) -> float:
        """Tracking time of the anti-windup [s]: the integral time constant."""
        if self.integral <= 0.0:
            return math.inf
        return max(self.proportional / self.integral, 2.0 * self.derivative_filter)


class Pid:
    """The state of one joint's PID; the gains are passed at every call, so they may change."""

    def __init__(self) -> None:
        self.integral = 0.0
        self._error = math.nan
        self._slope = self._bend = 0.0

    def reset(self, integral: float = 0.0) -> None:
        """Reset the state; for zero error the next output is `integral`."""
        self.integral = integral
        self._error = math.nan
        self._slope = self._bend = 0.0

    def continue_at(self, output: float, error: float, gains: PidGains) -> None:
        """Set the integral so that these gains give `output` for the present error [rad]."""
        self.integral = output - gains.proportional * error - self._led(gains)

    def output(self, error: float, step: float, gains: PidGains) -> float:
        """Output for `error` [rad], `step` [s] after the last one; step 0 means no new sample."""
        if math.isnan(self._error):
            self._error = error
        if step > 0.0:
            weight = step / (gains.derivative_filter + step)
            change = weight * ((error - self._error) / step - self._slope)
            self._bend += weight * (change / step - self._bend)
            self._slope += change
            self._error = error
        return gains.proportional * error + self.integral + self._led(gains)

    def _led(self, gains: PidGains) -> float:
        """The derivative's part of the output."""
        return gains.derivative * (self._slope + gains.lead * self._bend)

    def integrate(
        self,
        error: float,
        step: float,
        gains: PidGains,
        *,
        missed: float,
        limit: float,
        frozen: bool = False,
    ) -> None:
        """Advance the integrator.

        Parameters
        ----------
        error : float
            [rad].
        step : float
            [s].
        gains : PidGains
            The present gains.
        missed : float
            Reachable minus requested output, in the output's unit; not 0 if the output is clipped.
        limit : float
            Largest absolute value of the integral, in the output's unit. An integral above it, as
            after a change of parameters, shrinks to it slowly, so that the joint does not drop.
        frozen : bool, optional
            The integral may only shrink, because an inner loop is saturated, which `missed` does
            not show.
        """
        change = gains.integral * error * step
        if missed != 0.0 and math.isfinite(gains.tracking_time):
            change += missed * min(step / gains.tracking_time, 1.0)
        if frozen and change * self.integral > 0.0:
            return
        limit = max(limit, abs(self.integral) * (1.0 - min(step / SHRINKING_TIME, 1.0)))
        self.integral = limited(self.integral + change, -limit, limit)


def handed_over(integral: float, torque: float) -> float:
    """An integral without what another part of the law gives from now on [N m].

    The integral only shrinks towards 0: what the proportional part carried was never in it.
    """
    if torque * integral > 0.0:
        return math.copysign(max(abs(integral) - abs(torque), 0.0), integral)
    return integral
