"""Impedance: the joint is a spring and a damper about its reference.

With the reference q_r, the measured angle q and the commanded stiffness K, an outside torque T that
lasts deflects the joint by T/K. The muscles are that spring: their pressures give the torque of the
reference's motion and the stiffness K at the reference, so that the spring acts without delay and
cannot oscillate by itself. The feedback adds only what they lack,

    u = (K - K_m)(q_r - q) + g(q) - g(q_r) + D (q_r' - q')

where K_m is the stiffness that they reach and g gravity, none of which the spring carries. There
is no integral, nothing is learnt, and there is no limit of the tracking error: a joint that
somebody pushes away is no fault. K - K_m and D are at most the gains that the position law has,
which keep its margins.

Source: N. Hogan, Impedance control, J. Dyn. Sys. Meas. Control 107 (1985), equations 1 to 3 of part
I; the muscles as the spring are this suite's.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, ClassVar, Final, NamedTuple

from pam_control.control_step import PlanRequest, PressurePlan
from pam_control.declared import BY_SIZE, BySize, Declared
from pam_control.feedback.margins import LoopCase
from pam_control.joint_models import JointModels
from pam_control.laws.law import Law, Start
from pam_control.laws.position_stiffness import PositionStiffness, PositionStiffnessState
from pam_control.settings import ControlSettings
from pam_model.views.torque_balance import critical_damping

START_TIME: Final = 0.3  # s, in which the torque at the take-over passes into that of the law
DAMPING_RATIO: Final = 0.3  # -, at the default stiffness


def _damping(size: Any, settings: ControlSettings) -> float:
    return DAMPING_RATIO * critical_damping(size.joint, settings.default_stiffness)


DAMPING: Final = Declared(
    "impedance.damping", BY_SIZE, "N m s/rad", 0.0, 1e4,
    "damping that is added to that of the joint, at most the designed one",
    by_size=BySize(f"{DAMPING_RATIO:g} of the critical one at the default stiffness", _damping),
)  # fmt: skip
MUSCLES: Final = PositionStiffness()
"""Gives the pressures of the spring."""


class ImpedanceState(NamedTuple):
    """State of one joint."""

    muscles: PositionStiffnessState  # of the pressures
    start: float = 0.0  # torque at the take-over that still fades [N m]
    reached: float = math.nan  # stiffness that the muscles reached in the last cycle [N m/rad]


@dataclass(frozen=True)
class Impedance(Law[ImpedanceState]):
    """The law of the module's docstring."""

    name: ClassVar[str] = "impedance"
    is_scheduled: ClassVar[bool] = True

    damping: float = DAMPING.field()

    def cases(self, models: JointModels, settings: ControlSettings) -> list[LoopCase]:
        """The loops of the position law, whose gains bound the feedback."""
        return MUSCLES.cases(models, settings)

    def init(self, models: JointModels) -> ImpedanceState:
        """A joint that was not controlled."""
        return ImpedanceState(MUSCLES.init(models))

    def rest(self, models: JointModels, state: ImpedanceState) -> ImpedanceState:
        """The joint is taken over."""
        return state._replace(muscles=MUSCLES.rest(models, state.muscles))

    def begin(
        self, models: JointModels, state: ImpedanceState, start: Start
    ) -> tuple[float, ImpedanceState]:
        """Begin with the torque that the joint has."""
        torque, muscles = MUSCLES.begin(models, state.muscles, start)
        return torque, state._replace(muscles=muscles, start=torque)

    def plan(
        self, models: JointModels, state: ImpedanceState, request: PlanRequest
    ) -> tuple[PressurePlan, ImpedanceState]:
        """Plan the pressures of the spring, and of what it lacks."""
        fading = state.start * (1.0 - min(request.step / START_TIME, 1.0))
        output = fading + self._spring(models, state, request)
        # without an integral, which would grow while somebody holds the joint
        request = dataclasses.replace(request, output=output, integral=0.0)
        plan, muscles = MUSCLES.plan(models, state.muscles, request)
        telemetry = plan.telemetry._replace(yields=True)
        plan = dataclasses.replace(plan, missed=0.0, integral=0.0, telemetry=telemetry)
        return plan, ImpedanceState(muscles, fading, telemetry.stiffness_reached)

    def stiffness(self, state: ImpedanceState) -> float:
        """The reference of the stiffness [N m/rad]."""
        return MUSCLES.stiffness(state.muscles)

    def _spring(self, models: JointModels, state: ImpedanceState, request: PlanRequest) -> float:
        """What the feedback adds to the muscles [N m]."""
        motion, gains, seen = request.motion, request.gains, request.seen.reference
        position = models.inside(motion.position)
        lacking = 0.0
        if not math.isnan(state.reached):
            lacking = self.stiffness(state) - state.reached
        lacking = max(-gains.proportional, min(gains.proportional, lacking))
        gravity = models.dynamics.gravity
        return (
            lacking * (seen.position - position)
            + gravity(position)
            - gravity(seen.position)
            + min(self.damping, gains.derivative) * (seen.velocity - motion.velocity)
        )
