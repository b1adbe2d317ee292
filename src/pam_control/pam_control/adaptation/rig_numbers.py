"""Which numbers of the rig file a joint's torques speak against: load, friction, dimensions.

The torques that `stiffness_estimate` compares are explained once more, when somebody asks for it:
by a changed inertia, gravity, viscous and dry friction of any size, beside dimensions within the
tolerance of the rig file. Dry friction is a slip element, as in `motion_functions`.

A stronger muscle and a lighter load look much alike, and what the fit leaves is no noise but
repeats from motion to motion. Its errors are therefore taken to stay the same for seconds, and the
intervals are wide for what the motion does not tell apart.

Source: Bayesian linear regression, C. M. Bishop, Pattern Recognition and Machine Learning, Springer
2006, section 3.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from pam_control.adaptation.fading_sums import FadingSums
from pam_control.adaptation.normal_equations import Array

NOISE: Final = 5e-4  # of the largest torque; the fit cannot be better
UNEXPLAINED: Final = 3e-3  # of the largest torque; more is something else than these numbers
QUANTILE: Final = 1.645  # of the normal distribution, for an interval of 90 %
LOAD_DEVIATIONS: Final = (1.0, 3.0, 1.0)  # relative, of inertia, damping and gravity with a load
DRY_DEVIATION: Final = 0.1  # of the largest torque
LIKE_FOR: Final = 2.0  # s, for which the errors of the fit stay about the same
LEAST_EVIDENCE: Final = 40.0
"""Squares of standard deviations; eleven numbers without a cause reach 31 once in a thousand."""
ROUNDS: Final = 4  # of the fit, whose errors are known only after it
DRY_FRICTION: Final = "coulomb_friction.torque"


class Place(NamedTuple):
    """Where a number is written."""

    # owner, key: a joint's or a muscle's name, and the key there; "coulomb_friction.torque" is an
    # effect
    owner: str
    key: str
    written: float  # in the key's unit
    scale: float  # what a change of the fit is relative to, in the same unit


@dataclass(frozen=True, slots=True)
class LearntNumber:
    """One number of the rig file, and its interval that contains the true one in 90 % of cases."""

    # owner, key: a joint's or a muscle's name, and the key there; "coulomb_friction.torque" is an
    # effect
    owner: str
    key: str
    # written, value, low, high: in the key's unit
    written: float
    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class RigNumbers:
    """What the torques of a joint tell about the numbers of its rig file."""

    @property
    def certain(self) -> bool:
        """Whether the rig file is certainly wrong."""
        return self.evidence >= LEAST_EVIDENCE

    # the dimensions of the joint and its muscles, inertia, viscous friction, gravity and dry
    # friction
    numbers: tuple[LearntNumber, ...]
    seconds: float  # motion that they are based on [s]
    # unexplained, limit: RMS torque that they leave, and the most that lets them be believed [N m]
    unexplained: float
    limit: float
    # by how much they explain the torques better than the rig file does, in squares of standard
    # deviations; what has no cause in the rig gives about the number of numbers
    evidence: float


def fitted_numbers(
    sums: FadingSums, prior: Array, places: Sequence[Place], largest: float
) -> RigNumbers:
    """The numbers that explain the torques best.

    Parameters
    ----------
    sums : FadingSums
        Of the torque that the rig file does not explain; its parts are the dimensions, inertia,
        damping, gravity and dry friction, in this order.
    prior : ndarray
        Information about all parts but dry friction within the tolerance, shape (n - 1, n - 1).
    places : sequence of Place
        Of the n parts.
    largest : float
        Torque that the muscles can give at most [N m].
    """
    count = len(places) - len(LOAD_DEVIATIONS) - 1
    products, targets = sums.products, sums.targets
    free = np.zeros_like(products)
    free[:count, :count] = prior[:count, :count]
    deviations = np.array([*LOAD_DEVIATIONS, DRY_DEVIATION * largest])
    free[count:, count:] = np.diag(1.0 / deviations**2)
    found, noise, gain = np.zeros_like(targets), NOISE * largest, 0.0
    covariance: Array = np.linalg.inv(free)
    for _ in range(ROUNDS):
        gain = 1.0 / (LIKE_FOR * noise * noise)
        covariance = np.linalg.inv(free + gain * products)
        found = covariance @ (gain * targets)
        noise = max(NOISE * largest, sums.left(found))
    halves = QUANTILE * np.sqrt(np.diag(covariance))
    numbers = []
    for place, change, half in zip(places, found.tolist(), halves.tolist(), strict=True):
        value, reach = place.written + place.scale * change, abs(place.scale) * half
        numbers.append(
            LearntNumber(place.owner, place.key, place.written, value, value - reach, value + reach)
        )
    return RigNumbers(
        tuple(numbers),
        sums.seconds,
        sums.left(found),
        UNEXPLAINED * largest,
        float(gain * found @ targets),
    )
