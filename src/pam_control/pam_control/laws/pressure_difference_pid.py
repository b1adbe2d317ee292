"""PID on the pressure difference with a static feedforward: the baseline of a well-tuned joint.

p_agonist = p0 + d, p_antagonist = p0 - d with half the pressure difference

d = f(reference) + s PID(error),    f = c0 + c1 q + c2 q^3 + c3 qd + c4 qdd

The PID's output is a torque; s [Pa/(N m)] is the joint's pressure difference per torque in the
middle of its range, so that its gains have the same units as those of the model-based law. The
feedforward is a fixed polynomial of the reference. Its coefficients come from the rig file unless
they are given, for example because somebody has fitted them to the real joint.

Without the feedforward the integral has to hold the muscles' own stiffness as well: then the limit
of the integral must be larger.

The law has the same pressure loops, delays and gain design as the other laws.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import ClassVar, Final

import numpy as np

from pam_control.control_step import PlanRequest, PressurePlan
from pam_control.feedback.linear_joint import LoopStructure
from pam_control.feedback.margins import LoopCase
from pam_control.joint_models import JointModels, PerMuscle
from pam_control.laws.law import Law, Start
from pam_control.laws.mean_pressure import (
    MEAN_PRESSURE,
    MeanPressureState,
    begin_mean,
    loop_cases,
    next_mean,
    ratio_at_rest,
    told,
    widest_difference,
)
from pam_control.references.spline import JointReference
from pam_control.settings import ControlSettings
from pam_model.views.linearised_joint import operating_point

FIT_POSITIONS: Final = 21


@dataclass(frozen=True, slots=True)
class DifferenceFeedforward:
    """Half the pressure difference [Pa] as a polynomial of the reference."""

    # offset, position, cubic: c0 [Pa], c1 [Pa/rad], c2 [Pa/rad^3]
    offset: float
    position: float
    cubic: float
    # velocity, acceleration: c3 [Pa s/rad], c4 [Pa s^2/rad]
    velocity: float
    acceleration: float

    def at(self, reference: JointReference) -> float:
        """Half the pressure difference [Pa] for a reference."""
        q = reference.position
        return (
            self.offset
            + q * (self.position + self.cubic * q * q)
            + self.velocity * reference.velocity
            + self.acceleration * reference.acceleration
        )

    def rate(self, reference: JointReference) -> float:
        """Its rate of change [Pa/s], without the part of the jerk."""
        q = reference.position
        return (
            self.position + 3.0 * self.cubic * q * q
        ) * reference.velocity + self.velocity * reference.acceleration


NO_FEEDFORWARD = DifferenceFeedforward(0.0, 0.0, 0.0, 0.0, 0.0)


@lru_cache(maxsize=256)
def difference_per_torque(models: JointModels, mean: float) -> float:
    """Half the pressure difference per torque in the middle of the range [Pa/(N m)]."""
    middle = 0.5 * sum(models.joint.position_limits)
    point = operating_point(models.joint, models.model, middle, (mean, mean))
    return 1.0 / (point.torque_slopes[0] - point.torque_slopes[1])


@lru_cache(maxsize=256)
def nominal_feedforward(models: JointModels, mean: float) -> DifferenceFeedforward:
    """The feedforward of a joint that is as its rig file says, at this mean pressure [Pa].

    It takes milliseconds. The design of the gains asks for it before the control cycle does, which
    then finds it kept.
    """
    lower, upper = models.joint.position_limits
    positions, differences = [], []
    for position in np.linspace(lower, upper, FIT_POSITIONS).tolist():
        ratio = ratio_at_rest(models, position, mean)
        if ratio is not None:
            positions.append(position)
            differences.append(mean * ratio)
    q = np.array(positions)
    basis = np.stack([np.ones_like(q), q, q**3], axis=1)
    offset, slope, cubic = np.linalg.lstsq(basis, np.array(differences), rcond=None)[0].tolist()
    scale = difference_per_torque(models, mean)
    dynamics = models.dynamics
    return DifferenceFeedforward(
        offset,
        slope,
        cubic,
        scale * dynamics.moving_torque(1.0, 0.0),
        scale * dynamics.moving_torque(0.0, 1.0),
    )


@dataclass(frozen=True)
class PressureDifferencePid(Law[MeanPressureState]):
    """The law of the module's docstring. It ignores stiffness commands."""

    name: ClassVar[str] = "pressure_difference_pid"

    mean_pressure: float = MEAN_PRESSURE.field()
    # coefficients of the feedforward by joint, in the order and units of `DifferenceFeedforward`;
    # those of other joints follow from the rig
    given: Mapping[str, tuple[float, float, float, float, float]] = field(default_factory=dict)

    def cases(self, models: JointModels, settings: ControlSettings) -> list[LoopCase]:
        """The output is a torque, which a fixed scale turns into a pressure difference."""
        scale = difference_per_torque(models, self.mean_pressure)
        self.feedforward(models, settings)  # so that no control cycle has to wait for it
        structure = LoopStructure(
            settings.pressure_gain or 0.0,
            (scale, -scale),
            measured_velocity=not settings.feedforward,
        )
        return loop_cases(models, self.mean_pressure, structure)

    def feedforward(self, models: JointModels, settings: ControlSettings) -> DifferenceFeedforward:
        """The feedforward of a joint."""
        if not settings.feedforward:
            return NO_FEEDFORWARD
        given = self.given.get(models.name)
        if given is not None:
            return DifferenceFeedforward(*given)
        return nominal_feedforward(models, self.mean_pressure)

    def init(self, models: JointModels) -> MeanPressureState:
        """A joint that was not controlled."""
        return MeanPressureState()

    def begin(
        self, models: JointModels, state: MeanPressureState, start: Start
    ) -> tuple[float, MeanPressureState]:
        """Begin with the difference and the mean of the present pressures."""
        return self._begin(models, start, JointReference(start.position))

    def resume(
        self, models: JointModels, state: MeanPressureState, start: Start
    ) -> tuple[float, MeanPressureState]:
        """Go on with the difference that is desired now."""
        return self._begin(models, start, start.reference)

    def _begin(
        self, models: JointModels, start: Start, reference: JointReference
    ) -> tuple[float, MeanPressureState]:
        state = begin_mean(models, start.position, start.pressures, self.mean_pressure)
        held = self.feedforward(models, start.settings).at(reference)
        difference = 0.5 * (start.pressures[0] - start.pressures[1])
        return (difference - held) / difference_per_torque(models, self.mean_pressure), state

    def plan(
        self, models: JointModels, state: MeanPressureState, request: PlanRequest
    ) -> tuple[PressurePlan, MeanPressureState]:
        """The difference is the feedforward and the output of the feedback."""
        feedforward = self.feedforward(models, request.settings)
        scale = difference_per_torque(models, self.mean_pressure)
        balance, state = next_mean(state, self.mean_pressure, request.step)
        mean, now, then = state.mean, request.now.reference, request.then.reference
        widest = widest_difference(models, mean)
        wanted = feedforward.at(now) + scale * request.output + balance
        difference = max(-widest, min(widest, wanted))
        pressures = (mean + difference, mean - difference)
        ahead, rate = feedforward.at(then) - feedforward.at(now), feedforward.rate(then)
        speed = request.motion.velocity
        measured: PerMuscle = (speed, speed)
        plan = PressurePlan(
            pressures,
            (rate, -rate),
            (ahead, -ahead),
            request.side_velocities if request.settings.feedforward else measured,
            (difference - wanted) / scale,
            request.integral + balance / scale,
            told(models, request, pressures, difference != wanted),
        )
        return plan, state
