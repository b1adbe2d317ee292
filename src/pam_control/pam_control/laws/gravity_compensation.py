"""Gravity compensation: the joint is moved by hand, carries its weight, and stays where it is put.

The joint is a spring about a rest angle (`impedance`), and the rest angle follows it: once the
spring's torque is above `float.hold_torque`, with the speed

    rest' = (q - rest -+ hold/K)/T

limited to `float.speed_limit`. A hand feels the hold torque, as of dry friction, and a damper K T.
A load that the rig file does not contain is held up to the hold torque; a heavier one lets the
joint sink no faster than the limit. Trajectories and streamed references are refused: the hand is
the only source of motion. `~/stop` holds the joint until the driver is activated again.

Source: the rest angle with a dead zone is an admittance (Keemink, van der Kooij, Stienen,
Admittance control for physical human-robot interaction, Int. J. Robotics Research 37 (2018)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Final, NamedTuple

from pam_control.control_step import PlanRequest, PressurePlan
from pam_control.declared import BY_SIZE, declared, share_of_torque
from pam_control.feedback.margins import LoopCase
from pam_control.joint_models import JointModels
from pam_control.laws.impedance import DAMPING, Impedance, ImpedanceState
from pam_control.laws.law import Guidance, GuideRequest, Law, Start
from pam_control.settings import ControlSettings

FOLLOWING_TIME: Final = 0.1  # s, T


class GravityCompensationState(NamedTuple):
    """State of one joint: that of its spring, and its rest angle [rad]."""

    spring: ImpedanceState
    rest: float = math.nan


@dataclass(frozen=True)
class GravityCompensation(Law[GravityCompensationState]):
    """The law of the module's docstring."""

    name: ClassVar[str] = "gravity_compensation"
    is_scheduled: ClassVar[bool] = True
    guides: ClassVar[bool] = True
    against_motion: ClassVar[str] = "law gravity_compensation: the joints are moved by hand"

    damping: float = DAMPING.field()
    hold_torque: float = declared(
        "float.hold_torque",
        BY_SIZE,
        "N m",
        0.001,
        1e4,
        "torque below which a joint stays where it is put",
        by_size=share_of_torque(0.01),
    )
    speed_limit: float = declared(
        "float.speed_limit", 0.5, "rad/s", 0.01, 10.0,
        "largest speed at which a joint is moved by hand",
    )  # fmt: skip

    @property
    def _spring(self) -> Impedance:
        return Impedance(self.damping)

    def cases(self, models: JointModels, settings: ControlSettings) -> list[LoopCase]:
        """The loops of the spring."""
        return self._spring.cases(models, settings)

    def init(self, models: JointModels) -> GravityCompensationState:
        """A joint that was not controlled."""
        return GravityCompensationState(self._spring.init(models))

    def rest(
        self, models: JointModels, state: GravityCompensationState
    ) -> GravityCompensationState:
        """The joint is taken over."""
        return state._replace(spring=self._spring.rest(models, state.spring))

    def begin(
        self, models: JointModels, state: GravityCompensationState, start: Start
    ) -> tuple[float, GravityCompensationState]:
        """Begin with the rest angle where the joint is."""
        torque, spring = self._spring.begin(models, state.spring, start)
        return torque, GravityCompensationState(spring, models.inside(start.position))

    def guide(
        self, models: JointModels, state: GravityCompensationState, request: GuideRequest
    ) -> tuple[Guidance, GravityCompensationState]:
        """Let the rest angle follow the hand."""
        stiffness, position = self.stiffness(state), request.motion.position
        if not request.active or request.held or math.isnan(position) or not stiffness > 0.0:
            return Guidance(), state
        gap = position - state.rest
        beyond = math.copysign(max(abs(gap) - self.hold_torque / stiffness, 0.0), gap)
        speed = max(-self.speed_limit, min(self.speed_limit, beyond / FOLLOWING_TIME))
        lower, upper = models.joint.position_limits
        rest = max(lower, min(upper, state.rest + speed * request.step))
        return Guidance(lead=rest), state._replace(rest=rest)

    def stiffness(self, state: GravityCompensationState) -> float:
        """The reference of the stiffness [N m/rad]."""
        return self._spring.stiffness(state.spring)

    def plan(
        self, models: JointModels, state: GravityCompensationState, request: PlanRequest
    ) -> tuple[PressurePlan, GravityCompensationState]:
        """Plan the pressures of the spring."""
        plan, spring = self._spring.plan(models, state.spring, request)
        return plan, state._replace(spring=spring)
