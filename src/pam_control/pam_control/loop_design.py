"""Design and check of the gains of all joints of a rig, with normal and with soft gains."""

from __future__ import annotations

import contextlib
import dataclasses
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path

from pam_control.feedback.gain_design import DesignTask, design_pressure_gain
from pam_control.feedback.kept_designs import KeptDesigns
from pam_control.feedback.linear_joint import LoopTiming
from pam_control.feedback.margins import (
    ControlDesignError,
    LoopCase,
    Margins,
    checked_margins,
)
from pam_control.feedback.observer_design import ObserverCost
from pam_control.feedback.pid import PidGains
from pam_control.feedback.supply_reservoir import SupplyReservoir
from pam_control.joint_channel import JointChannel
from pam_control.learning.learning_filter import LearningFilter
from pam_control.learning.learning_session import LearningSession
from pam_control.settings import ControlSettings
from pam_model.errors import RigError
from pam_model.rig import Rig
from pam_model.robot import compose
from pam_model.views.pull_over_travel import refuse_slack_muscles
from pam_ros.valve_command import PRESSURE_REGULATOR

WARM_UP = 2  # repetitions in which the adaptation learns the rig
LEARNING_FIELDS = ("learning_motion", "learning_file", "adaptation", "default_stiffness")
STIFFNESS_RANGE = 0.15  # about the default stiffness, for which learning converges


@dataclass(frozen=True, slots=True)
class Loops:
    """Settings with all gains, and the margins of every joint with them.

    Attributes
    ----------
    settings : ControlSettings
        No gain is missing.
    margins : list of list of Margins
        By joint.
    soft : bool
        Whether they are for a joint that has oscillated: nothing is learnt then.
    """

    settings: ControlSettings
    margins: list[list[Margins]]
    soft: bool = False

    def changed_to(self, settings: ControlSettings) -> Loops:
        """Other settings with the same loops."""
        mine = self.settings
        kept = {
            "gains": mine.gains,
            "pressure_gain": mine.pressure_gain,
            "observer": mine.observer,
            "extra_delay": mine.extra_delay,
            "adaptation": settings.adaptation and not self.soft,
        }
        return dataclasses.replace(self, settings=settings.replace(**kept))


@dataclass(frozen=True, slots=True)
class PreparedSettings:
    """Settings as asked for, the loops with normal and with soft gains, and what is learnt."""

    asked: ControlSettings
    normal: Loops
    soft: Loops | None
    learning: LearningSession | None = None


class LoopDesign(ABC):
    """Designs and checks the loops of a control law, which says how it is connected to them.

    Parameters
    ----------
    rig : Rig
        What is controlled.
    settings : ControlSettings
        The settings at the start.
    designs : KeptDesigns, optional
        Store of designed gains for equal joints and later starts; by default in memory only.
    """

    def __init__(
        self, rig: Rig, settings: ControlSettings, designs: KeptDesigns | None = None
    ) -> None:
        self.rig = rig
        self.designs = designs or KeptDesigns()
        self.robot = compose(rig)
        refuse_slack_muscles(self.robot)
        self.reservoir = SupplyReservoir(self.robot)
        self.channels = [
            JointChannel(self.robot, joint, settings.min_pressure, self.reservoir)
            for joint in self.robot.joints
        ]
        self.prepared = self._with_learning(self._designed_and_checked(settings))

    has_observer = False
    """Whether the law compensates what a disturbance observer finds."""
    has_adaptation = False
    """Whether the law uses what was learnt of the joints and the valves."""

    @abstractmethod
    def cases(self, channel: JointChannel, settings: ControlSettings) -> list[LoopCase]:
        """The linearised loops at which a joint's gains are designed and checked."""

    def timing(self, channel: JointChannel, settings: ControlSettings) -> LoopTiming:
        """The delays of a joint's loop, including the unknown delay that the design assumes.

        Raises
        ------
        RigError
            For a joint with a flow valve and a pressure regulator, for which no gains are designed.
        """
        valves = [muscle.valve for muscle in channel.muscles]
        if valves[0].kind != valves[1].kind:
            raise RigError(
                f"{channel.joint.name}: its muscles have a {valves[0].kind} and a "
                f"{valves[1].kind} valve; the controller needs the same kind for both"
            )
        return LoopTiming(
            period=settings.period,
            transport_delay=settings.measurement_delay
            + settings.command_delay
            + settings.extra_delay
            + max(channel.command_delays)
            + channel.pressure_lag,
            valve_time_constant=max(channel.valve_time_constants),
            lead_ratio=settings.lead_ratio,
            velocity_filter=settings.derivative_filter,
            regulated=valves[0].kind == PRESSURE_REGULATOR,
            position_delay=channel.position_delay,
        )

    def designed(self, settings: ControlSettings) -> ControlSettings:
        """The settings with every missing gain designed.

        Raises
        ------
        ControlDesignError
            When no gains reach the required margins.
        """
        if settings.pressure_gain is None:
            timings = [self.timing(channel, settings) for channel in self.channels]
            # a pressure regulator closes its own loop and does not limit the gain of the others
            ours = [timing for timing in timings if not timing.regulated] or timings
            settings = settings.replace(pressure_gain=min(map(design_pressure_gain, ours)))
        gains = dict(settings.gains)
        for channel in self.channels:
            name = channel.joint.name
            if name not in gains:
                given = settings.partial_gains.get(name, {})
                gains[name] = dataclasses.replace(self._found(channel, settings), **given)
            if self.has_observer and settings.observer and settings.observer_bandwidth > 0.0:
                gains[name] = dataclasses.replace(gains[name], observer=settings.observer_bandwidth)
        return settings.replace(gains=gains)

    def _task(self, channel: JointChannel, settings: ControlSettings) -> DesignTask:
        return DesignTask(
            tuple(self.cases(channel, settings)),
            self.timing(channel, settings),
            settings.phase_margin,
            settings.sensitivity,
            settings.derivative_filter,
        )

    def _found(self, channel: JointChannel, settings: ControlSettings) -> PidGains:
        """Designed gains; without an observer if none keeps the margins."""
        task, name = self._task(channel, settings), channel.joint.name
        if self.has_observer and settings.observer and settings.feedforward:
            with contextlib.suppress(ControlDesignError):
                observed = dataclasses.replace(task, unknown_delay=settings.extra_delay)
                return self.designs.pid(name, observed)
        return self.designs.pid(name, task)

    def _check_observer(self, channel: JointChannel, settings: ControlSettings) -> None:
        gains = settings.gains[channel.joint.name]
        if gains.observer == 0.0:
            return
        task = self._task(channel, settings)
        cost = ObserverCost(dataclasses.replace(task, unknown_delay=settings.extra_delay))
        if not cost.stable(gains):
            raise ControlDesignError(
                f"{channel.joint.name}: a disturbance observer of {gains.observer:g} rad/s makes "
                f"the loop unstable if a measurement is {1e3 * settings.extra_delay:g} ms late or "
                "the limb is heavier than written"
            )

    def check(self, settings: ControlSettings) -> list[list[Margins]]:
        """Margins of every joint with these settings, the worst operating point first.

        Raises
        ------
        ControlDesignError
            When a loop is not safe.
        """
        found = []
        for channel in self.channels:
            self._check_observer(channel, settings)
            cases, timing = self.cases(channel, settings), self.timing(channel, settings)
            gains = settings.gains[channel.joint.name]
            stable = self.designs.stable(cases, timing, gains)
            found.append(checked_margins(channel.joint.name, cases, timing, gains, stable))
        return found

    def is_quick(self, settings: ControlSettings) -> bool:
        """Whether `prepare` only copies: it designs, checks and reads nothing."""
        before = self.prepared.asked
        return (
            not settings.changes_loop(before)
            and settings.default_stiffness == before.default_stiffness
            and self._learns_as_before(settings)
        )

    def prepare(self, settings: ControlSettings) -> PreparedSettings:
        """Design and check other settings, which may take minutes; nothing changes yet.

        Raises
        ------
        ControlDesignError
            When a loop would not be safe.
        """
        before = self.prepared
        if settings.changes_loop(before.asked):
            return self._with_learning(self._designed_and_checked(settings))
        normal, soft = before.normal, before.soft
        prepared = PreparedSettings(
            settings, normal.changed_to(settings), soft and soft.changed_to(settings)
        )
        if self._learns_as_before(settings):
            return dataclasses.replace(prepared, learning=before.learning)
        return self._with_learning(prepared)

    def _learns_as_before(self, settings: ControlSettings) -> bool:
        before = self.prepared.asked
        return not (self._learns(before) or self._learns(settings)) or all(
            getattr(settings, name) == getattr(before, name) for name in LEARNING_FIELDS
        )

    def _learns(self, settings: ControlSettings) -> bool:
        """Whether repeated motions are learnt."""
        return bool(settings.learning_motion) and self.has_adaptation and settings.feedforward

    def _with_learning(self, prepared: PreparedSettings) -> PreparedSettings:
        """With the learning that the settings ask for.

        Raises
        ------
        PamError
            For a file that cannot be read; ControlDesignError if no learning filter converges.
        """
        settings = prepared.normal.settings
        if not self._learns(settings):
            return prepared
        told = settings.replace(extra_delay=0.0)
        filters = {
            channel.joint.name: LearningFilter(
                channel.joint.name,
                self.cases(
                    channel, told.replace(stiffness_grid=_near_stiffness(channel, settings))
                ),
                self.timing(channel, told),
                settings.gains[channel.joint.name],
            )
            for channel in self.channels
        }
        path = Path(settings.learning_file) if settings.learning_file else None
        warm_up = WARM_UP if settings.adaptation else 1
        session = LearningSession(
            self.rig,
            settings.learning_motion,
            path,
            filters,
            settings.period,
            warm_up,
            read=self.designs.compute,
        )
        return dataclasses.replace(prepared, learning=session)

    def _designed_and_checked(self, settings: ControlSettings) -> PreparedSettings:
        designed = self.designed(settings)
        normal = Loops(designed, self.check(designed))
        if settings.safe_delay <= settings.extra_delay:
            return PreparedSettings(settings, normal, None)
        soft: Loops | None = None
        with contextlib.suppress(ControlDesignError):
            asked = settings.replace(
                extra_delay=settings.safe_delay,
                pressure_gain=None,
                gains={},
                partial_gains={},
                observer=False,
                adaptation=False,
            )
            designed = self.designed(asked)
            soft = Loops(designed, self.check(designed), soft=True)
        return PreparedSettings(settings, normal, soft)


def _near_stiffness(channel: JointChannel, settings: ControlSettings) -> tuple[float, ...]:
    stiffness = channel.scale.complete(settings).default_stiffness
    return tuple(share * stiffness for share in (1.0 - STIFFNESS_RANGE, 1.0, 1.0 + STIFFNESS_RANGE))
