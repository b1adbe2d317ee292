"""The torque that a joint needs beside that of its model, learnt while it moves.

The measured pressures give the torque of the muscles. What the model does not explain of it is
fitted by functions of the measured motion (`motion_functions`). The fitted weights times the same
functions of the REFERENCE are added to the feedforward. So what was learnt acts without the delay
of a feedback, and does not change the stability margins of the loop: the weights follow an average
over seconds.

Both sides of the fit pass the same two filters, so that no acceleration is measured: with the
filter 1/(T s + 1), the filtered acceleration is (v - filtered v)/T. Two filters, because noise of
the acceleration would make the fit too small (errors in the variables), and because what it leaves
is so small then that a delay can be told from friction.

If the position is late by d compared with the pressures, the torque of the muscles at the measured
position seems to be early: d times its rate at a fixed position is left over. It resembles friction
so much that only a rival explanation can have it (`averaged_fit`). The controller compares a late
position with the reference of that earlier time, and late pressures with the plan of theirs.

Nothing is learnt from a joint that stands still, because its friction may then be anything, and
what a slow joint shows counts by the way, not by the time. Dry friction and presliding are
ordinary: an explanation with them is the more probable one before anything was seen. Neither dry
friction nor the whole viscous friction is negative.

Source: J.-J. E. Slotine and W. Li, Applied Nonlinear Control, Prentice Hall 1991, section 8.7
(filtered regression without acceleration) and 9.2 (adaptive feedforward of a robot). The function
of the delay is derived here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from operator import mul
from typing import Final

import numpy as np

from pam_control.adaptation.averaged_fit import AveragedFit, Rival
from pam_control.adaptation.motion_functions import DEVIATIONS, SLIP_LENGTHS, MotionMemory
from pam_control.limited import limited
from pam_control.references.spline import JointReference

FILTER: Final = 0.03  # s, T
EVERY: Final = 0.01  # s between two updates of the fit
NOISE: Final = 3e-4  # of the largest torque: what the functions cannot fit, and the encoder's steps
ERRORS: Final = 5e-4  # of the largest torque: what a fit leaves that has seen little
TRIFLE: Final = 1e-3  # of the largest torque; less is left to the feedback
SLOW: Final = 0.1  # rad/s; below it a sample counts by the way, not by the time
VISCOUS: Final = 3  # index of the speed
STILL: Final = 0.02  # rad/s
DELAY_DEVIATION: Final = 0.01  # s
LEAST_DELAY: Final = 2e-3  # s; smaller ones are not believed
LONGEST_DELAY: Final = 0.04  # s
DELAY_RATE: Final = 0.06  # s/s, at which the reference is moved to a delay that was found
SMOOTH: Final = (0, 1, 2, 3, 4, 5 + len(SLIP_LENGTHS), 6 + len(SLIP_LENGTHS))
SLIPS: Final = tuple(range(5, 5 + len(SLIP_LENGTHS)))
DELAY: Final = 7 + len(SLIP_LENGTHS)
RIVALS: Final = (
    Rival(SMOOTH, 0.0),
    Rival((*SMOOTH, *SLIPS), 2.0),
    Rival((*SMOOTH, DELAY), 0.0, better=2.0),
    Rival((*SMOOTH, *SLIPS, DELAY), 0.0, better=4.0),
)
"""By the numbers of the functions of `motion_functions`, after which comes the delay. Dry friction
is ordinary. A delay has to explain what nothing else does, and more of it beside friction, of which
the slip elements are only an approximation."""
SLOW_FUNCTIONS: Final = 3  # 1, q and q^3: what the integral of the feedback carries meanwhile
DRY: Final = 0.02  # rad; longer slip elements are hysteresis, by which a joint does not stick


@dataclass(slots=True)
class TorqueSample:
    """One control cycle of a joint.

    Attributes
    ----------
    unexplained : float
        Torque of the muscles without that of the model; inertia and damping are not yet
        subtracted [N m].
    rate : float
        Of the torque of the muscles at a fixed position [N m/s].
    position, speed : float
        Measured [rad], [rad/s]; the speed has passed a filter.
    speed_filter : float
        Time constant of that filter [s].
    """

    unexplained: float
    rate: float
    position: float
    speed: float
    speed_filter: float


class TorqueAdaptation:
    """Learns and predicts the torque of one joint that its model lacks.

    Parameters
    ----------
    inertia, damping : float
        Of the model [kg m^2], [N m s/rad].
    largest : float
        Torque that the muscles can give at most [N m].
    turn : float, optional
        Part of the time between two updates after which the first one is due, so that several
        joints do not compute theirs in one control cycle [-].

    Attributes
    ----------
    delay : float
        By which the position is later than the pressures, beside what the rig file tells; negative
        if the pressures are later [s].
    friction : float
        Dry friction that was learnt, and that changes its side within some 10 mrad [N m].
    """

    def __init__(self, inertia: float, damping: float, largest: float, turn: float = 0.0) -> None:
        self._inertia, self._damping, self._turn = inertia, damping, turn
        self._fit = AveragedFit(
            [*(largest * each for each in DEVIATIONS), DELAY_DEVIATION],
            RIVALS,
            NOISE * largest,
            ERRORS * largest,
            TRIFLE * largest,
            {VISCOUS: -damping, **dict.fromkeys(SLIPS, 0.0)},
        )
        self._measured, self._planned = MotionMemory(), MotionMemory()
        self.forget()
        self.restart()

    def forget(self) -> None:
        """Nothing is known."""
        self._fit.forget()
        self.delay = self.friction = 0.0

    @property
    def knows(self) -> bool:
        """Whether anything was learnt that is worth using."""
        return any(self._fit.weights)

    @property
    def weights(self) -> list[float]:
        """Of the functions in the order of `motion_functions`, and of the delay."""
        return self._fit.weights

    def _dry_friction(self) -> float:
        slips = zip(SLIPS, SLIP_LENGTHS, strict=True)
        return sum(self._fit.weights[place] for place, length in slips if length < DRY)

    def restart(self) -> None:
        """Begin with a joint at rest; what was learnt is kept."""
        self._measured.reset()
        self._planned.reset()
        self._raw: list[float] = []
        self._since = -self._turn * EVERY
        self._planned_at = math.nan
        self._reference = math.nan

    def learn(self, step: float, sample: TorqueSample) -> float:
        """Take a new sample, `step` [s] after the last one; 0 if there is no new one.

        Returns
        -------
        float
            What was learnt now of the slow part of the planned torque [N m]. The integral of the
            feedback has carried it until now.
        """
        if step <= 0.0:
            return 0.0
        q = sample.position
        memory = self._measured.advance(q, step)
        raw = [sample.unexplained, 1.0, q, q**3, *memory, sample.rate]
        if not self._raw:
            self._raw = self._smooth = self._once = self._twice = raw
            self._speed_once = self._speed_twice = sample.speed
        own, weight = step / (sample.speed_filter + step), step / (FILTER + step)
        # a measured speed is the mean over a period: the others are taken in its middle as well
        changes = zip(self._smooth, raw, self._raw)  # noqa: B905  (half the time)
        self._smooth = [x + own * (0.5 * (now + last) - x) for x, now, last in changes]
        self._raw = raw
        self._once = _approached(self._once, self._smooth, weight)
        self._speed_once += weight * (sample.speed - self._speed_once)
        before, speed_before = self._twice, self._speed_twice
        self._twice = _approached(before, self._once, weight)
        self._speed_twice += weight * (self._speed_once - speed_before)
        self._since += step
        self._move_delay(step)
        if self._since < EVERY:
            return 0.0
        learnt = 0.0
        if abs(self._speed_twice) > STILL:
            # the difference below is the acceleration half a period ago
            smooth = 0.5 * (np.array(before) + np.array(self._twice))
            speed = 0.5 * (speed_before + self._speed_twice)
            motion = (speed, (self._speed_once - self._speed_twice) / FILTER)
            model = self._damping * motion[0] + self._inertia * motion[1]
            functions = np.concatenate((smooth[1:4], motion, smooth[4:]))
            learnt = -self._slow_part()
            counted = self._since * min(abs(speed) / SLOW, 1.0)
            self._fit.update(functions, float(smooth[0]) - model, counted)
            learnt += self._slow_part()
            self.friction = self._dry_friction()
        self._since = 0.0
        return learnt

    def _move_delay(self, step: float) -> None:
        # a wrong delay is an error of the position itself: the median of what is believed
        likely, wanted = self._fit.certainty(DELAY), 0.0
        if likely > 0.5:
            wanted = limited(self._fit.fitted[DELAY] / likely, -LONGEST_DELAY, LONGEST_DELAY)
        if abs(wanted) < LEAST_DELAY:
            wanted = 0.0
        reach = DELAY_RATE * step
        self.delay += limited(wanted - self.delay, -reach, reach)

    def _slow_part(self) -> float:
        q = self._reference
        if math.isnan(q):
            return 0.0
        constant, linear, cubic = self._fit.weights[:SLOW_FUNCTIONS]
        return constant + linear * q + cubic * q**3

    def torque(self, time: float, reference: JointReference, limit: float) -> float:
        """Torque [N m] to be added for the reference at a time [s], within a limit [N m]."""
        step = 0.0 if math.isnan(self._planned_at) else max(time - self._planned_at, 0.0)
        self._planned_at, self._reference = time, reference.position
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
        return limited(float(sum(map(mul, self._fit.weights, functions))), -limit, limit)


def _approached(values: list[float], goals: list[float], weight: float) -> list[float]:
    """Values that have come nearer to their goals by a share of the difference."""
    return [x + weight * (goal - x) for x, goal in zip(values, goals)]  # noqa: B905
