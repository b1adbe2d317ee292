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
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pam_control.adaptation.fading_sums import FadingSums
from pam_control.adaptation.motion_functions import begin_memory
from pam_control.adaptation.normal_equations import Array
from pam_control.adaptation.rig_numbers import (
    NOISE,
    QUANTILE,
    UNEXPLAINED,
    RigNumbers,
    fitted_numbers,
)
from pam_control.adaptation.stiffness_fit import (
    ABOUT,
    DIFFERENCE,
    FOUND,
    N_FILTERS,
    N_WEIGHTS,
    solve_changes,
    take_torques,
)
from pam_control.adaptation.varied_joint import VariedJoint
from pam_control.limited import limited
from pam_control.rows.plan_rows import N_MEMORY
from pam_model.errors import PamError
from pam_model.joints.joint_statics import JointStatics
from pam_model.plant.compiled import for_kernel, listed, prepare
from pam_model.views.inverse_dynamics import InverseDynamics

SETTLING: Final = 0.3  # s, until they have forgotten how they began
EVERY: Final = 0.02  # s between two updates
SOLVED_EVERY: Final = 5  # updates; what is found changes within seconds
LONGEST_STEP: Final = 0.1  # s; after a longer pause the filters begin anew
LINEAR_FOR: Final = 0.7  # s of motion, after which the derivatives are taken anew
LINEAR_WITHIN: Final = 1e-3  # relative; so near to where they were taken they hold
BENT: Final = 1.5  # of the noise; the fit leaves more where the derivatives do not hold
PARTS_PER_SECOND: Final = 500.0  # of models that are built
IN_A_PART: Final = 4  # pulls that are computed in one cycle
OLD_SHARE: Final = 0.1  # of what was seen with other derivatives
MOST: Final = 1.15  # by which a stiffness command is corrected
ENOUGH: Final = 1.0  # s of motion


@dataclass(frozen=True, slots=True)
class Stiffness:
    """The stiffness of a joint [N m/rad], with the interval that contains it in 90 % of cases."""

    # value, low, high: [N m/rad]
    value: float
    low: float
    high: float
    learnt: bool  # whether it is corrected; otherwise it is that of the model


class StiffnessEstimate:
    """Learns the numbers of one joint that its stiffness depends on.

    Parameters
    ----------
    joint : VariedJoint
        The joint, and its statics with changed numbers.
    model : JointStatics
        The joint's model.
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
        self._inertia = float(dynamics.moving_torque(0.0, 1.0))
        self._damping = float(dynamics.moving_torque(1.0, 0.0))
        deviation = joint.tolerance / math.sqrt(3.0)
        size = len(joint.numbers) + 3  # with inertia, friction and gravity
        self._prior_weight = 1.0 / max(deviation, 1e-6) ** 2
        self._prior = self._prior_weight * np.eye(size)
        self._slip = for_kernel(np.zeros(N_MEMORY))
        self._inputs, self._parts = (for_kernel(np.zeros(n)) for n in (size + 1, size + 1))
        self._filters = for_kernel(np.zeros((N_FILTERS, size + 1)))
        self.forget()
        self.restart()
        numbers = (0.0,) * 6
        prepare(take_torques, *numbers, False, False, *self._rows())
        prepare(solve_changes, *self._tolerance.rows, self._weights, self._factor, 0.0, 0.0, 0)

    def _rows(self) -> tuple[Any, ...]:
        """The last arguments of `take_torques`."""
        return (
            self._pulls, self._places, self._levers, self._weights, self._slip, self._inputs,
            self._filters, self._parts, *self._tolerance.rows, *self._load.rows,
        )  # fmt: skip

    def forget(self) -> None:
        """Nothing is known but the rig file."""
        size = len(self._prior)
        self._tolerance = FadingSums(size)
        self._load = FadingSums(size + 1)  # with dry friction, and with what was seen elsewhere
        self._weights: Any = for_kernel(np.zeros((N_WEIGHTS, size)))
        self._factor = for_kernel(np.diag(np.sqrt(np.diag(self._prior))))
        self._unsolved = 0
        self._sample: Iterator[None] | None = None
        for _ in self._linearise():
            pass
        self._derivatives: Iterator[None] | None = None

    def restart(self) -> None:
        """Begin the filters anew; what was learnt is kept."""
        self._filtering = False
        self._sample = None
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

    @property
    def _found(self) -> Array:
        return np.array(self._weights[FOUND])

    @property
    def rebuilds(self) -> bool:
        """Whether models for other derivatives are being built."""
        return self._derivatives is not None

    def learn(
        self, step: float, pressures: Sequence[float], position: float, known: float = 0.0
    ) -> None:
        """Take a measurement; `go_on` learns from it, or the next call.

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
        while self._sample is not None:
            self.go_on()
        if not self._low <= position <= self._high:
            return
        elapsed, self.since = self.since, 0.0
        self._sample = self._learn(elapsed, pressures, position, known)

    def go_on(self) -> None:
        """Do a part of what is to be done with the last measurement; a whole would take long."""
        if self._sample is not None and next(self._sample, self) is self:
            self._sample = None

    def rebuild(self, step: float) -> None:
        """Do what a cycle [s] has time for at the models for other derivatives."""
        for _ in range(max(1, round(step * PARTS_PER_SECOND))):
            if self._derivatives is not None and next(self._derivatives, self) is self:
                self._derivatives = None

    def _learn(
        self, elapsed: float, pressures: Sequence[float], position: float, known: float
    ) -> Iterator[None]:
        for number, (muscle, joint) in enumerate(self._distinct):
            if number > 0 and number % IN_A_PART == 0:
                yield
            self._pulls[number] = joint.tension(muscle, pressures[muscle], position)
        begins = not self._filtering or elapsed > LONGEST_STEP
        self._filtering = True
        if begins:
            self._settling = SETTLING
        else:
            self._settling -= elapsed
        counted = take_torques(
            known, self._dynamics.gravity(position), position, elapsed, self._inertia,
            self._damping, begins, self._settling < 0.0, *self._rows(),
        )  # fmt: skip
        if not counted:
            return
        self._moved += elapsed
        self._unsolved += 1
        if self._unsolved >= SOLVED_EVERY:
            yield
            self._solve()

    def _solve(self) -> None:
        """Find the changes that explain what was seen; take the derivatives there if need be."""
        self._unsolved = 0
        change, left = solve_changes(
            *self._tolerance.rows, self._weights, self._factor, self._prior_weight,
            NOISE * self._largest, len(self._about),
        )  # fmt: skip
        bent = left > BENT * NOISE * self._largest
        if self._moved >= LINEAR_FOR and change > LINEAR_WITHIN and bent and not self.rebuilds:
            self._derivatives = self._linearise()

    def _linearise(self) -> Iterator[None]:
        """Compute the derivatives where the fit is now, bit by bit.

        With the last model, the derivatives are used; what was found with others counts less.
        """
        count = len(self._joint.numbers)
        about: list[float] = listed(self._weights[FOUND])[:count]
        built: list[JointStatics] = []
        while len(built) <= count:
            changes = about.copy()
            if built:
                changes[len(built) - 1] += DIFFERENCE
            try:
                for part in self._joint.changed(changes):
                    if part is not None:
                        built.append(part)
                    yield
            except PamError:  # a rig at the edge of what is possible
                about, built = [0.0] * count, []
        distinct, places = _shared_pulls(built)
        yield
        of_models = for_kernel(np.array(places, dtype=np.int64))
        levers = for_kernel(np.array([[*joint.ratios, joint.radius] for joint in built]))
        yield
        # at the ends of the range of one model, another one may not be defined
        ranges = [each.position_range for each in (self._written, *built)]
        while self._sample is not None:  # of the former derivatives
            self.go_on()
        self._low, self._high = max(low for low, _ in ranges), min(high for _, high in ranges)
        self._about, self._weights[ABOUT][:count] = about, about
        self._model, *self._changed = built
        self._distinct, self._places, self._levers = distinct, of_models, levers
        self._pulls = for_kernel(np.zeros(len(distinct)))
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
            value = here + float(slopes[:-3] @ (self._found[:-3] - np.array(self._about)))
            factor = np.tril(np.array(self._factor))
        else:
            value = self._written.stiffness(pressures, position)
            factor = np.sqrt(self._prior)
        half = QUANTILE * float(np.linalg.norm(np.linalg.solve(factor, slopes)))
        return Stiffness(value, value - half, value + half, learnt)


def _shared_pulls(
    models: Sequence[JointStatics],
) -> tuple[list[tuple[int, JointStatics]], list[list[int]]]:
    """The pulls that differ between models, because most have a muscle that is unchanged.

    Returns
    -------
    distinct : list of (int, JointStatics)
        A muscle, and a model that has it.
    places : list of list of int
        Of each model, the numbers of its muscles in `distinct`.
    """
    found: dict[tuple[int, float, int], int] = {}
    distinct: list[tuple[int, JointStatics]] = []
    places: list[list[int]] = []
    for joint in models:
        places.append([])
        for number, (muscle, arm) in enumerate(zip(joint.muscles, joint.arms, strict=True)):
            key = number, arm, id(muscle)
            if key not in found:
                found[key] = len(distinct)
                distinct.append((number, joint))
            places[-1].append(found[key])
    return distinct, places
