"""The true stiffness of a joint whose dimensions differ from the rig file within its tolerance.

Two per cent off in the pulley's radius and in the turns of the threads change the stiffness by 8 %,
and the torque as well. While the joint moves, the torque that the measured pressures give by the
model is compared with the torque that the motion needs, as in `torque_adaptation`. All signals
pass two filters 1/(T s + 1), integrated by the trapezoidal rule; from the position q and the once
and twice filtered q1 and q2 follow speed (q1 - q2)/T and acceleration (q - 2 q1 + q2)/T^2, without
the delay of a difference. The difference of the torques is explained by small changes of the
numbers of the rig file: the arms, the dimensions of the muscles, inertia, friction and gravity.
Their prior has the standard deviation of a uniform range of the size of the tolerance. The
corrected numbers give the stiffness, and what is left uncertain of them gives its interval.

If these numbers do not explain the difference, something else is wrong with the rig, such as
friction or a load. Then the stiffness of the model is kept, with the interval of the tolerance.

The same data tell, when somebody asks, which load and friction the rig has (`rig_numbers`).

Source: Bayesian linear regression, C. M. Bishop, Pattern Recognition and Machine Learning, Springer
2006, section 3.3; forgetting as in `forgetting_fit`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pam_control.adaptation.motion_functions import begin_memory, element, move_memory
from pam_control.adaptation.normal_equations import CORRELATED, Array
from pam_control.adaptation.rig_numbers import (
    NOISE,
    QUANTILE,
    UNEXPLAINED,
    FadingSums,
    RigNumbers,
    fitted_numbers,
)
from pam_control.adaptation.varied_joint import VariedJoint
from pam_control.limited import limited
from pam_control.rows.plan_rows import N_MEMORY
from pam_model.errors import PamError
from pam_model.joints.joint_statics import JointStatics
from pam_model.views.inverse_dynamics import InverseDynamics

FILTER: Final = 0.03  # s, of both filters
SETTLING: Final = 0.3  # s, until they have forgotten how they began
EVERY: Final = 0.02  # s between two updates
SOLVED_EVERY: Final = 5  # updates; what is found changes within seconds
LONGEST_STEP: Final = 0.1  # s; after a longer pause the filters begin anew
SLOWEST: Final = 0.04  # rad/s; friction may be anything in a joint that stands still
LINEAR_FOR: Final = 0.7  # s of motion, after which the derivatives are taken anew
LINEAR_WITHIN: Final = 1e-3  # relative; so near to where they were taken they hold
BENT: Final = 1.5  # of the noise; the fit leaves more where the derivatives do not hold
OLD_SHARE: Final = 0.1  # of what was seen with other derivatives
DIFFERENCE: Final = 1e-3  # relative step of the derivatives
MOST: Final = 1.15  # by which a stiffness command is corrected
ENOUGH: Final = 1.0  # s of motion


@dataclass(frozen=True, slots=True)
class Stiffness:
    """The stiffness of a joint [N m/rad], with the interval that contains it in 90 % of cases.

    Attributes
    ----------
    value, low, high : float
        [N m/rad].
    learnt : bool
        Whether it is corrected; otherwise it is that of the model.
    """

    value: float
    low: float
    high: float
    learnt: bool


class StiffnessEstimate:
    """Learns the numbers of one joint that its stiffness depends on.

    Parameters
    ----------
    joint : VariedJoint
        The joint, and its statics with changed numbers.
    model : JointStatics
        The joint's model.
    dynamics : InverseDynamics
        Of the joint.
    largest : float
        Torque that the muscles can give at most [N m].
    turn : float, optional
        As for `TorqueAdaptation` [-].

    Attributes
    ----------
    since : float
        Time since the last update; the next one is due at `EVERY` [s].
    """

    def __init__(
        self,
        joint: VariedJoint,
        model: JointStatics,
        dynamics: InverseDynamics,
        largest: float,
        turn: float = 0.0,
    ) -> None:
        self._joint, self._written, self._turn = joint, model, turn
        self._dynamics, self._largest = dynamics, largest
        deviation = joint.tolerance / math.sqrt(3.0)
        size = len(joint.numbers) + 3  # with inertia, friction and gravity
        self._prior = np.eye(size) / max(deviation, 1e-6) ** 2
        self._slip = [0.0] * N_MEMORY
        self.forget()
        self.restart()

    def forget(self) -> None:
        """Nothing is known but the rig file."""
        size = len(self._prior)
        self._tolerance = FadingSums(size)
        self._load = FadingSums(size + 1)  # with dry friction, and with what was seen elsewhere
        self._found, self._covariance = np.zeros(size), np.linalg.inv(self._prior)
        self._unsolved = 0
        self._linearise()
        while self._coming is not None:
            self._build_next()

    def restart(self) -> None:
        """Begin the filters anew; what was learnt is kept."""
        self._filtered: tuple[Array, Array, Array] | None = None
        begin_memory(self._slip, 0)
        self.since, self._settling = -self._turn * EVERY, SETTLING

    @property
    def explains(self) -> bool:
        """Whether the tolerance explains what was seen, and enough was seen."""
        return self._tolerance.seconds >= ENOUGH and self.unexplained <= UNEXPLAINED * self._largest

    @property
    def unexplained(self) -> float:
        """RMS torque that the fit leaves [N m]."""
        return self._tolerance.left(self._found)

    def learn(
        self, step: float, pressures: Sequence[float], position: float, known: float = 0.0
    ) -> None:
        """Take a measurement.

        Parameters
        ----------
        step : float
            Time since the last one [s]; 0 if the position is not new.
        pressures : sequence of float
            Of the muscles at the time of the position [Pa].
        position : float
            [rad].
        known : float
            Torque beside that of the muscles' force, inertia, damping and gravity, which the rig
            file tells, such as friction [N m].
        """
        self.since += max(step, 0.0)
        if self.since < EVERY or not all(map(math.isfinite, (*pressures, position))):
            return
        if self._coming is not None:
            self._build_next()
        if not self._low <= position <= self._high:
            return
        elapsed, self.since = self.since, 0.0
        torque = self._model.torque(pressures, position)
        parts = np.array([each.torque(pressures, position) - torque for each in self._changed])
        parts /= DIFFERENCE
        # as if the model were that of the rig file, so that the changes are counted from it
        torque += known - float(parts @ self._about)
        move_memory(self._slip, 0, position, elapsed)
        dry = element(self._slip, 0, 0)
        raw = np.array([torque, *parts, dry, self._dynamics.gravity(position), position])
        if self._filtered is None or elapsed > LONGEST_STEP:
            self._filtered, self._settling = (raw, raw, raw), SETTLING
            return
        before, once_before, twice_before = self._filtered
        once = _trapezoid(once_before, before, raw, elapsed)
        twice = _trapezoid(twice_before, once_before, once, elapsed)
        self._filtered = (raw, once, twice)
        speed = float(once[-1] - twice[-1]) / FILTER
        acceleration = float(raw[-1] - 2.0 * once[-1] + twice[-1]) / FILTER**2
        self._settling -= elapsed
        if abs(speed) > SLOWEST and self._settling < 0.0:
            self._update(twice, speed, acceleration, elapsed)

    def _update(self, now: Array, speed: float, acceleration: float, elapsed: float) -> None:
        inertia = self._dynamics.moving_torque(0.0, acceleration)
        damping = self._dynamics.moving_torque(speed, 0.0)
        gravity = now[-2]
        # muscles + parts * changes = (1 + change) inertia + ... ; what lacks is on the left
        parts = np.concatenate((-now[1:-3], [inertia, damping, gravity, now[-3]]))
        target = float(now[0]) - inertia - damping - gravity
        self._load.add(parts, target, elapsed)
        sums = self._tolerance
        sums.add(parts[:-1], target, elapsed)
        self._moved += elapsed
        self._unsolved += 1
        if self._unsolved >= SOLVED_EVERY:
            self._solve()

    def _solve(self) -> None:
        """Find the changes that explain what was seen; take the derivatives there if need be."""
        sums, self._unsolved = self._tolerance, 0
        noise = max(NOISE * self._largest, self.unexplained)
        gain = 1.0 / (CORRELATED * noise * noise)
        self._covariance = np.linalg.inv(self._prior + gain * sums.products)
        self._found = self._covariance @ (gain * sums.targets)
        change = np.abs(self._found[: len(self._about)] - self._about).max()
        bent = self.unexplained > BENT * NOISE * self._largest
        if self._moved >= LINEAR_FOR and change > LINEAR_WITHIN and bent and self._coming is None:
            self._linearise()

    def _linearise(self) -> None:
        """Begin to compute the derivatives where the fit is now."""
        self._coming: Array | None = self._found[: len(self._joint.numbers)].copy()
        self._built: list[JointStatics] = []

    def _build_next(self) -> None:
        """Build one of the models for the coming derivatives; all at once would delay a cycle.

        With the last one, the derivatives are used; what was found with others counts less.
        """
        assert self._coming is not None
        changes = self._coming.copy()
        if self._built:
            changes[len(self._built) - 1] += DIFFERENCE
        try:
            self._built.append(self._joint.changed(changes.tolist()))
        except PamError:  # a rig at the edge of what is possible
            self._coming, self._built = np.zeros(len(self._joint.numbers)), []
            return
        if len(self._built) > len(self._joint.numbers):
            self._about, self._coming = self._coming, None
            self._model, *self._changed = self._built
            # at the ends of the range of one model, another one may not be defined
            ranges = [each.position_range for each in (self._written, *self._built)]
            self._low, self._high = max(low for low, _ in ranges), min(high for _, high in ranges)
            self._moved = 0.0
            self._tolerance.fade(OLD_SHARE)

    def numbers(self) -> RigNumbers:
        """The numbers that the rig file of this joint should have, a load and friction included."""
        return fitted_numbers(
            self._load, self._prior, self._joint.places(self._dynamics), self._largest
        )

    def factor(self, pressures: Sequence[float], position: float, present: float) -> float:
        """The estimated stiffness over that of the model, within bounds; 1 if nothing is known.

        A present factor inside the interval stays as it is: every change of the stiffness moves
        air, and what was learnt of the torques holds for one stiffness.
        """
        written = self._written.stiffness(pressures, position)
        found = self.at(pressures, position)
        if not (found.learnt and written > 0.0):
            return 1.0
        if found.low <= present * written <= found.high:
            return present
        return max(1.0 / MOST, min(MOST, found.value / written))

    def at(self, pressures: Sequence[float], position: float) -> Stiffness:
        """The stiffness at pressures [Pa] and a position [rad]."""
        if not all(map(math.isfinite, (*pressures, position))):
            return Stiffness(math.nan, math.nan, math.nan, False)
        position = limited(position, self._low, self._high)
        here = self._model.stiffness(pressures, position)
        slopes = np.zeros(len(self._prior))
        for index, each in enumerate(self._changed):
            slopes[index] = (each.stiffness(pressures, position) - here) / DIFFERENCE
        learnt = self.explains
        if learnt:
            value = here + float(slopes[: len(self._about)] @ (self._found[:-3] - self._about))
            covariance = self._covariance
        else:
            value = self._written.stiffness(pressures, position)
            covariance = np.linalg.inv(self._prior)
        half = QUANTILE * math.sqrt(float(slopes @ covariance @ slopes))
        return Stiffness(value, value - half, value + half, learnt)


def _trapezoid(filtered: Array, before: Array, now: Array, step: float) -> Array:
    """The filter 1/(T s + 1) after a step [s] between two values of its input."""
    return ((2.0 * FILTER - step) * filtered + step * (before + now)) / (2.0 * FILTER + step)
