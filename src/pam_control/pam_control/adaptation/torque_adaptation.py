"""The torque that a joint needs beside that of its model, learnt while it moves.

The measured pressures give the torque of the muscles. What the model does not explain of it is
fitted by functions of the measured motion (`motion_functions`). The fitted weights times the same
functions of the REFERENCE are added to the feedforward. So what was learnt acts without the delay
of a feedback, and does not change the stability margins of the loop: the weights follow an average
over seconds.

Both sides of the fit pass the same filters, so that no acceleration is measured: with the filter
1/(T s + 1), the filtered acceleration is (v - filtered v)/T. T is long, since noise of the
acceleration would make the fit too small (errors in the variables).

Nothing is learnt from a joint that stands still, because its friction may then be anything.

Source: J.-J. E. Slotine and W. Li, Applied Nonlinear Control, Prentice Hall 1991, section 8.7
(filtered regression without acceleration) and 9.2 (adaptive feedforward of a robot).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pam_control.adaptation.motion_functions import DEVIATIONS, MotionMemory
from pam_control.adaptation.recursive_fit import Array, RecursiveFit
from pam_control.references.spline import JointReference

FILTER: Final = 0.06  # s, T
EVERY: Final = 0.01  # s between two updates of the fit
NOISE: Final = 3e-3  # of the largest torque: what the functions cannot fit, and the encoder's steps
TRIFLE: Final = 1e-3  # of the largest torque; less is left to the feedback
SLOWEST: Final = 0.04  # rad/s


class TorqueAdaptation:
    """Learns and predicts the torque of one joint that its model lacks.

    Parameters
    ----------
    inertia, damping : float
        Of the model [kg m^2], [N m s/rad].
    largest : float
        Torque that the muscles can give at most [N m].
    """

    def __init__(self, inertia: float, damping: float, largest: float) -> None:
        self._inertia, self._damping = inertia, damping
        self._fit = RecursiveFit(
            [largest * each for each in DEVIATIONS], NOISE * largest, TRIFLE * largest
        )
        self._measured, self._planned = MotionMemory(), MotionMemory()
        self.restart()

    def forget(self) -> None:
        """Nothing is known."""
        self._fit.forget()

    @property
    def knows(self) -> bool:
        """Whether anything was learnt that is worth using."""
        return any(self._fit.weights)

    def restart(self) -> None:
        """Begin with a joint at rest; what was learnt is kept."""
        self._measured.reset()
        self._planned.reset()
        self._once: Array | None = None
        self._since = 0.0
        self._planned_at = math.nan

    def learn(
        self, step: float, unexplained: float, position: float, speed: float, speed_filter: float
    ) -> None:
        """Take a new sample.

        Parameters
        ----------
        step : float
            Time since the last sample [s]; 0 if there is no new one.
        unexplained : float
            Torque of the muscles without that of the model; inertia and damping are not yet
            subtracted [N m].
        position, speed : float
            Measured [rad], [rad/s]; the speed has passed a filter.
        speed_filter : float
            Time constant of that filter [s].
        """
        if step <= 0.0:
            return
        memory = self._measured.advance(position, step)
        raw = np.array((unexplained, 1.0, position, position**3, *memory))
        if self._once is None:
            self._once, self._twice, self._slow = raw, raw, speed
        self._once = self._once + step / (speed_filter + step) * (raw - self._once)
        weight = step / (FILTER + step)
        self._twice = self._twice + weight * (self._once - self._twice)
        self._slow += weight * (speed - self._slow)
        self._since += step
        if self._since < EVERY:
            return
        if abs(self._slow) > SLOWEST:
            motion = (self._slow, (speed - self._slow) / FILTER)
            model = self._damping * motion[0] + self._inertia * motion[1]
            functions = np.concatenate((self._twice[1:4], motion, self._twice[4:]))
            self._fit.update(functions, float(self._twice[0]) - model, self._since)
        self._since = 0.0

    def torque(self, time: float, reference: JointReference, limit: float) -> float:
        """Torque [N m] to be added for the reference at a time [s], within a limit [N m]."""
        step = 0.0 if math.isnan(self._planned_at) else max(time - self._planned_at, 0.0)
        self._planned_at = time
        memory = self._planned.advance(reference.position, step)
        return self._weighted(reference, memory, limit)

    def at_rest(self, position: float, limit: float) -> float:
        """The same for a joint that begins at rest at a position [rad]."""
        return self._weighted(JointReference(position), (), limit)

    def _weighted(
        self, reference: JointReference, memory: list[float] | tuple[()], limit: float
    ) -> float:
        q = reference.position
        functions = (1.0, q, q**3, reference.velocity, reference.acceleration, *memory)
        found = float(sum(w * f for w, f in zip(self._fit.weights, functions, strict=False)))
        return max(-limit, min(limit, found))
