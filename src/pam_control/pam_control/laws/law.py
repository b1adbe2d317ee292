"""What a control law is: functions of a joint's models, its state and a request.

A law is a frozen dataclass. Its fields are its own parameters, each declared once (`declared`). It
holds no state: `init` makes the state of one joint, and every other function returns the next one
together with its result. Nobody else reads or writes it. The controller adds what all laws share:
references, ages of measurements, feedback, pressure loops, limits, stops.

A law that does a part of what another one does holds that other one and calls it.

What a law learns of a joint over minutes is held in objects within its state, which the law alone
uses and which it changes in place: the fits have arrays.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from pam_control.adaptation.rig_numbers import RigNumbers
from pam_control.control_step import JointTelemetry, MeasuredMotion, PlanRequest, PressurePlan
from pam_control.declared import check_fields
from pam_control.feedback.margins import LoopCase
from pam_control.feedback.pid import PidGains
from pam_control.joint_models import JointModels, PerMuscle
from pam_control.learning.motion_learner import MotionLearner
from pam_control.references.spline import JointReference
from pam_control.settings import ControlSettings


class Start(NamedTuple):
    """Where a law begins to control a joint, or goes on after a change of the settings.

    Attributes
    ----------
    position : float
        [rad].
    pressures : tuple of float
        Which the joint has, or is desired to have, now [Pa].
    settings : ControlSettings
        Complete for this joint.
    gains : PidGains
        Of the feedback.
    adapts : bool
        Whether what was learnt is used.
    reference : JointReference
        The present one; only used to go on.
    """

    position: float
    pressures: PerMuscle
    settings: ControlSettings
    gains: PidGains
    adapts: bool
    reference: JointReference


class Guidance(NamedTuple):
    """What a law asks of the reference of a joint before a cycle.

    Attributes
    ----------
    lead : float or None
        The reference has to go there [rad].
    restart : bool
        The reference has to stop, and the law begins anew from the desired pressures.
    """

    lead: float | None = None
    restart: bool = False


class GuideRequest(NamedTuple):
    """The joint before a cycle.

    Attributes
    ----------
    step : float
        Time since the last cycle [s].
    active : bool
        Whether the joint is being controlled.
    held : bool
        Whether a stop was asked for since the joint was taken over.
    torque : float or None
        Commanded [N m]; None if no torque is commanded.
    motion : MeasuredMotion
        Measured in the cycle before.
    settings : ControlSettings
        Complete for this joint.
    """

    step: float
    active: bool
    held: bool
    torque: float | None
    motion: MeasuredMotion
    settings: ControlSettings


@dataclass(frozen=True)
class Law[State](ABC):
    """A control law; see the module's docstring.

    Attributes
    ----------
    name : str
        Value of the node's parameter `law`.
    is_scheduled : bool
        Whether the gains depend on the stiffness.
    has_lead : bool
        Whether the feedback makes up for a part of the pressure loops' lag.
    has_observer : bool
        Whether the law compensates what a disturbance observer finds.
    has_adaptation : bool
        Whether the law uses what was learnt of the joints and the valves.
    takes_torques : bool
        Whether the law follows torques that are commanded.
    against_motion : str
        Why the law follows no trajectories and no streams; empty if it does.
    largest_integral : float or None
        Limit of the PID's integral unless one is given, in the unit of its output; None: by the
        size of the joint.
    guides : bool
        Whether `guide` asks anything of the references.
    together : bool
        Whether the states of all joints share their rows, so that one call plans all of them.
    bare : str
        What the muscles alone are, which must be stable without feedback; empty if it is not
        needed. See `bare_cases`.
    """

    name: ClassVar[str]
    is_scheduled: ClassVar[bool] = False
    has_lead: ClassVar[bool] = False
    has_observer: ClassVar[bool] = False
    has_adaptation: ClassVar[bool] = False
    takes_torques: ClassVar[bool] = False
    against_motion: ClassVar[str] = ""
    largest_integral: ClassVar[float | None] = None
    guides: ClassVar[bool] = False
    together: ClassVar[bool] = False
    bare: ClassVar[str] = ""

    def __post_init__(self) -> None:
        """Refuse numbers without a meaning; the node's parameters have narrower bounds."""
        check_fields(self)

    @abstractmethod
    def cases(self, models: JointModels, settings: ControlSettings) -> list[LoopCase]:
        """The linearised loops at which a joint's gains are designed and checked."""

    def bare_cases(self, models: JointModels, settings: ControlSettings) -> list[LoopCase]:
        """Loops that must be stable without any feedback of the position, too."""
        return []

    @abstractmethod
    def init(self, models: JointModels) -> State:
        """The state of a joint of which nothing is known."""

    def init_together(self, joints: Sequence[JointModels]) -> list[State]:
        """The states of all joints, of which nothing is known."""
        return [self.init(models) for models in joints]

    def rest(self, models: JointModels, state: State) -> State:
        """The state of a joint whose motion before was another one; what was learnt stays."""
        return self.init(models)

    def forget(self, models: JointModels, state: State) -> State:
        """The state without what was learnt of the joint."""
        return state

    @abstractmethod
    def begin(self, models: JointModels, state: State, start: Start) -> tuple[float, State]:
        """The PID's output with which the first desired pressures are the present ones."""

    def resume(self, models: JointModels, state: State, start: Start) -> tuple[float, State] | None:
        """The same after a change of the settings, for the present reference.

        None: the law begins anew, and the feedback forgets the slope of the error.
        """
        return None

    def guide(
        self, models: JointModels, state: State, request: GuideRequest
    ) -> tuple[Guidance, State]:
        """What the law asks of the reference before a cycle."""
        return Guidance(), state

    @abstractmethod
    def plan(
        self, models: JointModels, state: State, request: PlanRequest
    ) -> tuple[PressurePlan, State]:
        """Plan the pressures of a joint for one cycle."""

    # A law with `together` has these functions as well, and `plan` for a law that holds it.

    def use(
        self, models: JointModels, state: State, settings: ControlSettings, adapts: bool
    ) -> None:
        """Use these settings of a joint, and what was learnt or not, from the next cycle on."""
        return

    def ask(
        self,
        models: JointModels,
        state: State,
        stiffness: float,
        settings: ControlSettings,
        adapts: bool,
    ) -> State:
        """Take the commanded stiffness [N m/rad] of a joint for the cycle that is being planned."""
        return state

    def asks_again(self, settings: ControlSettings, adapts: bool) -> bool:
        """Whether `ask` answers otherwise in each cycle, even for the same stiffness."""
        return True

    def scheduling(self, states: Sequence[State]) -> tuple[Any, int, Any, int]:
        """Rows of all joints and a place in them that hold `stiffness`; the same for `delay`."""
        raise NotImplementedError(f"{self.name} plans each joint alone")

    def plan_together(
        self, states: Sequence[State], step: float, learners: Mapping[int, MotionLearner]
    ) -> None:
        """Plan one cycle of all joints, after a step [s], in their rows.

        `learners` are those of the joints whose motion is repeated, by place.
        """
        raise NotImplementedError(f"{self.name} plans each joint alone")

    def stiffness(self, state: State) -> float:
        """Stiffness that the joint is asked for now [N m/rad], by which gains are scheduled."""
        return math.nan

    def delay(self, state: State) -> float:
        """By which the position is later than the pressures, as was learnt [s].

        Negative if the pressures are later.
        """
        return 0.0

    def report(
        self, models: JointModels, state: State, telemetry: JointTelemetry
    ) -> Mapping[str, float]:
        """What was learnt of a joint, for its diagnostics; names contain the unit."""
        return {}

    def numbers(self, state: State) -> RigNumbers | None:
        """What was learnt of the numbers of the rig file; None if the law learns nothing."""
        return None


AnyLaw = Law[Any]
