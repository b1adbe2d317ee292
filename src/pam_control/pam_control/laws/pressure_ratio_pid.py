"""The usual law, for comparison: a PID on position sets the ratio of the two pressures.

p_agonist = p0 (1 + u), p_antagonist = p0 (1 - u), u in [-1, 1]; the mean pressure p0 determines the
stiffness. The law has the same pressure loops, delays and gain design as the model-based law. It
uses no model of the joint except in the design of its gains and while the mean pressure changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pam_control.control_step import PlanRequest, PressurePlan
from pam_control.feedback.linear_joint import LoopStructure
from pam_control.feedback.margins import LoopCase
from pam_control.joint_models import JointModels
from pam_control.laws.law import Law, Start
from pam_control.laws.mean_pressure import (
    MEAN_PRESSURE,
    MeanPressureState,
    begin_mean,
    loop_cases,
    next_mean,
    told,
    widest_difference,
)
from pam_control.settings import ControlSettings


@dataclass(frozen=True)
class PressureRatioPid(Law[MeanPressureState]):
    """The pressure-ratio law; see the module's docstring. It ignores stiffness commands."""

    name: ClassVar[str] = "pressure_ratio_pid"
    largest_integral: ClassVar[float] = 10.0  # beyond any ratio, which is at most 1

    mean_pressure: float = MEAN_PRESSURE.field()

    def cases(self, models: JointModels, settings: ControlSettings) -> list[LoopCase]:
        """The output is the ratio; the gas loops use the measured velocity."""
        mean = self.mean_pressure
        structure = LoopStructure(
            settings.pressure_gain or 0.0, (mean, -mean), measured_velocity=True
        )
        return loop_cases(models, mean, structure)

    def init(self, models: JointModels) -> MeanPressureState:
        """A joint that was not controlled."""
        return MeanPressureState()

    def begin(
        self, models: JointModels, state: MeanPressureState, start: Start
    ) -> tuple[float, MeanPressureState]:
        """Begin with the ratio and the mean of the present pressures."""
        state = begin_mean(models, start.position, start.pressures, self.mean_pressure)
        first, second = start.pressures
        return max(-1.0, min(1.0, 0.5 * (first - second) / state.mean)), state

    def plan(
        self, models: JointModels, state: MeanPressureState, request: PlanRequest
    ) -> tuple[PressurePlan, MeanPressureState]:
        """The ratio is the output of the feedback."""
        balance, after = next_mean(state, self.mean_pressure, request.step)
        mean = after.mean
        integral = (request.integral * state.mean + balance) / mean
        wanted = request.output + integral - request.integral
        widest = widest_difference(models, mean) / mean
        ratio = max(-widest, min(widest, wanted))
        pressures = (mean * (1.0 + ratio), mean * (1.0 - ratio))
        telemetry = told(models, request, pressures, ratio != wanted)
        still, speed = (0.0, 0.0), request.motion.velocity
        plan = PressurePlan(
            pressures, still, still, (speed, speed), ratio - wanted, integral, telemetry
        )
        return plan, after
