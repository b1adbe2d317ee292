"""What the laws share that keep the mean of a joint's two pressures and command their difference.

The mean pressure determines the stiffness. These laws ignore stiffness commands.

When a law takes over a joint, the mean rises from the measured one to its setting. Two unequal
muscles, or two equal ones away from the middle of the range, would turn the joint if only the mean
changed, and a ratio that was measured at low pressures would turn it far. Therefore the difference
changes with the mean such that the torque stays the same at the position of the take-over. This
slope is the only thing these laws take from the joint's model while they run.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from pam_control.control_step import LawTelemetry, PlanRequest
from pam_control.declared import Declared
from pam_control.feedback.linear_joint import LoopStructure
from pam_control.feedback.margins import LoopCase
from pam_control.feedback.operating_points import POSITION_SHARES
from pam_control.joint_models import JointModels, PerMuscle
from pam_control.limited import limited
from pam_model.views.linearised_joint import operating_point

MEAN_PRESSURE: Final = Declared(
    "pressure_ratio.mean_pressure", 2.3e5, "Pa", 1e4, 1e6, "mean of the two pressures of a joint",
    loop=True,
)  # fmt: skip
LEAST_MEAN_PRESSURE = 1e3  # Pa; below it the ratio is not meaningful
MEAN_PRESSURE_TIME = 0.5  # s, rise from 0 to the mean pressure
RATIO_STEPS = 60


def ratio_for_torque(
    models: JointModels, position: float, mean: float, torque: float
) -> float | None:
    """The ratio that gives a torque, by bisection; None if there is none.

    Parameters
    ----------
    position : float
        [rad].
    mean : float
        Mean of the two pressures, which are mean (1 + ratio) and mean (1 - ratio) [Pa gauge].
    torque : float
        [N m].
    """

    def excess(u: float) -> float:
        pressures = (mean * (1.0 + u), mean * (1.0 - u))
        return models.model.torque(pressures, position) - torque

    low, high = -1.0, 1.0
    if excess(low) > 0.0 or excess(high) < 0.0:
        return None
    for _ in range(RATIO_STEPS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) < 0.0 else (low, middle)
    return low


def ratio_at_rest(models: JointModels, position: float, mean: float) -> float | None:
    """The ratio that holds the joint at rest at this mean pressure [Pa gauge] or None."""
    return ratio_for_torque(models, position, mean, models.dynamics.gravity(position))


class MeanPressureState(NamedTuple):
    """The mean pressure of one joint."""

    mean: float = math.nan  # at present [Pa gauge]
    # change of half the difference per change of the mean, by which the torque is kept [-]
    balance: float = 0.0


def loop_cases(models: JointModels, mean: float, structure: LoopStructure) -> list[LoopCase]:
    """The loops over the part of the range in which this mean pressure can hold the joint.

    Parameters
    ----------
    mean : float
        [Pa gauge].
    structure : LoopStructure
        How the law's output is connected to the pressure loops of the joint.
    """
    lower, upper = models.joint.position_limits
    found = []
    for share in POSITION_SHARES:
        position = lower + share * (upper - lower)
        ratio = ratio_at_rest(models, position, mean)
        if ratio is None:
            continue
        pressures = (mean * (1.0 + ratio), mean * (1.0 - ratio))
        point = operating_point(models.joint, models.model, position, pressures)
        found.append(LoopCase(point, structure))
    return found


def begin_mean(
    models: JointModels, position: float, pressures: PerMuscle, goal: float
) -> MeanPressureState:
    """Start from the mean of two pressures at a position.

    Parameters
    ----------
    position : float
        [rad].
    pressures : (float, float)
        Gauge pressures of agonist and antagonist [Pa].
    goal : float
        To which the mean rises or sinks [Pa gauge].
    """
    mean = max(0.5 * (pressures[0] + pressures[1]), LEAST_MEAN_PRESSURE)
    return MeanPressureState(mean, difference_per_mean(models, position, pressures, goal))


def next_mean(
    state: MeanPressureState, goal: float, step: float
) -> tuple[float, MeanPressureState]:
    """The state after a step [s], and the difference's share in the change of the mean.

    Returns
    -------
    balance : float
        By how much half the difference has to change in this cycle, so that the change of the
        mean leaves the torque as it is [Pa].
    state : MeanPressureState
        The next one.
    """
    reach = goal * step / MEAN_PRESSURE_TIME
    change = limited(goal - state.mean, -reach, reach)
    return state.balance * change, MeanPressureState(state.mean + change, state.balance)


def told(
    models: JointModels, request: PlanRequest, pressures: PerMuscle, clipped: bool
) -> LawTelemetry:
    """Torque and stiffness that the desired pressures [Pa] give."""
    position = models.inside(request.motion.position)
    torque = models.model.torque(pressures, position)
    stiffness = models.model.stiffness(pressures, position)
    names = ("torque",) if clipped else ()
    return LawTelemetry(torque, stiffness, torque, stiffness, stiffness, clipped=names)


def difference_per_mean(
    models: JointModels, position: float, pressures: PerMuscle, goal: float
) -> float:
    """Change of half the difference per change of the mean on a way that keeps the torque.

    It is the secant between the present pressures and those that give the same torque at the new
    mean: a derivative would be useless at slack muscles, which have no torque to keep.

    Parameters
    ----------
    position : float
        [rad].
    pressures : (float, float)
        Gauge pressures of agonist and antagonist [Pa].
    goal : float
        The new mean [Pa gauge].

    Returns
    -------
    float
        From -1 to 1; 0 if no difference gives this torque at the new mean.
    """
    angle = models.inside(position)
    torque = models.model.torque(pressures, angle)
    ratio = ratio_for_torque(models, angle, goal, torque)
    rise = goal - 0.5 * (pressures[0] + pressures[1])
    if ratio is None or rise == 0.0:
        return 0.0
    return limited((ratio * goal - 0.5 * (pressures[0] - pressures[1])) / rise, -1.0, 1.0)


def widest_difference(models: JointModels, mean: float) -> float:
    """Largest half difference of the pressures at this mean [Pa]."""
    highest = min(muscle.high_pressure for muscle in models.model.muscles)
    return min(mean, max(highest - mean, 0.0))
